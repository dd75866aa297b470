"""A study: its file, its sheets, and the role of each recording."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError, count_of, guess, list_names
from shukotsu.study.config_files import REFERENCE, config_path, read_config
from shukotsu.study.file_formats import AUTO, format_of
from shukotsu.study.layout import Layout, read_layout
from shukotsu.study.model import SkeletonModel, read_model
from shukotsu.study.sheets import HAND_SHEETS, PARTICIPANTS, RECORDINGS, SHEETS, Row, read_sheet
from shukotsu.tables.limits import FILE_NAME_BYTES, NAMES_BYTES
from shukotsu.tables.subjects import Hand, SubjectSession, path_token
from shukotsu.translation import ngettext, tr

OWN_FACTORS = ("session", "hand", "task")
"""Columns that every recording has and that can be factors."""

MOST_LEVELS, MOST_NUMBERS = 8, 4
"""A factor with more levels than MOST_LEVELS is not compared pair by pair. If all its levels are numbers,
which are probably measurements, the limit is MOST_NUMBERS.
"""

SIZES = ("hand_length_mm", "hand_breadth_mm")
"""Columns of the participants sheet with sizes of the hand."""

NO_LEVEL = ("", "n/a")
"""Cells that mean that the level is unknown."""


@dataclass(frozen=True)
class Source:
    """File of a recording, as a resolved path and as written in the sheet, and how to read it."""

    file: Path
    file_as_written: str
    layout: Path
    format: str = "auto"
    mapping: Path | None = None
    hemisphere: str = "keep"


@dataclass(frozen=True)
class Recording:
    """Row of the recordings sheet, with resolved paths.

    truth : folder of the truth tables of a simulated recording. factors : levels of the study's factors that
    are columns of this sheet. more : the sheet's further columns, which plans do not contain.
    """

    hand: Hand
    task: str
    trial: str
    role: str
    source: Source
    exclude: str = ""
    accept: str = ""
    events: Path | None = None
    pulses: str = ""
    truth: Path | None = None
    factors: tuple[tuple[str, str], ...] = ()
    more: tuple[tuple[str, str], ...] = ()

    @property
    def name(self) -> str:
        """Task and trial, joined as a file or folder name."""
        return path_token(self.task) + (f"_{path_token(self.trial)}" if self.trial else "")

    @property
    def key(self) -> dict[str, str]:
        """Key of the recording in tables: subject, session, hand, task and trial, in this order."""
        whose = {"subject": self.hand.subject, "session": self.hand.session, "hand": self.hand.hand}
        return {**whose, "task": self.task, "trial": self.trial}

    @property
    def key_in_session(self) -> tuple[str, str, str]:
        """Hand, task and trial, which identify the recording within a subject's session."""
        return self.hand.hand, self.task, self.trial

    @property
    def title(self) -> str:
        """Task, followed by the trial if there is one."""
        return ", ".join(filter(None, (self.task, self.trial)))


@dataclass(frozen=True)
class UnusableRow:
    """A row of the recordings sheet that is left out of the study, with the reason in `message`."""

    hand: Hand
    task: str
    message: str


@dataclass(frozen=True)
class Simulation:
    """Folder and seed of simulated recordings."""

    folder: Path
    seed: int


class HasRecordings:
    """Base class that lists the hands, subjects and sessions of recordings, in the sheet's order."""

    recordings: tuple[Recording, ...]

    @cached_property
    def hands(self) -> tuple[Hand, ...]:
        """Every hand."""
        return tuple(dict.fromkeys(recording.hand for recording in self.recordings))

    @cached_property
    def subjects(self) -> tuple[str, ...]:
        """Every subject."""
        return tuple(dict.fromkeys(hand.subject for hand in self.hands))

    @cached_property
    def sessions(self) -> tuple[SubjectSession, ...]:
        """Every session of every subject."""
        return tuple(dict.fromkeys(hand.who for hand in self.hands))


