"""A study: its file, its sheets, and which recording serves which purpose."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from schemas.config_files import check_config, config_path, read_config
from schemas.errors import InputError, guess, listed
from schemas.layout import Layout, read_layout
from schemas.limits import FILE_NAME_BYTES, NAMES_BYTES
from schemas.model import SkeletonModel, read_model
from schemas.sheets import HAND_SHEETS, RECORDINGS, SHEETS, Row, read_sheet


@dataclass(frozen=True)
class Hand:
    """One subject's hand, and its place in paths."""

    subject: str
    hand: str

    @property
    def folder(self) -> str:
        """Its part of a path below the study's results."""
        return f"sub-{path_token(self.subject)}/{self.hand}"


@dataclass(frozen=True)
class Recording:
    """One row of the recordings sheet, paths resolved."""

    hand: Hand
    task: str
    trial: str
    role: str
    file: Path
    file_as_written: str
    layout: Path
    format: str
    mapping: Path | None
    hemisphere: str
    exclude: str
    accept: str = ""

    @property
    def name(self) -> str:
        """Task and trial as one part of a path."""
        return path_token(self.task) + (f"_{path_token(self.trial)}" if self.trial else "")


@dataclass(frozen=True)
class UnusableRow:
    """A row of the recordings sheet that is left out, and why: the study goes on with the others."""

    hand: Hand
    task: str
    message: str


@dataclass(frozen=True)
class Simulation:
    """Where simulated recordings go and the seed that makes them."""

    folder: Path
    seed: int


@dataclass(frozen=True)
class Study:
    """One study file with its sheets, layouts and models, read and checked."""

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

    @property
    def hands(self) -> tuple[Hand, ...]:
        """Every hand of the study, in the sheet's order."""
        return tuple(self._by_hand)

    @cached_property
    def _by_hand(self) -> dict[Hand, list[Recording]]:
        found: dict[Hand, list[Recording]] = {}
        for recording in self.recordings:
            found.setdefault(recording.hand, []).append(recording)
        return found

    @property
    def subjects(self) -> tuple[str, ...]:
        """Every subject of the study, in the sheet's order."""
        return tuple(dict.fromkeys(recording.hand.subject for recording in self.recordings))

    def of_subject(self, subject: str) -> Study:
        """The same study with that subject's recordings alone.

        Raises InputError where the study has no such subject.
        """
        recordings = tuple(r for r in self.recordings if r.hand.subject == subject)
        if not recordings:
            raise InputError(
                f"study {self.name}: has no subject {subject!r}; expected one of {listed(self.subjects)}"
            )
        return replace(self, recordings=recordings)

    @property
    def shown(self) -> tuple[Recording, ...]:
        """Every recording that tips are evaluated on, and so has a page in the report."""
        return tuple(r for r in self.recordings if r.role in ("evaluation", "both") and not r.exclude)

    def layout_of(self, hand: Hand) -> Path:
        """The layout of the hand's recordings; of several that which wears most receivers."""
        layouts = list(dict.fromkeys(recording.layout for recording in self._by_hand[hand]))
        if len(layouts) == 1:
            return layouts[0]
        return max(layouts, key=lambda path: len(read_layout(path.absolute()).expected))


def path_token(text: str) -> str:
    """Turn any name into one part of a path: letters (of any script), digits, '-' and '_' stay.

    Everything else becomes %XX (UTF-8 bytes), so that two names never share a path; the last letter of
    a name that ends in many repetitions, which Snakemake takes for a rule that feeds itself, becomes %%XX.
    """
    safe = [c if c.isalnum() or c in "-_" else _percent(c) for c in text]
    if _REPETITIVE.search("".join(safe)):
        safe[-1] = f"%{_percent(text[-1])}"
    return "".join(safe)


_REPETITIVE = re.compile(r"(.+?)\1{19}$")


def _percent(letter: str) -> str:
    return "".join(f"%{byte:02X}" for byte in letter.encode())


def read_study(path: Path) -> Study:
    """Read a study file and everything it names. Raises InputError where any of it is wrong."""
    return study_from_config(read_config(path, "study"), path.parent, str(path))


def study_from_config(config: dict[str, Any], folder: Path, where: str) -> Study:
    """Make a study of a loaded study file; its relative paths resolve against `folder`."""
    config = check_config(config, "study", where)
    layout = config_path(config["layout"], "layout", folder)
    models = _models(config["models"], folder, where)
    sheets: dict[str, Path] = {name: folder / config[name] for name in SHEETS if name in config}
    recordings, unusable = _recordings(sheets["recordings"], folder, layout)
    for path in {r.layout for r in recordings} | {layout}:
        read_layout(path.absolute())
    for name in ("participants", *HAND_SHEETS):
        read_sheet(sheets.get(name), SHEETS[name])
    simulation = None
    if "simulation" in config:
        part = config["simulation"]
        simulation = Simulation(folder / part["folder"], part["seed"])
    return Study(
        config["study"],
        recordings,
        models,
        layout,
        tuple(config["exports"]),
        _export_settings(config, models, where),
        simulation,
        sheets,
        config,
        unusable,
    )


