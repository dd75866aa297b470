"""A subject's plan: everything that the stages need to know of the study about one subject."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from shukotsu.command_line import option_of
from shukotsu.errors import InputError, TableError
from shukotsu.study.findings import REFUSED, SUSPECT
from shukotsu.study.layout import Layout
from shukotsu.study.model import SkeletonModel
from shukotsu.study.results import FIT_TABLES, table_in
from shukotsu.study.sheets import HAND_SHEETS, SHEETS, Row, Sheet, read_sheet
from shukotsu.study.study import SIZES, Recording, Source
from shukotsu.tables import catalogue, subjects, typed_table, whole_files
from shukotsu.tables.parts import Part, parts_in
from shukotsu.tables.poses import one_hand, recording_name


@dataclass(frozen=True)
class SubjectPlan:
    """Plan of one subject, for a single session if the recordings sheet has sessions.

    Attributes
    ----------
    study, who
        Names of the study, and of the subject and session.
    folder
        Folder of the subject's results, results/<study>/sub-S.
    sizes_mm
        Sizes of the hand by their names in SIZES; None if not measured.
    factors
        The subject's levels of the study's factors, from the participants sheet.
    recordings
        All recordings, including excluded ones.
    layouts, models
        Layouts by hand, and models by name in the study's order.
    rows, sheets
        The subject's rows of each sheet in HAND_SHEETS, and the sheets' paths for messages.
    is_study
        Whether the recordings' roles determine which recordings calibrate a model and which tasks are left
        out in turn; if not, recordings are used as the command line names them.
    refused
        Recordings that a finding refuses; they are excluded with its sentence as the reason.
    suspect
        Recordings that a finding marks as suspect.
    named_tables
        Tables named on a command line, by table, hand and model (both empty unless the table is a fit's);
        None if all tables are read from `folder`.
    named_poses
        Poses tables named on a command line, by `Recording.key_in_session`, or None.

    """

    study: str
    who: subjects.SubjectSession
    folder: Path
    sizes_mm: Mapping[str, float | None]
    factors: Mapping[str, str]
    recordings: tuple[Recording, ...]
    layouts: Mapping[str, Layout]
    models: Mapping[str, SkeletonModel]
    rows: Mapping[str, tuple[Row, ...]]
    sheets: Mapping[str, Path]
    is_study: bool = True
    refused: tuple[Recording, ...] = ()
    suspect: tuple[Recording, ...] = ()
    named_tables: Mapping[tuple[str, str, str], Path] | None = None
    named_poses: Mapping[tuple[str, str, str], Path] | None = None

    def hand(self, side: str) -> subjects.Hand:
        """Return the subject's hand of this side (right or left)."""
        return subjects.Hand(self.who.subject, side, self.who.session)

    @property
    def hands(self) -> tuple[str, ...]:
        """Sides of the subject's hands, in the order of the recordings sheet."""
        return tuple(self.layouts)

    def poses(self, recording: Recording) -> Path:
        """Return the file of a recording's poses table.

        Raises InputError if the command line names poses tables but not that of this recording.
        """
        key = recording.key_in_session
        if self.named_poses is None or (recording.exclude and key not in self.named_poses):
            return self.folder / recording.hand.hand / recording.name / "poses.parquet"
        if key not in self.named_poses:
            raise InputError(
                f"--poses: lacks the poses of {recording.hand}, {recording.name}; add their file there"
            )
        return self.named_poses[key]

    def table(self, name: str, hand: str = "", model: str = "") -> Path:
        """Return the file of a table. hand, model : of which hand and model, for tables of whole-hand fits.

        Raises InputError if the command line names tables but not this one.
        """
        if self.named_tables is None:
            return table_in(self.folder, name, hand, model)
        is_of_fit = name in FIT_TABLES
        key = (name, hand, model) if is_of_fit else (name, "", "")
        if key not in self.named_tables:
            whose = f"of the {hand} hand under model {model} " if is_of_fit else ""
            raise InputError(f"{option_of(name)}: no table {whose}is given; add its file to the option")
        return self.named_tables[key]

    def files_of(self, name: str) -> list[Path]:
        """Return the files of a table: one, or for FIT_TABLES one per hand and fitted model."""
        fits = self.fits_of_hands() if name in FIT_TABLES else [("", "")]
        return [self.table(name, *fit) for fit in fits]

    def fits_of_hands(self) -> list[tuple[str, str]]:
        """Return all pairs of a hand and a model that fits the whole hand."""
        return [(hand, model) for hand in self.hands for model in self.fitted_models]

    @property
    def fitted_models(self) -> tuple[str, ...]:
        """Names of the models that fit the whole hand."""
        return tuple(name for name, model in self.models.items() if model.fitting is not None)

    def recordings_of(self, hand: str, *roles: str) -> list[Recording]:
        """Return the hand's recordings with one of these roles, without excluded ones."""
        return [r for r in self.recordings if r.hand.hand == hand and r.role in roles and not r.exclude]

    def evaluated(self, hand: str, made_without: str = "") -> list[Recording]:
        """Return the recordings in which tips are evaluated, or only those of the task `made_without`."""
        recordings = self.recordings_of(hand, "evaluation", "both")
        return [r for r in recordings if made_without in ("", r.task)]

    def posed(self, hand: str, made_without: str = "") -> list[Recording]:
        """Return the recordings in which a skeleton is posed and measured.

        In a study: those evaluated and those for calibration only; for a skeleton made without a task, only
        recordings of that task. Outside a study: the recordings that the command line names for evaluation.
        """
        whole = self.is_study and not made_without
        calibrating = self.recordings_of(hand, "calibration") if whole else []
        return [*self.evaluated(hand, made_without), *calibrating]

    def all_calibrating(self, hand: str) -> list[Recording]:
        """Return all recordings that the hand can be calibrated on; a model may use a part of them."""
        return self.recordings_of(hand, "calibration", "both")

    def calibrating(self, hand: str, model: str, made_without: str = "") -> list[Recording]:
        """Return the recordings that a model solves the joints from, without those of task `made_without`."""
        recordings = [r for r in self.all_calibrating(hand) if not made_without or r.task != made_without]
        scored = [r for r in recordings if r.role == "both"]
        chosen = self.is_study and self.models[model].joints.calibration == "evaluated" and scored
        return scored if chosen else recordings

    def left_out(self, hand: str, model: str) -> list[str]:
        """Return the tasks to leave out in turn because they are used for both calibration and evaluation.

        A task is not left out if no calibration recording would remain. The reference model uses no data, so
        no task is left out of it.
        """
        if not self.is_study or self.models[model].is_reference:
            return []
        used = {recording.task for recording in self.calibrating(hand, model)}
        tasks = dict.fromkeys(recording.task for recording in self.evaluated(hand))
        return [task for task in tasks if task in used and self.calibrating(hand, model, task)]

    def naming(self, poses: Sequence[Path], tables: Mapping[str, Sequence[Path]]) -> SubjectPlan:
        """Return the plan with the poses and tables that a command line names, identified by their content.

        poses : poses tables; if empty, they stay where the plan has them. tables : files by table name.
        Raises InputError if two files hold the same hand and model of a table, and TableError if poses are
        of a recording that the plan lacks or that another file already has.
        """
        named: dict[tuple[str, str, str], Path] = {}
        for name, path in ((name, path) for name, paths in tables.items() for path in paths):
            fits = {(part.hand, part.model) for part in parts_in(path)} if name in FIT_TABLES else {("", "")}
            for fit in fits:
                if named.setdefault((name, *fit), path) != path:
                    raise InputError(
                        f"{option_of(name)}: {path}: is of the same hand and model as {named[name, *fit]}; "
                        "name only one of them"
                    )
        files: dict[tuple[str, str, str], Path] = {}
        recordings = {(r.hand, r.task, r.trial): r.key_in_session for r in self.recordings}
        for path in poses:
            in_file = recording_name(path)
            key = recordings.get((in_file.of_hand, in_file.task, in_file.trial))
            if key is None or key in files:
                reason = "which the plan lacks" if key is None else f"as {files[key]} is"
                raise TableError(f"{path}: is of {in_file}, {reason}; {whole_files.remedy_of(path)}")
            files[key] = path
        return replace(self, named_tables=named, named_poses=files if poses else self.named_poses)

    def checked(self, findings: Path) -> SubjectPlan:
        """Return the plan with the refusals and suspicions of the subject's findings table."""
        reasons: dict[tuple[str, ...], str] = {}
        for row in typed_table.rows_of(typed_table.read_table(findings, catalogue.FINDINGS)):
            key = row["severity"], row["hand"], row["task"], row["trial"]
            reasons.setdefault(key, row["message"])
        refused = {
            recording: replace(recording, exclude=reasons[REFUSED, *recording.key_in_session])
            for recording in self.recordings
            if (REFUSED, *recording.key_in_session) in reasons and not recording.exclude
        }
        recordings = tuple(refused.get(recording, recording) for recording in self.recordings)
        suspect = tuple(r for r in self.recordings if (SUSPECT, *r.key_in_session) in reasons)
        return replace(self, recordings=recordings, refused=tuple(refused.values()), suspect=suspect)

    def doubted(self, hand: str) -> str:
        """Return the title of the hand's first refused or suspect recording, or an empty string."""
        doubts = (*self.refused, *self.suspect)
        return next((recording.title for recording in doubts if recording.hand.hand == hand), "")

    def check_calibration_left(self, hand: str) -> None:
        """Raise InputError with the finding if all calibration recordings of a hand were refused."""
        refused = [recording for recording in self.refused if recording.hand.hand == hand]
        if refused and not self.all_calibrating(hand):
            raise InputError(f"no calibration recording is left: {refused[0].exclude}")

    def part(self, hand: str, model: str = "", made_without: str = "") -> Part:
        """Return the key of a hand's skeleton in the subject's tables."""
        return Part(hand, model, made_without, *self.who)

    def parts(self, *models: str) -> list[Part]:
        """Return the keys of all skeletons of these models (default: all models).

        Each hand and model has a skeleton made from all tasks, then one without each task of `left_out`.
        """
        return [
            self.part(hand, model, task)
            for hand in self.hands
            for model in models or self.models
            for task in ("", *self.left_out(hand, model))
        ]

    @property
    def whole_parts(self) -> list[Part]:
        """Keys of the skeletons that are made from all tasks."""
        return [part for part in self.parts() if not part.made_without]


SheetRow = TypeVar("SheetRow", Row, dict[str, Any])


def rows_of_session(rows: Sequence[SheetRow], sheet: Sheet, session: str) -> list[SheetRow]:
    """Return the rows of a subject that apply to a session.

    Rows that name no session apply to all sessions, unless a row of the session has the same key otherwise.
    """

    def key_of(row: SheetRow) -> tuple[Any, ...]:
        return tuple(row[column] for column in sheet.key if column != "session")

    named = {key_of(row) for row in rows if row["session"] == session}
    return [r for r in rows if r["session"] == session or not (r["session"] or key_of(r) in named)]


@dataclass(frozen=True)
class NamedHand:
    """One hand as named on a command line.

    calibration, evaluated : poses files; a file may be in both. subject, session, hand : whose hand it is,
    needed if the files do not state it. sizes_mm : as in SubjectPlan. sheets : paths by the names in
    HAND_SHEETS; only rows of this hand are used.
    """

    calibration: Sequence[Path]
    evaluated: Sequence[Path]
    subject: str | None = None
    session: str | None = None
    hand: str | None = None
    sizes_mm: Mapping[str, float | None] = field(default_factory=dict)
    sheets: Mapping[str, Path | None] = field(default_factory=dict)


def plan_of_poses(named: NamedHand, layout: Layout, models: Sequence[SkeletonModel]) -> SubjectPlan:
    """Make a plan from one hand's poses files, for a stage that runs outside a study.

    Raises InputError if the files are of several hands, or if two are of the same recording, whose weight
    would be doubled.
    """
    poses = [*named.calibration, *named.evaluated]
    whose = one_hand(poses, named.subject, named.session, named.hand)
    recordings: dict[tuple[str, str, str], Recording] = {}
    for path in poses:
        in_file = recording_name(path)
        is_in = [any(path.samefile(each) for each in paths) for paths in (named.calibration, named.evaluated)]
        role = "both" if all(is_in) else "calibration" if is_in[0] else "evaluation"
        source = Source(path, str(path), Path(layout.name))
        recording = Recording(whose, in_file.task, in_file.trial, role, source)
        first = recordings.setdefault(recording.key_in_session, recording).source.file
        if not first.samefile(path):
            raise InputError(
                f"{path}: is of {in_file}, as {first} is; give each recording once, and import another "
                "repetition under a different --trial"
            )
    sheets = {name: path for name, path in named.sheets.items() if path is not None}
    rows = {}
    for name in HAND_SHEETS:
        of_hand = [
            row
            for row in read_sheet(sheets.get(name), SHEETS[name])
            if (row["subject"], row["hand"]) == (whose.subject, whose.hand)
        ]
        rows[name] = tuple(rows_of_session(of_hand, SHEETS[name], whose.session))
    return SubjectPlan(
        study="",
        who=whose.who,
        folder=Path(),
        sizes_mm={name: named.sizes_mm.get(name) for name in SIZES},
        factors={},
        recordings=tuple(recordings.values()),
        layouts={whose.hand: layout},
        models={model.name: model for model in models},
        rows=rows,
        sheets=sheets,
        is_study=False,
        named_poses={key: recording.source.file for key, recording in recordings.items()},
    )