@dataclass(frozen=True)
class Study(HasRecordings):
    """A study file with its sheets, layouts and models, read and validated."""

    name: str
    recordings: tuple[Recording, ...]
    models: dict[str, Path]
    layout: Path
    exports: tuple[str, ...]
    export_settings: dict[str, Any]
    simulation: Simulation | None
    sheets: dict[str, Path]
    config: dict[str, Any]
    unusable: tuple[UnusableRow, ...] = ()

    @cached_property
    def _layouts_of(self) -> dict[Hand, dict[Path, None]]:
        layouts: dict[Hand, dict[Path, None]] = defaultdict(dict)
        for recording in self.recordings:
            layouts[recording.hand][recording.source.layout] = None
        return layouts

    def of_session(self, subject: str, session: str = "") -> Study:
        """Return the study with only the recordings of that subject and session.

        Raises InputError if the study has no such recording.
        """
        recordings = tuple(r for r in self.recordings if r.hand.who == (subject, session))
        if not recordings:
            label = SubjectSession(subject, session).label
            names = list_names([who.label for who in self.sessions])
            raise InputError(f"study {self.name}: has no subject {label!r}; expected one of {names}")
        return replace(self, recordings=recordings)

    @property
    def language(self) -> str:
        """Language of the report, one of the codes that the schema allows."""
        return str(self.config["language"])

    @property
    def factors(self) -> tuple[str, ...]:
        """Names of the study's factors; `factor_levels` returns their levels."""
        return tuple(self.config["factors"])

    @property
    def shown(self) -> tuple[Recording, ...]:
        """Recordings in which tips are evaluated; each has a page in the report."""
        return tuple(r for r in self.recordings if r.role in ("evaluation", "both") and not r.exclude)

    def layout_of(self, hand: Hand) -> Path:
        """Return the layout of the hand's recordings; if they have several, the one with most receivers."""
        return max(self._layouts_of[hand], key=lambda path: len(read_layout(path.absolute()).expected))

    def judged_layout(self, hand: Hand) -> Layout:
        """Return the layout of the hand's recordings, with the study's `wanted_mm` if it sets one."""
        layout = read_layout(self.layout_of(hand).absolute())
        return replace(layout, wanted_mm=self.config["wanted_mm"] or layout.wanted_mm)


def factor_levels(study: Study) -> list[dict[str, str]]:
    """Return a row for every evaluated recording: subject, session, hand, task, trial, and the level of each
    factor.

    The study file names factors under `factors`: session, hand, task, or a further column of the participants
    or the recordings sheet. A level is text, empty if it is unknown for the recording or the participant.
    Raises InputError if the participants sheet cannot be read.
    """
    sheet = read_sheet(study.sheets.get("participants"), PARTICIPANTS)
    people = {row["subject"]: row.values for row in sheet}
    further = [name for name in study.factors if name not in OWN_FACTORS]
    rows = []
    for recording in study.shown:
        values = {**people.get(recording.hand.subject, {}), **dict(recording.factors)}
        texts = {name: "" if values.get(name) is None else str(values[name]) for name in further}
        rows.append(recording.key | {name: "" if t in NO_LEVEL else t for name, t in texts.items()})
    return rows


def not_compared(study: Study) -> dict[str, str]:
    """Return the factors whose levels are not compared pair by pair, each with the reason."""

    def is_number(text: str) -> bool:
        with suppress(ValueError):
            return math.isfinite(float(text))
        return False

    rows = factor_levels(study)
    reasons = {}
    for factor in study.factors:
        levels = {row[factor] for row in rows} - {""}
        if len(levels) < 2:
            reasons[factor] = ngettext(
                "has {n} level, so nothing is compared", "has {n} levels, so nothing is compared", len(levels)
            )
        elif factor not in OWN_FACTORS and all(map(is_number, levels)) and len(levels) > MOST_NUMBERS:
            text = "has {n} numbers as levels, which are not compared pair by pair"
            reasons[factor] = tr(text, n=len(levels))
        elif len(levels) > MOST_LEVELS:
            reasons[factor] = tr(
                "has {n} levels, but at most {most} are compared pair by pair; combine levels into groups in "
                "the sheet's column",
                n=len(levels),
                most=MOST_LEVELS,
            )
    return reasons


