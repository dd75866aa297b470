"""What the report reads: the study and its study-wide tables, indexed by what the page asks for."""

from __future__ import annotations

import gc
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from schemas.catalogue import RECORDINGS, TABLES, TIP_ERRORS
from schemas.errors import InputError
from schemas.layout import Layout, read_layout
from schemas.model import SkeletonModel, read_model
from schemas.results import Results
from schemas.study import Hand, Recording, Study
from schemas.tables import Table, read_metadata, read_table
from stages.gather.parts import recording_row, whole_table

Row = dict[str, Any]
HandModel = tuple[Hand, str]

FIRST_FRAME, LEAST_SQUARES = "first-frame", "least-squares"
HANDS = ("right", "left")

_READ = {
    "recordings": "recordings",
    "problems": "problems",
    "joint_centres": "joints",
    "bone_lengths": "bones",
    "tip_errors": "tip_errors",
    "skeleton_scores": "scores",
    "joint_errors": "joint_errors",
    "calibration_advice": "advice",
    "receivers": "receivers",
    "gains": "gains",
}
"""The tables that are read, and what StudyResults calls their rows."""


@dataclass(frozen=True)
class Trial:
    """One subject's evaluated task: the recordings of it by hand, right first as the paper prints them."""

    subject: str
    task: str
    trial: str
    recordings: dict[str, Recording]

    @property
    def title(self) -> str:
        """Task and trial in words."""
        return f"{self.task}, trial {self.trial}" if self.trial else self.task


@dataclass(frozen=True)
class StudyResults:
    """A study with its results; rows are dictionaries by column, null as None."""

    study: Study
    paths: Results
    models: dict[str, SkeletonModel]
    layouts: dict[Hand, Layout]
    recordings: list[Row]
    problems: list[Row]
    joints: list[Row]
    bones: list[Row]
    tip_errors: list[Row]
    scores: list[Row]
    joint_errors: list[Row]
    advice: list[Row]
    receivers: list[Row]
    gains: list[Row]

    @cached_property
    def joints_of(self) -> dict[HandModel, list[Row]]:
        """Joint rows by hand and model, in the table's order."""
        return _by_hand_and_model(self.joints)

    @cached_property
    def bones_of(self) -> dict[HandModel, list[Row]]:
        """Bone rows by hand and model, in the table's order."""
        return _by_hand_and_model(self.bones)

    @cached_property
    def receivers_of(self) -> dict[HandModel, list[Row]]:
        """Receiver rows by hand and model, in the table's order."""
        return _by_hand_and_model(self.receivers)

    @cached_property
    def gains_of(self) -> dict[HandModel, list[Row]]:
        """Rows of gains by hand and model, best first."""
        return _by_hand_and_model(self.gains)

    @property
    def fitted(self) -> list[str]:
        """The models that fit the whole hand, in the study's order."""
        return [name for name, model in self.models.items() if model.fitting is not None]

    @property
    def leading(self) -> str:
        """The model that pages show first: one that fits the whole hand, else the last that nobody corrected.

        A study of corrected models alone has its last.
        """
        uncorrected = [name for name, model in self.models.items() if not model.corrections]
        return [*self.models, *uncorrected, *self.fitted[:1]][-1]

    @cached_property
    def tip_error_of(self) -> dict[tuple[str, ...], Row]:
        """Tip error rows by subject, hand, task, trial, model, digit and binding."""
        return {tuple(row[name] for name in TIP_ERRORS.key): row for row in self.tip_errors}

    @cached_property
    def recording_row_of(self) -> dict[tuple[str, ...], Row]:
        """Rows of the recordings table by subject, hand, task and trial."""
        return {tuple(row[name] for name in RECORDINGS.key): row for row in self.recordings}

    @property
    def subjects(self) -> list[str]:
        """Every subject, in the sheet's order."""
        return list(self.study.subjects)

    def tip_error(self, recording: Recording, model: str, digit: str, binding: str) -> Row | None:
        """The row of tip_errors for one cell group; None where the table has none."""
        return self.tip_error_of.get((*recording_key(recording), model, digit, binding))

    def status_of(self, recording: Recording) -> tuple[str, str]:
        """The recording's status (used, excluded, failed or missing) and the reason, if any."""
        row = self.recording_row_of.get(recording_key(recording))
        if row is not None:
            return row["status"], row["message"] or recording.exclude
        if recording.exclude:
            return "excluded", recording.exclude
        return "missing", "the results do not name this recording"

    def trials(self, subject: str) -> Iterator[Trial]:
        """The subject's evaluated tasks, excluded and failed recordings among them, in the sheet's order."""
        groups: dict[tuple[str, str], dict[str, Recording]] = defaultdict(dict)
        for recording in self.study.recordings:
            if recording.hand.subject == subject and recording.role in ("evaluation", "both"):
                groups[recording.task, recording.trial][recording.hand.hand] = recording
        for (task, trial), by_hand in groups.items():
            ordered: dict[str, Recording] = {h: by_hand[h] for h in HANDS if h in by_hand}
            yield Trial(subject, task, trial, ordered)

    def scores_in(self, trial: Trial) -> list[Row]:
        """The rows of skeleton_scores of a subject's task, in the table's order, right hand first."""
        wanted = (trial.subject, trial.task, trial.trial)
        rows = [row for row in self.scores if (row["subject"], row["task"], row["trial"]) == wanted]
        return sorted(rows, key=lambda row: bool(row["hand"] != "right"))

    def hands(self, subject: str) -> list[Hand]:
        """The subject's hands, right first."""
        mine = [hand for hand in self.study.hands if hand.subject == subject]
        return sorted(mine, key=lambda hand: hand.hand != "right")


