"""A subject's plan: everything that the stages need to know about one subject of the study.

`results/<study>/sub-S/plan.json` holds the subject's recordings with their roles, the layout of each hand,
the models, sizes and the rows of the sheets that are the subject's. A session that the recordings sheet names
has a plan of its own, `sub-S_ses-X/plan.json`. It is written from the study file by the
workflow; paths in it are relative to the working directory.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from shukotsu.errors import InputError, TableError
from shukotsu.study.config_files import CONFIG_FOLDER, REFERENCE, config_path, read_config
from shukotsu.study.findings import REFUSED, SUSPECT
from shukotsu.study.layout import Layout, layout_from_config
from shukotsu.study.model import SkeletonModel, model_from_config
from shukotsu.study.results import FIT_TABLES
from shukotsu.study.sheets import HAND_SHEETS, SHEETS, Row, Sheet, read_sheet
from shukotsu.study.study import SIZES, Recording, Study
from shukotsu.tables.catalogue import FINDINGS
from shukotsu.tables.parts import Part, parts_in
from shukotsu.tables.poses import one_hand, recording_name
from shukotsu.tables.subjects import Hand, SubjectSession, path_token
from shukotsu.tables.text_files import read_text
from shukotsu.tables.typed_table import read_table, rows_of
from shukotsu.tables.whole_files import remedy_of

VERSION = 3


@dataclass(frozen=True)
class SubjectPlan:
    """One subject of a study.

    folder : the subject's results, results/<study>/sub-S. layouts : by hand. models : by name, in the study's
    order. corrections, measurements, touches, events : the subject's rows of these sheets. sheets : their
    paths, for messages. poses_files : every recording's poses table. truth_folders : of simulated recordings,
    where the truth is. is_study : whether the recordings' roles say what calibrates a model and which tasks
    are left out in turn; else every recording is used as a command line names it. refused : the sentence of
    each recording that a finding refuses; such a one is excluded. suspect : those that a finding suspects.
    session : where the recordings sheet names any. named : tables that a command line names, by name, hand
    and model, these two empty but for a fit's; None where all are read from the subject's folder. factors :
    the subject's levels, by the participants sheet.
    """

    study: str
    subject: str
    folder: Path
    hand_length_mm: float | None
    hand_breadth_mm: float | None
    recordings: tuple[Recording, ...]
    layouts: Mapping[str, Layout]
    models: Mapping[str, SkeletonModel]
    corrections: tuple[Row, ...]
    measurements: tuple[Row, ...]
    touches: tuple[Row, ...]
    events: tuple[Row, ...]
    sheets: Mapping[str, Path]
    poses_files: Mapping[Recording, Path]
    truth_folders: Mapping[Recording, Path]
    is_study: bool = True
    refused: Mapping[Recording, str] = field(default_factory=dict)
    suspect: tuple[Recording, ...] = ()
    session: str = ""
    factors: Mapping[str, str] = field(default_factory=dict)
    named: Mapping[tuple[str, str, str], Path] | None = None

    @property
    def who(self) -> SubjectSession:
        """The subject, and the session where the sheet names any."""
        return SubjectSession(self.subject, self.session)

    def hand(self, side: str) -> Hand:
        """The subject's right or left hand."""
        return Hand(self.subject, side, self.session)

    @property
    def hands(self) -> tuple[str, ...]:
        """The subject's hands, in the sheet's order."""
        return tuple(self.layouts)

    def poses(self, recording: Recording) -> Path:
        """Return a recording's poses table. Raises InputError where a command line names others alone."""
        if recording not in self.poses_files:
            raise InputError(
                f"--poses: lacks those of {recording.hand}, {recording.name}; name their file there"
            )
        return self.poses_files[recording]

    def table(self, name: str, hand: str = "", model: str = "") -> Path:
        """Return the file of a table; of a fit of the whole hand that of a hand under a model.

        Raises InputError where a command line names the tables to read, and not this one.
        """
        is_of_fit = name in FIT_TABLES
        if self.named is None:
            return (self.fits(hand, model) if is_of_fit else self.folder) / f"{name}.parquet"
        key = (name, hand, model) if is_of_fit else (name, "", "")
        if key not in self.named:
            whose = f"of the {hand} hand under model {model} " if is_of_fit else ""
            raise InputError(f"{option_of(name)}: no table {whose}is given; name its file there")
        return self.named[key]

    def fits(self, hand: str, model: str) -> Path:
        """Return the folder of the tables that a fit of the whole hand writes."""
        return self.folder / "fits" / hand / path_token(model)

    def fit_table(self, hand: str, model: str, name: str) -> Path:
        """Return a table of a hand under a model that fits the whole hand."""
        return self.table(name, hand, model)

    def files_of(self, name: str) -> list[Path]:
        """Files of a table: one; of a fit of the whole hand one for every hand and fitted model."""
        if name in FIT_TABLES:
            return [self.table(name, *fit) for fit in self.fits_of_hands()]
        return [self.table(name)]

    def fits_of_hands(self) -> list[tuple[str, str]]:
        """Return every hand with each model that fits it whole."""
        return [(hand, model) for hand in self.hands for model in self.fitted_models]

    def truth(self, recording: Recording) -> Path | None:
        """Folder of the truth beside a simulated recording; None for any other."""
        return self.truth_folders.get(recording)

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
        for name, paths in tables.items():
            for path in paths:
                fits = (
                    {(part.hand, part.model) for part in parts_in(path)} if name in FIT_TABLES else {("", "")}
                )
                for key in ((name, *fit) for fit in fits):
                    if named.setdefault(key, path) != path:
                        raise InputError(
                            f"{option_of(name)}: {path}: is of the same as {named[key]}; name one of them"
                        )
        files: dict[Recording, Path] = {}
        recordings = {(r.hand, r.task, r.trial): r for r in self.recordings}
        for path in poses:
            name_in_file = recording_name(path)
            recording = recordings.get((name_in_file.of_hand, name_in_file.task, name_in_file.trial))
            if recording is None or recording in files:
                raise TableError(
                    f"{path}: is of {name_in_file}, "
                    + ("which the plan lacks" if recording is None else f"as {files[recording]} is")
                    + f"; {remedy_of(path)}"
                )
            files[recording] = path
        excluded = {recording: path for recording, path in self.poses_files.items() if recording.exclude}
        return replace(self, named=named, poses_files={**excluded, **files} if poses else self.poses_files)

    def checked(self, findings: Path) -> SubjectPlan:
        """Return the plan with the refusals and suspicions of the subject's findings table."""
        rows = list(rows_of(read_table(findings, FINDINGS)))
        reasons, suspicions = (
            {
                (row["hand"], row["task"], row["trial"]): row["message"]
                for row in reversed(rows)
                if row["severity"] == severity
            }
            for severity in (REFUSED, SUSPECT)
        )
        by_recording = {
            recording: replace(recording, exclude=reasons[key])
            for recording in self.recordings
            if (key := (recording.hand.hand, recording.task, recording.trial)) in reasons
            and not recording.exclude
        }
        return replace(
            self,
            recordings=tuple(by_recording.get(r, r) for r in self.recordings),
            poses_files={by_recording.get(r, r): path for r, path in self.poses_files.items()},
            truth_folders={by_recording.get(r, r): path for r, path in self.truth_folders.items()},
            refused={recording: recording.exclude for recording in by_recording.values()},
            suspect=tuple(r for r in self.recordings if (r.hand.hand, r.task, r.trial) in suspicions),
        )

    def doubted(self, hand: str) -> str:
        """Title of the hand's first recording that a finding refuses or suspects; empty where none does."""
        doubts = [*self.refused, *self.suspect]
        return next((recording.title for recording in doubts if recording.hand.hand == hand), "")

    def check_calibration_left(self, hand: str) -> None:
        """Raise InputError, with the finding, where a hand has only refused recordings to calibrate on."""
        sentences = [text for recording, text in self.refused.items() if recording.hand.hand == hand]
        if sentences and not self.all_calibrating(hand):
            raise InputError(f"no calibration recording is left: {sentences[0]}")

    def part(self, hand: str, model: str = "", made_without: str = "") -> Part:
        """Return a part of the subject's tables."""
        return Part(hand, model, made_without, self.subject, self.session)

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