def _export_settings(config: dict[str, Any], models: dict[str, Path], where: str) -> dict[str, Any]:
    """The settings with models named; InputError where one is not of the study."""
    settings = dict(config["export_settings"])
    for name in settings["models"]:
        if name not in models:
            raise InputError(
                f"{where}: export_settings.models: {name!r} is no model of the study; expected one of "
                f"{', '.join(models)}"
            )
    return settings | {"models": settings["models"] or list(models)}


def correction_problems(rows: Iterable[Row], path: Path, hands: Iterable[Hand], layout: Layout) -> list[str]:
    """Say, a sentence a row, which corrections cannot be applied: no such hand or no such joint."""
    known_hands = set(hands)
    joints = [joint.name for joint in layout.solvable]
    problems = []
    for row in rows:
        hand = Hand(row["subject"], row["hand"])
        if hand not in known_hands:
            reason = f"column subject: the study has no {hand.hand} hand of {hand.subject!r}"
        elif row["joint"] not in joints:
            meant = guess(row["joint"], joints)
            reason = f"column joint: {row['joint']!r} is no joint of layout {layout.name}; {meant}"
        else:
            continue
        problems.append(f"{path.name}: row {row.line}, {reason}; the row was not applied")
    return problems


def _models(names: list[str], folder: Path, where: str) -> dict[str, Path]:
    models: dict[str, Path] = {}
    for name in names:
        path = config_path(name, "model", folder)
        model: SkeletonModel = read_model(path.absolute())
        if model.name in models:
            raise InputError(f"{where}: models: {model.name} is given twice")
        models[model.name] = path
    return models


def _why_unusable(recording: Recording) -> str:
    """Say why no file can have the names that a row asks for; empty where they can."""
    length = len(f"{path_token(recording.hand.subject)}{recording.name}".encode())
    if length > NAMES_BYTES:
        return (
            f"columns subject, task, trial: make a file name of {length} bytes; expected at most "
            f"{NAMES_BYTES}"
        )
    for column, path in (("file", recording.file), ("mapping", recording.mapping)):
        longest = max((len(part.encode()) for part in path.parts), default=0) if path else 0
        if longest > FILE_NAME_BYTES:
            return f"column {column}: has a name of {longest} bytes; expected at most {FILE_NAME_BYTES}"
    return ""


def _recordings(
    sheet: Path, folder: Path, layout: Path
) -> tuple[tuple[Recording, ...], tuple[UnusableRow, ...]]:
    """Give the recordings of the sheet, and the rows that can be none."""
    recordings, unusable = [], []
    layouts: dict[Hand, tuple[Path, int]] = {}
    paths: dict[tuple[str, str], int] = {}
    for row in read_sheet(sheet, RECORDINGS):
        own = config_path(row["layout"], "layout", folder) if row["layout"] else layout
        recording = Recording(
            Hand(row["subject"], row["hand"]),
            row["task"],
            row["trial"],
            row["role"],
            folder / row["file"],
            row["file"],
            own,
            row["format"],
            folder / row["mapping"] if row["mapping"] else None,
            row["hemisphere"],
            row["exclude"],
            row["accept"],
        )
        reason = _why_unusable(recording)
        if reason:
            message = f"{sheet.name}: row {row.line}, {reason}; the row was left out"
            unusable.append(UnusableRow(recording.hand, row["task"], message))
            continue
        first, line = layouts.setdefault(recording.hand, (own, row.line))
        if first != own and not read_layout(own.absolute()).is_as(read_layout(first.absolute())):
            raise InputError(
                f"{sheet}: row {row.line}, column layout: {own.stem} has other bodies, joints or digits than "
                f"{first.stem}, the layout of row {line}; layouts of a hand may differ in the receivers worn"
            )
        line = paths.setdefault((recording.hand.folder.casefold(), recording.name.casefold()), row.line)
        if line != row.line:
            raise InputError(
                f"{sheet}: row {row.line}: its results would have the path of row {line}; "
                "rename subject, task or trial"
            )
        recordings.append(recording)
    if not recordings:
        reasons = "; ".join(row.message for row in unusable[:1])
        raise InputError(f"{sheet}: has no recording; add a row a recording{reasons and f' ({reasons})'}")
    return tuple(recordings), tuple(unusable)