@contextmanager
def few_collections() -> Iterator[None]:
    """Let Python seldom look for cycles meanwhile: the rows of a large study are many objects without any."""
    before = gc.get_threshold()
    gc.set_threshold(200_000, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


def recording_key(recording: Recording) -> tuple[str, str, str, str]:
    """Subject, hand, task and trial: what the tables call the recording."""
    return recording.hand.subject, recording.hand.hand, recording.task, recording.trial


def read_results(study: Study, folder: Path) -> StudyResults:
    """Read the study-wide tables from `folder`.

    Raises InputError where a table is absent or is another one. A table that records that its own making
    failed counts as empty, and the reason joins the problems.
    """
    paths = Results(folder)
    failures: list[Row] = []
    rows = {name: _read_rows(paths.study_table(name), TABLES[name], failures) for name in _READ}
    rows["problems"] += [*failures, *_failed_exports(study, paths)]
    return _results(study, paths, _models(study), rows)


def read_subject(study: Study, folder: Path, subject: str) -> StudyResults:
    """Read the tables of one subject's hands: the same results for a study of that subject alone.

    A table that is absent, another one or the record of a failure counts as empty, and the reason joins the
    problems. Raises InputError where the study has no such subject.
    """
    own, paths = study.of_subject(subject), Results(folder)
    models = _models(own)
    fitted = [name for name, model in models.items() if model.fitting is not None]
    problems: list[Row] = []
    rows = {"recordings": [recording_row(recording, paths, problems) for recording in own.recordings]}
    for name in _READ:
        if name not in ("recordings", "problems"):
            whole, lacking = whole_table(TABLES[name], paths.parts(name, own.hands, models, fitted))
            problems += lacking
            rows[name] = _plain_rows(whole)
    return _results(own, paths, models, rows | {"problems": problems})


def _failed_exports(study: Study, paths: Results) -> list[Row]:
    """What the export stage could not write, and why."""
    files = [
        file
        for model in study.export_settings["models"]
        for recording in study.shown
        for file in sorted(paths.exports(model, recording).glob("*.failed.txt"))
    ]
    files += [paths.dataset_failures] if "bids" in study.exports and paths.dataset_failures.exists() else []
    return [
        {"where": file.name.removesuffix(".failed.txt"), "stage": "export", "message": message}
        for file in files
        if study.exports
        for message in file.read_text("utf-8").splitlines()
    ]


def _results(
    study: Study, paths: Results, models: dict[str, SkeletonModel], rows: dict[str, list[Row]]
) -> StudyResults:
    file_of = {recording.hand: recording.layout for recording in reversed(study.recordings)}
    return StudyResults(
        study=study,
        paths=paths,
        models=models,
        layouts={hand: read_layout(file_of[hand].absolute()) for hand in study.hands},
        **{attribute: rows[name] for name, attribute in _READ.items()},
    )


def _models(study: Study) -> dict[str, SkeletonModel]:
    return {name: read_model(path.absolute()) for name, path in study.models.items()}


def _read_rows(path: Path, table: Table, failures: list[Row]) -> list[Row]:
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected a {table.name} table")
    failure = read_metadata(path).get("failure")
    if failure is not None:
        failures.append({"where": path.name, "stage": "report", "message": failure})
        return []
    columns = [column.name for column in table.columns if _shown(column.type)]
    return _plain_rows(read_table(path, table, columns))


def _shown(kind: pa.DataType) -> bool:
    """Whether pages may show a column of that type: not of lists, which are most of what there is to read."""
    return not pa.types.is_fixed_size_list(kind)


def _plain_rows(table: pa.Table) -> list[Row]:
    """The rows of a table without its columns of lists, column by column: `rows_of` is for fewer rows."""
    shown = [name for name, kind in zip(table.column_names, table.schema.types, strict=True) if _shown(kind)]
    return [
        dict(zip(shown, values, strict=True))
        for values in zip(*(_values(table.column(name)) for name in shown), strict=True)
    ]


def _values(column: pa.ChunkedArray) -> list[Any]:
    """A column's values, null as None; every text is one object however often it is there."""
    if pa.types.is_string(column.type):
        coded = column.combine_chunks().dictionary_encode()
        words = [*coded.dictionary.to_pylist(), None]
        return [words[index] for index in coded.indices.fill_null(-1).to_pylist()]
    filler = pa.scalar(0).cast(column.type)
    values: list[Any] = column.fill_null(filler).to_numpy().tolist()
    if column.null_count:
        for index in np.flatnonzero(column.is_null().to_numpy()).tolist():
            values[index] = None
    return values


def _by_hand_and_model(rows: list[Row]) -> dict[HandModel, list[Row]]:
    groups: dict[HandModel, list[Row]] = defaultdict(list)
    for row in rows:
        groups[Hand(row["subject"], row["hand"]), row["model"]].append(row)
    return dict(groups)
