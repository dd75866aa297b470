"""A subject's plan: everything that the stages need to know about one subject of the study."""

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
from shukotsu.tables.catalogue import FINDINGS
from shukotsu.tables.parts import Part, parts_in
from shukotsu.tables.poses import one_hand, recording_name
from shukotsu.tables.subjects import Hand, SubjectSession
from shukotsu.tables.typed_table import read_table, rows_of
from shukotsu.tables.whole_files import remedy_of


@dataclass(frozen=True)
class SubjectPlan:
    """One subject of a study, in one session where the recordings sheet names any.

    folder : the subject's results, results/<study>/sub-S. sizes_mm : of the hand, by SIZES, None where not
    measured. factors : the subject's levels, by the participants sheet. layouts : by hand. models : by name,
    in the study's order. rows : the subject's rows of HAND_SHEETS, by sheet. sheets : their paths, for
    messages. is_study : whether the recordings' roles say what calibrates a model and which tasks are left
    out in turn; else every recording is used as a command line names it. refused : recordings that a finding
    refuses, which are excluded with its sentence. suspect : those that a finding suspects. named_tables :
    tables that a command line names, by name, hand and model, these two empty but for a fit's; None where all
    are read from the subject's folder. named_poses : likewise poses tables, by key_in_session.
    """

    study: str
    who: SubjectSession
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

    def hand(self, side: str) -> Hand:
        """The subject's right or left hand."""
        return Hand(self.who.subject, side, self.who.session)

    @property
    def hands(self) -> tuple[str, ...]:
        """The subject's hands, in the sheet's order."""
        return tuple(self.layouts)

    def poses(self, recording: Recording) -> Path:
        """Return a recording's poses table. Raises InputError where a command line names others alone."""
        key = recording.key_in_session
        if self.named_poses is None or (recording.exclude and key not in self.named_poses):
            return self.folder / recording.hand.hand / recording.name / "poses.parquet"
        if key not in self.named_poses:
            raise InputError(
                f"--poses: lacks those of {recording.hand}, {recording.name}; name their file there"
            )
        return self.named_poses[key]

    def table(self, name: str, hand: str = "", model: str = "") -> Path:
        """Return the file of a table; of a fit of the whole hand that of a hand under a model.

        Raises InputError where a command line names the tables to read, and not this one.
        """
        if self.named_tables is None:
            return table_in(self.folder, name, hand, model)
        is_of_fit = name in FIT_TABLES
        key = (name, hand, model) if is_of_fit else (name, "", "")
        if key not in self.named_tables:
            whose = f"of the {hand} hand under model {model} " if is_of_fit else ""
            raise InputError(f"{option_of(name)}: no table {whose}is given; name its file there")
        return self.named_tables[key]

    def files_of(self, name: str) -> list[Path]:
        """Files of a table: one; of a fit of the whole hand one for every hand and fitted model."""
        fits = self.fits_of_hands() if name in FIT_TABLES else [("", "")]
        return [self.table(name, *fit) for fit in fits]

    def fits_of_hands(self) -> list[tuple[str, str]]:
        """Return every hand with each model that fits it whole."""
        return [(hand, model) for hand in self.hands for model in self.fitted_models]

    @property
    def fitted_models(self) -> tuple[str, ...]:
        """Models that fit the whole hand."""
        return tuple(name for name, model in self.models.items() if model.fitting is not None)

    def recordings_of(self, hand: str, *roles: str) -> list[Recording]:
        """The hand's recordings in the given roles, without excluded ones."""
        return [r for r in self.recordings if r.hand.hand == hand and r.role in roles and not r.exclude]

    def evaluated(self, hand: str, made_without: str = "") -> list[Recording]:
        """Recordings in which tips are evaluated; for a skeleton made without a task, those of that task."""
        recordings = self.recordings_of(hand, "evaluation", "both")
        return [r for r in recordings if made_without in ("", r.task)]

    def posed(self, hand: str, made_without: str = "") -> list[Recording]:
        """Recordings in which a skeleton is posed and measured: all, or those of the task made without.

        Of a hand alone those that the command line names for that.
        """
        whole = self.is_study and not made_without
        calibrating = self.recordings_of(hand, "calibration") if whole else []
        return [*self.evaluated(hand, made_without), *calibrating]

    def all_calibrating(self, hand: str) -> list[Recording]:
        """Recordings that may calibrate the hand under any model."""
        return self.recordings_of(hand, "calibration", "both")

    def calibrating(self, hand: str, model: str, made_without: str = "") -> list[Recording]:
        """Recordings from which joints are solved under a model, without one task if it is named."""
        recordings = [r for r in self.all_calibrating(hand) if not made_without or r.task != made_without]
        scored = [r for r in recordings if r.role == "both"]
        chosen = self.is_study and self.models[model].joints.calibration == "evaluated" and scored
        return scored if chosen else recordings

    def left_out(self, hand: str, model: str) -> list[str]:
        """Tasks to leave out in turn: those evaluated that would else be calibrated on as well.

        One without which nothing is left to calibrate on is not among them, and a reference learns from none.
        """
        if not self.is_study or self.models[model].is_reference:
            return []
        used = {recording.task for recording in self.calibrating(hand, model)}
        tasks = dict.fromkeys(recording.task for recording in self.evaluated(hand))
        return [task for task in tasks if task in used and self.calibrating(hand, model, task)]

    def naming(self, poses: Sequence[Path], tables: Mapping[str, Sequence[Path]]) -> SubjectPlan:
        """Return the plan with the poses and tables named on a command line, identified by their content.

        poses : none where they are read from where the plan says. tables : by name. Raises InputError where
        two files are of the same, TableError where poses are of no recording of the plan.
        """
        named: dict[tuple[str, str, str], Path] = {}
        for name, path in ((name, path) for name, paths in tables.items() for path in paths):
            fits = {(part.hand, part.model) for part in parts_in(path)} if name in FIT_TABLES else {("", "")}
            for fit in fits:
                if named.setdefault((name, *fit), path) != path:
                    raise InputError(
                        f"{option_of(name)}: {path}: is of the same as {named[name, *fit]}; name one of them"
                    )
        files: dict[tuple[str, str, str], Path] = {}
        recordings = {(r.hand, r.task, r.trial): r.key_in_session for r in self.recordings}
        for path in poses:
            in_file = recording_name(path)
            key = recordings.get((in_file.of_hand, in_file.task, in_file.trial))
            if key is None or key in files:
                reason = "which the plan lacks" if key is None else f"as {files[key]} is"
                raise TableError(f"{path}: is of {in_file}, {reason}; {remedy_of(path)}")
            files[key] = path
        return replace(self, named_tables=named, named_poses=files if poses else self.named_poses)

    def checked(self, findings: Path) -> SubjectPlan:
        """Return the plan with the refusals and suspicions of the subject's findings table."""
        reasons: dict[str, dict[tuple[str, str, str], str]] = {REFUSED: {}, SUSPECT: {}}
        for row in rows_of(read_table(findings, FINDINGS)):
            of_severity = reasons.get(row["severity"], {})
            of_severity.setdefault((row["hand"], row["task"], row["trial"]), row["message"])
        recordings, refused, suspect = [], [], []
        for recording in self.recordings:
            key = recording.key_in_session
            if key in reasons[SUSPECT]:
                suspect.append(recording)
            if key in reasons[REFUSED] and not recording.exclude:
                recording = replace(recording, exclude=reasons[REFUSED][key])
                refused.append(recording)
            recordings.append(recording)
        return replace(self, recordings=tuple(recordings), refused=tuple(refused), suspect=tuple(suspect))

    def doubted(self, hand: str) -> str:
        """Title of the hand's first recording that a finding refuses or suspects; empty where none does."""
        doubts = (*self.refused, *self.suspect)
        return next((recording.title for recording in doubts if recording.hand.hand == hand), "")

    def check_calibration_left(self, hand: str) -> None:
        """Raise InputError, with the finding, where a hand has only refused recordings to calibrate on."""
        refused = [recording for recording in self.refused if recording.hand.hand == hand]
        if refused and not self.all_calibrating(hand):
            raise InputError(f"no calibration recording is left: {refused[0].exclude}")

    def part(self, hand: str, model: str = "", made_without: str = "") -> Part:
        """Return a part of the subject's tables."""
        return Part(hand, model, made_without, *self.who)

    def parts(self, *models: str) -> list[Part]:
        """Every skeleton of the models (default: all): the whole one, then those without each task."""
        return [
            self.part(hand, model, task)
            for hand in self.hands
            for model in models or self.models
            for task in ("", *self.left_out(hand, model))
        ]

    @property
    def whole_parts(self) -> list[Part]:
        """Every whole skeleton."""
        return [part for part in self.parts() if not part.made_without]