def read_study(path: Path) -> Study:
    """Read a study file and all files it names. Raises InputError if any is missing or invalid."""
    config, folder, where = read_config(path, "study"), path.parent, str(path)
    layout = config_path(config["layout"], "layout", folder, f"{where}: ")
    models = _models(config["models"], folder, where)
    settings = config["export_settings"]
    for name in settings["models"]:
        if name not in models:
            raise InputError(
                f"{where}: export_settings.models: {name!r} is not a model of the study; expected one of "
                f"{', '.join(models)}"
            )
    sheets: dict[str, Path] = {name: folder / config[name] for name in SHEETS if name in config}
    simulated = config.get("simulation")
    simulation = None if simulated is None else Simulation(folder / simulated["folder"], simulated["seed"])
    usual = Source(folder, "", layout, mapping=folder / config["mapping"] if "mapping" in config else None)
    recordings, unusable = _recordings(sheets["recordings"], usual, config["factors"], simulation)
    for used in {r.source.layout for r in recordings} | {layout}:
        read_layout(used.absolute())
    rows = {name: read_sheet(sheets.get(name), SHEETS[name]) for name in ("participants", *HAND_SHEETS)}
    _check_factors(config["factors"], recordings, rows["participants"], where)
    if "events" in sheets:
        _check_events(sheets["events"], rows["events"], recordings, unusable)
    name, exports = config["study"], tuple(config["exports"])
    settings = settings | {"models": settings["models"] or list(models)}
    return Study(name, recordings, models, layout, exports, settings, simulation, sheets, config, unusable)


def _no_hand(row: Row, hands: Iterable[Hand]) -> str:
    """Return a message if the study has no hand that matches a row, else an empty string.

    A row without a session matches all sessions.
    """
    hand = Hand(row["subject"], row["hand"], row["session"])
    sides = set(hands)
    if hand in sides | {replace(side, session="") for side in sides}:
        return ""
    return f"column subject: the study has no {hand.hand} hand of {hand.who.label!r}"


def correction_problems(rows: Iterable[Row], path: Path, hands: Iterable[Hand], layout: Layout) -> list[str]:
    """Return a sentence for each row of corrections whose hand or joint does not exist."""
    sides, joints = set(hands), [joint.name for joint in layout.solvable]
    problems = []
    for row in rows:
        reason = _no_hand(row, sides)
        if not reason and row["joint"] not in joints:
            meant = guess(row["joint"], joints)
            reason = f"column joint: {row['joint']!r} is not a joint of layout {layout.name}; {meant}"
        if reason:
            problems.append(f"{path.name}: row {row.line}, {reason}; the row was not applied")
    return problems


def unmatched_rows(study: Study) -> list[str]:
    """Return sentences about rows that match nothing in the study.

    They report rows of measurements and touches whose hand the study lacks, and subjects whose names
    apparently differ between the participants and the recordings sheet.
    """
    problems = [
        f"{study.sheets[name].name}: row {row.line}, {reason}; the row was not applied"
        for name in ("measurements", "touches")
        for row in read_sheet(study.sheets.get(name), SHEETS[name])
        if (reason := _no_hand(row, study.hands))
    ]
    people = {row["subject"]: row.line for row in read_sheet(study.sheets.get("participants"), PARTICIPANTS)}
    recorded = {*study.subjects, *(row.hand.subject for row in study.unusable)}
    nobody = [name for name in people if name not in recorded]
    missing = [name for name in study.subjects if name not in people]
    if nobody and missing:
        names = list_names([repr(name) for name in missing], 3)
        problems.append(
            f"{study.sheets['participants'].name}: has no row of {names}, and row {people[nobody[0]]} is of "
            f"{nobody[0]!r}, who has no recording; write names alike in both sheets, or sizes and factors "
            "of these subjects stay unknown"
        )
    return problems