class StudyPlans:
    """Plans of a study's subjects. results : the study's results folder."""

    def __init__(self, study: Study, results: Path) -> None:
        self._study, self._results = study, results
        self._models = [read_config(path, "model") for path in study.models.values()]
        layouts = {study.layout_of(hand) for hand in study.hands}
        self._layouts = {path: read_config(path, "layout") for path in layouts}
        names = ("participants", *HAND_SHEETS)
        self._rows: dict[str, dict[str, list[dict[str, Any]]]] = {name: {} for name in names}
        for name in names:
            for row in read_sheet(study.sheets.get(name), SHEETS[name]):
                self._rows[name].setdefault(row["subject"], []).append(dict(row.values))

    def content(self, subject: str, session: str = "") -> dict[str, Any]:
        """Return a subject's plan as JSON types."""
        study = self._study.of_session(subject, session)
        asked = study.config["wanted_mm"]
        sizes = next(iter(self._rows["participants"].get(subject, [])), {})
        return {
            "plan": VERSION,
            "study": study.name,
            "subject": subject,
            "session": session,
            "folder": (self._results / f"sub-{SubjectSession(subject, session).token}").as_posix(),
            **{name: sizes.get(name) for name in SIZES},
            "factors": {name: sizes[name] for name in study.factors if name in sizes},
            "recordings": [_recording(recording, study, self._results) for recording in study.recordings],
            "layouts": {
                hand.hand: self._layouts[path := study.layout_of(hand)]
                | {"wanted_mm": asked or self._layouts[path]["wanted_mm"]}
                for hand in study.hands
            },
            "models": self._models,
            **{
                name: rows_of_session(self._rows[name].get(subject, []), SHEETS[name], session)
                for name in HAND_SHEETS
            },
            "sheets": {name: _relative(study.sheets[name]) for name in HAND_SHEETS if name in study.sheets},
        }