SheetRow = TypeVar("SheetRow", Row, dict[str, Any])


def rows_of_session(rows: Sequence[SheetRow], sheet: Sheet, session: str) -> list[SheetRow]:
    """Return a subject's rows of a sheet for a session: its own rows, and rows for all sessions that they do
    not override.
    """
    key = [column for column in sheet.key if column != "session"]
    of_session = [row for row in rows if row["session"] == session]
    named = {tuple(row[column] for column in key) for row in of_session}
    return [
        row
        for row in rows
        if row["session"] == session
        or (not row["session"] and tuple(row[column] for column in key) not in named)
    ]


@dataclass(frozen=True)
class NamedHand:
    """One hand as a command line names it.

    calibration, evaluated : poses files, one may be both. subject, session, hand : whose, where no file says.
    sizes_mm : as of SubjectPlan. sheets : paths of HAND_SHEETS, of which the rows of this hand count.
    """

    calibration: Sequence[Path]
    evaluated: Sequence[Path]
    subject: str | None = None
    session: str | None = None
    hand: str | None = None
    sizes_mm: Mapping[str, float | None] = field(default_factory=dict)
    sheets: Mapping[str, Path | None] = field(default_factory=dict)


def plan_of_poses(named: NamedHand, layout: Layout, models: Sequence[SkeletonModel]) -> SubjectPlan:
    """Make a plan of one hand's poses files as a command line names them, for a stage that is run alone.

    Raises InputError where the files are of several hands, or two are of one recording, which would count
    twice.
    """
    poses = [*named.calibration, *named.evaluated]
    whose = one_hand(poses, named.subject, named.session, named.hand)
    files: list[Path] = []
    for path in poses:
        if not any(other.samefile(path) for other in files):
            files.append(path)
    recordings: list[Recording] = []
    file_of: dict[tuple[str, str, str], Path] = {}
    for path in files:
        in_file = recording_name(path)
        is_in = [any(path.samefile(each) for each in paths) for paths in (named.calibration, named.evaluated)]
        role = "both" if all(is_in) else "calibration" if is_in[0] else "evaluation"
        source = Source(path, str(path), Path(layout.name))
        recording = Recording(whose, in_file.task, in_file.trial, role, source)
        first = file_of.setdefault(recording.key_in_session, path)
        if first != path:
            raise InputError(
                f"{path}: is of {in_file}, as {first} is; give a recording once, and import another "
                "repetition with a --trial of its own"
            )
        recordings.append(recording)
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
        recordings=tuple(recordings),
        layouts={whose.hand: layout},
        models={model.name: model for model in models},
        rows=rows,
        sheets=sheets,
        is_study=False,
        named_poses=file_of,
    )