def unused_columns(study: Study) -> list[str]:
    """Return a sentence that lists the recordings sheet's unused further columns, or no sentence."""
    names = [name for name, _ in study.recordings[0].more if name not in study.factors]
    where = study.sheets["recordings"].name
    use = "not used, but copied unchanged to recordings.parquet"
    return [f"{where}: further columns, {use}: {list_names(names)}"] if names else []


def _check_factors(
    names: Iterable[str], recordings: Sequence[Recording], participants: Sequence[Row], where: str
) -> None:
    """Raise InputError unless each factor is in OWN_FACTORS or a further column of exactly one sheet."""
    cells = {cell.name for sheet in (PARTICIPANTS, RECORDINGS) for cell in sheet.cells}
    further = dict.fromkeys(name for row in participants for name in row.values)
    columns = [*OWN_FACTORS, *(name for name in further if name not in cells)]
    of_recordings = {name for recording in recordings for name, _ in recording.factors}
    for name in names:
        if name in OWN_FACTORS:
            continue
        if name in cells:
            reason = f"cannot be a factor; expected one of {', '.join(columns)}"
        elif name in of_recordings and name in columns:
            reason = "is a column of both sheets, participants and recordings; keep one of them"
        elif name not in of_recordings and name not in columns:
            reason = f"is not a column of the sheets of participants and recordings; {guess(name, columns)}"
        else:
            continue
        raise InputError(f"{where}: factors: {name!r} {reason}")


def _check_events(
    path: Path, rows: Sequence[Row], recordings: Sequence[Recording], unusable: Sequence[UnusableRow]
) -> None:
    """Raise InputError if a row does not match exactly one recording; session and trial are optional."""
    of_key: dict[tuple[str, ...], list[Recording]] = {}
    for recording in recordings:
        of_key.setdefault((recording.hand.subject, recording.hand.hand, recording.task), []).append(recording)
    left_out = {(row.hand.subject, row.hand.hand, row.task) for row in unusable}
    for row in rows:
        key = tuple(row[name] for name in ("subject", "hand", "task"))
        named = [
            recording
            for recording in of_key.get(key, [])
            if all(row[name] in ("", recording.key[name]) for name in ("session", "trial"))
        ]
        if len(named) == 1 or (not named and key in left_out):
            continue
        what = "several recordings; state which in the columns session and trial" if named else "no recording"
        words = ", ".join(row[name] for name in ("subject", "session", "hand", "task", "trial") if row[name])
        raise InputError(f"{path}: row {row.line}: {words} names {what} of the recordings sheet")


def _models(names: list[str], folder: Path, where: str) -> dict[str, Path]:
    models: dict[str, Path] = {}
    for name in names:
        path = config_path(name, "model", folder, f"{where}: ")
        model: SkeletonModel = read_model(path.absolute())
        if model.name in models:
            raise InputError(f"{where}: models: {model.name} is given twice")
        if model.is_reference or model.name == REFERENCE:
            raise InputError(
                f"{where}: models: {name}: is a reference, which every study has as {REFERENCE}; "
                "leave it out, or write fit: {steps: 1} or more under another name"
            )
        models[model.name] = path
    return models