def recordings_part(plan: Mapping[str, Any]) -> dict[str, Any]:
    """Return a plan's entries on the recordings alone, without models, sizes, factors and measurements."""
    names = ("plan", "subject", "session", "folder", "events")
    recordings = [entry | {"factors": {}} for entry in plan["recordings"]]
    layouts = {hand: layout | {"wanted_mm": None} for hand, layout in plan["layouts"].items()}
    return {name: plan[name] for name in names} | {"recordings": recordings, "layouts": layouts}


def fit_part(plan: Mapping[str, Any], hand: str, model: str) -> dict[str, Any]:
    """Return what a fit uses of a plan: its model, and that hand alone unless lengths are shared.

    hand : empty where one job fits both.
    """
    part = recordings_part(plan)
    for entry in part["recordings"]:
        entry |= {"events": None, "pulses": ""}
    part |= {name: plan[name] for name in (*SIZES, "measurements", "touches")} | {"events": []}
    reference = read_config(config_path(REFERENCE, "model", Path()), "model")
    config = next(config for config in [*plan["models"], reference] if config["model"] == model)
    if hand and not config["fit"]["share_lengths"]:
        for name in ("recordings", "measurements", "touches"):
            part[name] = [row for row in part[name] if row["hand"] == hand]
        part["layouts"] = {hand: part["layouts"][hand]}
    return part | {"models": [config]}


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


