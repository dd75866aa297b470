"""What the report reads: the study and its study-wide tables, indexed by what the page asks for."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from schemas.catalogue import (
    BONE_LENGTHS,
    CALIBRATION_ADVICE,
    GAINS,
    JOINT_CENTRES,
    JOINT_ERRORS,
    PROBLEMS,
    RECEIVERS,
    RECORDINGS,
    SKELETON_SCORES,
    TIP_ERRORS,
)
from schemas.errors import InputError
from schemas.layout import Layout, read_layout
from schemas.model import SkeletonModel, read_model
from schemas.results import Results
from schemas.study import Hand, Recording, Study
from schemas.tables import Table, read_metadata, read_table, rows_of

Row = dict[str, Any]
HandModel = tuple[Hand, str]

FIRST_FRAME, LEAST_SQUARES = "first-frame", "least-squares"
HANDS = ("right", "left")


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
        return list(dict.fromkeys(recording.hand.subject for recording in self.study.recordings))

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

    def rows(table: Table) -> list[Row]:
        return _read_rows(paths.study_table(table.name), table, failures)

    recordings, problems = rows(RECORDINGS), rows(PROBLEMS)
    return StudyResults(
        study=study,
        paths=paths,
        models={name: read_model(path.absolute()) for name, path in study.models.items()},
        layouts={hand: read_layout(study.layout_of(hand).absolute()) for hand in study.hands},
        recordings=recordings,
        joints=rows(JOINT_CENTRES),
        bones=rows(BONE_LENGTHS),
        tip_errors=rows(TIP_ERRORS),
        scores=rows(SKELETON_SCORES),
        joint_errors=rows(JOINT_ERRORS),
        advice=rows(CALIBRATION_ADVICE),
        receivers=rows(RECEIVERS),
        gains=rows(GAINS),
        problems=problems + failures,  # read last: every table's failure is there by now
    )


def _read_rows(path: Path, table: Table, failures: list[Row]) -> list[Row]:
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected a {table.name} table")
    failure = read_metadata(path).get("failure")
    if failure is not None:
        failures.append({"where": path.name, "stage": "report", "message": failure})
        return []
    return list(rows_of(read_table(path, table)))


def _by_hand_and_model(rows: list[Row]) -> dict[HandModel, list[Row]]:
    groups: dict[HandModel, list[Row]] = defaultdict(list)
    for row in rows:
        groups[Hand(row["subject"], row["hand"]), row["model"]].append(row)
    return dict(groups)