def _why_unusable(recording: Recording) -> str:
    """Return the reason why a row's names are too long for file names, or an empty string."""
    names = (*recording.hand.who, recording.task, recording.trial)
    n_bytes = sum(len(path_token(name).encode()) for name in names)
    if n_bytes > NAMES_BYTES:
        return (
            f"columns subject, session, task, trial: have {count_of(n_bytes, 'byte')} in file names; "
            f"expected at most {NAMES_BYTES}"
        )
    source = recording.source
    for column, path in (("file", source.file), ("mapping", source.mapping), ("events", recording.events)):
        if path and max((len(part.encode()) for part in path.parts), default=0) > FILE_NAME_BYTES:
            limit = f"{FILE_NAME_BYTES} bytes, which is too long for a file name"
            return f"column {column}: has a part of more than {limit}"
    return ""


def truth_folder(file: Path) -> Path:
    """Return the folder of the truth tables that the simulator writes beside a recording."""
    return file.with_name(f"{file.name.rsplit('.', 1)[0]}_truth")


def _recordings(
    sheet: Path, usual: Source, factors: Sequence[str], simulation: Simulation | None
) -> tuple[tuple[Recording, ...], tuple[UnusableRow, ...]]:
    """Return the recordings of the sheet, and the rows that cannot be used.

    usual : its `file` is the study's folder; its layout and mapping apply to rows that name no others.
    """
    recordings, unusable, cells = [], [], {cell.name for cell in RECORDINGS.cells}
    folder = usual.file
    layouts: dict[Hand, tuple[Path, int]] = {}
    paths: dict[tuple[str, str], int] = {}
    units: dict[str, tuple[SubjectSession, int]] = {}
    for row in read_sheet(sheet, RECORDINGS, factors):
        place = f"{sheet}: row {row.line}, column layout: "
        worn = config_path(row["layout"], "layout", folder, place) if row["layout"] else usual.layout
        form = format_of(Path(row["file"]))
        needs_none = row["format"] != AUTO or (form is not None and not form.takes_study_mapping)
        usual_mapping = None if needs_none else usual.mapping
        mapping = folder / row["mapping"] if row["mapping"] else usual_mapping
        file = folder / row["file"]
        recording = Recording(
            Hand(row["subject"], row["hand"], row["session"]),
            row["task"],
            row["trial"],
            row["role"],
            Source(file, row["file"], worn, row["format"], mapping, row["hemisphere"]),
            row["exclude"],
            row["accept"],
            folder / row["events"] if row["events"] else None,
            row["pulses"],
            truth_folder(file) if simulation is not None and file.parent == simulation.folder else None,
            tuple((name, row[name]) for name in factors if name in row.values and name not in OWN_FACTORS),
            tuple((name, text) for name, text in row.values.items() if name and name not in cells),
        )
        reason = _why_unusable(recording)
        if reason:
            message = f"{sheet.name}: row {row.line}, {reason}; the row was left out"
            unusable.append(UnusableRow(recording.hand, row["task"], message))
            continue
        first, line = layouts.setdefault(recording.hand, (worn, row.line))
        if first != worn and not read_layout(worn.absolute()).matches(read_layout(first.absolute())):
            raise InputError(
                f"{sheet}: row {row.line}, column layout: {worn.stem} has other bodies, joints or digits "
                f"than {first.stem}, the layout of row {line}; layouts of a hand may differ in the "
                "receivers worn"
            )
        line = paths.setdefault((recording.hand.folder.casefold(), recording.name.casefold()), row.line)
        if line != row.line:
            raise InputError(
                f"{sheet}: row {row.line}: its results would have the path of row {line}; "
                "rename subject, session, task or trial"
            )
        whose, line = units.setdefault(recording.hand.who.token, (recording.hand.who, row.line))
        if whose != recording.hand.who:
            raise InputError(
                f"{sheet}: row {row.line}: results of {recording.hand.who} would have the path of {whose} "
                f"(row {line}); rename one"
            )
        recordings.append(recording)
    if not recordings:
        reasons = "; ".join(row.message for row in unusable[:1])
        raise InputError(f"{sheet}: has no recording; add a row for each{reasons and f' ({reasons})'}")
    return tuple(recordings), tuple(unusable)