def _recording(recording: Recording, study: Study, results: Path) -> dict[str, Any]:
    simulated = study.simulation is not None and recording.file.parent == study.simulation.folder
    ships = recording.layout.parent == CONFIG_FOLDER / "layouts"
    return {
        "hand": recording.hand.hand,
        "task": recording.task,
        "trial": recording.trial,
        "role": recording.role,
        "file": _relative(recording.file),
        "file_as_written": recording.file_as_written,
        "layout": recording.layout.stem if ships else _relative(recording.layout),
        "format": recording.format,
        "mapping": None if recording.mapping is None else _relative(recording.mapping),
        "hemisphere": recording.hemisphere,
        "exclude": recording.exclude,
        "accept": recording.accept,
        "events": None if recording.events is None else _relative(recording.events),
        "pulses": recording.pulses,
        "factors": {name: level for name, level in recording.factors if name in study.factors},
        "poses": (results / recording.hand.folder / recording.name / "poses.parquet").as_posix(),
        "truth": _relative(truth_folder(recording.file)) if simulated else None,
    }


def truth_folder(file: Path) -> Path:
    """Folder of the truth tables that the simulator writes beside a recording."""
    return file.with_name(f"{file.name.rsplit('.', 1)[0]}_truth")


def plan_of_poses(
    calibration: Sequence[Path],
    evaluated: Sequence[Path],
    layout: Layout,
    models: Sequence[SkeletonModel],
    *,
    subject: str | None = None,
    session: str | None = None,
    hand: str | None = None,
    sizes_mm: Mapping[str, float | None] | None = None,
    sheets: Mapping[str, Path | None] | None = None,
) -> SubjectPlan:
    """Make a plan of one hand's poses files as a command line names them, for a stage that is run alone.

    calibration, evaluated : poses files, one may be both. subject, session, hand : whose, where no file says.
    sizes_mm : hand_length_mm and hand_breadth_mm. sheets : paths of HAND_SHEETS, of
    which the rows of this hand count. Raises InputError where the files are of several hands, or two are of
    one recording, which would count twice.
    """
    whose = one_hand([*calibration, *evaluated], subject, session, hand)
    roles: dict[Path, list[str]] = {}
    for role, paths in (("calibration", calibration), ("evaluation", evaluated)):
        for path in dict.fromkeys(paths):
            same = next((other for other in roles if other.samefile(path)), path)
            roles.setdefault(same, []).append(role)
    files: dict[Recording, Path] = {}
    first_files: dict[tuple[str, str], Path] = {}
    for path, path_roles in roles.items():
        name = recording_name(path)
        first = first_files.setdefault((name.task, name.trial), path)
        if first != path:
            raise InputError(
                f"{path}: is of {name}, as {first} is; give a recording once, and import another repetition "
                "with a --trial of its own"
            )
        role = "both" if len(set(path_roles)) == 2 else path_roles[0]
        read_as = (path, str(path), Path(layout.name), "auto", None, "keep", "")
        files[Recording(whose, name.task, name.trial, role, *read_as)] = path
    named = {name: path for name, path in (sheets or {}).items() if path is not None}
    rows: dict[str, Any] = {
        name: tuple(
            rows_of_session(
                [
                    row
                    for row in read_sheet(named.get(name), SHEETS[name])
                    if (row["subject"], row["hand"]) == (whose.subject, whose.hand)
                ],
                SHEETS[name],
                whose.session,
            )
        )
        for name in HAND_SHEETS
    }
    sizes = sizes_mm or {}
    return SubjectPlan(
        "", whose.subject, Path(), sizes.get("hand_length_mm"), sizes.get("hand_breadth_mm"), tuple(files),
        {whose.hand: layout}, {model.name: model for model in models}, **rows, sheets=named,
        poses_files=files, truth_folders={}, is_study=False, session=whose.session,
    )  # fmt: skip


def plan_text(plan: Mapping[str, Any]) -> str:
    """Return a plan as the text of its file; the same plan, the same text."""
    return json.dumps(plan, ensure_ascii=False, indent=1) + "\n"  # in the order of layouts and models


def plan_digest(*contents: Any) -> str:
    """Return a digest of parts of a plan, by which the workflow notices changes."""
    return hashlib.sha256(json.dumps(contents, sort_keys=True).encode()).hexdigest()[:16]


def option_of(name: str) -> str:
    """Return the option that names a table on a command line."""
    return f"--{name.replace('_', '-')}"


def read_plan(path: Path) -> SubjectPlan:
    """Read a subject's plan. Raises InputError where the file is absent or is no plan of this version."""
    try:
        remedy = "run the study to write the subject's plan"
        content = json.loads(read_text(path, "a subject's plan", remedy=remedy))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a subject's plan ({error}); {remedy_of(path)}") from error
    if not isinstance(content, dict) or content.get("plan") != VERSION:
        raise InputError(f"{path}: not a subject's plan of version {VERSION}; {remedy_of(path)}")
    try:
        return plan_from_content(content, str(path))
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise InputError(f"{path}: a damaged plan; {remedy_of(path)}") from error


def plan_of_results(path: Path) -> SubjectPlan:
    """Read a subject's plan beside its results, with what its findings there refuse and suspect."""
    plan = read_plan(path)
    findings = plan.table(FINDINGS.name)
    return plan.checked(findings) if findings.is_file() else plan


def plan_from_content(content: Mapping[str, Any], where: str) -> SubjectPlan:
    """Make a plan of its file's content; `where` names it in errors."""
    _check_texts(content)
    models = [model_from_config(config, where) for config in content["models"]]
    who = SubjectSession(content["subject"], content["session"])
    recordings = {_read_recording(entry, who): entry for entry in content["recordings"]}
    return SubjectPlan(
        study=content["study"],
        subject=who.subject,
        session=who.session,
        folder=Path(content["folder"]),
        hand_length_mm=content["hand_length_mm"],
        hand_breadth_mm=content["hand_breadth_mm"],
        recordings=tuple(recordings),
        layouts={hand: layout_from_config(config, where) for hand, config in content["layouts"].items()},
        models={model.name: model for model in models},
        corrections=_rows(content["corrections"]),
        measurements=_rows(content["measurements"]),
        touches=_rows(content["touches"]),
        events=_rows(content["events"]),
        factors=content["factors"],
        sheets={name: Path(file) for name, file in content["sheets"].items()},
        poses_files={recording: Path(entry["poses"]) for recording, entry in recordings.items()},
        truth_folders={r: Path(entry["truth"]) for r, entry in recordings.items() if entry["truth"]},
    )


def _check_texts(content: Mapping[str, Any]) -> None:
    """Raise as Python does where names or paths are no texts, or sizes no numbers."""
    named = [content[name] for name in ("study", "subject", "session", "folder")]
    named += [config["model"] for config in content["models"]]
    named += [*content["layouts"], *(config["layout"] for config in content["layouts"].values())]
    for entry in content["recordings"]:
        paths = {name: entry[name] or "" for name in ("mapping", "truth", "events")}
        named += {**entry, **paths, "factors": ""}.values()
        named += entry["factors"].values()
    for text in named:
        if "\0" in text.encode().decode():  # half a character cannot be encoded
            raise ValueError(f"{text!r} is no name")
    for name in SIZES:
        float(content[name] or 0)


def _read_recording(entry: Mapping[str, Any], who: SubjectSession) -> Recording:
    values = {name: value for name, value in entry.items() if name not in ("poses", "truth")}
    mapping, events = values["mapping"], values["events"]
    return Recording(
        **values
        | {
            "hand": Hand(who.subject, values["hand"], who.session),
            "file": Path(values["file"]),
            "layout": Path(values["layout"]),
            "mapping": None if mapping is None else Path(mapping),
            "events": None if events is None else Path(events),
            "factors": tuple(values["factors"].items()),
        }
    )


def _rows(entries: list[dict[str, Any]]) -> tuple[Row, ...]:
    """Rows without their lines, which change where another subject's row is inserted above."""
    return tuple(Row(0, entry) for entry in entries)


def _relative(path: str | Path) -> str:
    return Path(os.path.relpath(path)).as_posix()
