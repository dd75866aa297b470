"""Read the study's tables of movement under one model."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from shukotsu.movement.cycle_curves import MOST_EVENTS, PERCENT
from shukotsu.report.belief import study_beliefs
from shukotsu.report.study_results import StudyResults, recording_key, row_key
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import (
    CYCLE_CURVES,
    MOVEMENT_CYCLES,
    MOVEMENT_DIFFERENCES,
    MOVEMENT_RELIABILITY,
    RANGES_OF_MOTION,
)
from shukotsu.tables.typed_table import Table, read_table
from shukotsu.translation import listed, ngettext, tr, translated

if TYPE_CHECKING:
    import pandas as pd

RANGE = "range_deg"
"""The quantity that is drawn; all others stand in tables."""
OF_ANGLE = ["joint", "angle"]
SUBJECT = ["subject", "session", "hand"]
_MOST_REASONS = 3


@dataclass(frozen=True)
class Curve:
    """An angle over the cycle: mean and standard deviation, deg, and of how many cycles or subjects they are.

    Each (101,), by percent; mean and standard deviation NaN where there is none.
    """

    mean_deg: npt.NDArray[np.float64]
    sd_deg: npt.NDArray[np.float64]
    n: npt.NDArray[np.float64]


def recording_curves(
    results: StudyResults, recording: Recording, model: str
) -> dict[str, dict[str, dict[str, Curve]]]:
    """Return a recording's curves over its cycles under a model, by event, joint and angle."""
    key = recording_key(recording)
    rows = [row for row in results.hand_rows(CYCLE_CURVES, recording.hand, model) if row_key(row) == key]
    curves: dict[str, dict[str, dict[str, Curve]]] = {}
    for (event, joint, angle), group in groupby(rows, itemgetter("event", *OF_ANGLE)):
        of = list(group)
        numbers = (np.array([row[name] for row in of], float) for name in ("mean_deg", "sd_deg", "n_cycles"))
        curves.setdefault(event, {}).setdefault(joint, {})[angle] = Curve(*numbers)
    return curves


def why_no_curves(results: StudyResults, recording: Recording, model: str) -> str:
    """Return in a sentence why a recording has no curves over cycles under a model."""
    cycles = results.hand_rows(MOVEMENT_CYCLES, recording.hand)
    mine = [row for row in cycles if row_key(row) == recording_key(recording)]
    if not mine:
        return tr(
            "No event begins a cycle in this recording, so no angle is averaged over cycles; the study's "
            "sheet of events says when cycles begin"
        )
    if not any(row["used"] for row in mine):
        texts = [*dict.fromkeys(row["message"] for row in mine)][:_MOST_REASONS]
        reasons = listed(map(translated, texts))
        return ngettext(
            "The one cycle of this recording cannot be used ({reasons}), so no angle is averaged",
            "None of the {n} cycles of this recording can be used ({reasons}), so no angle is averaged",
            len(mine),
            reasons=reasons,
        )
    return tr("{model} has no joint angle in the cycles of this recording", model=model)


@dataclass(frozen=True)
class StudyMovement:
    """A study's movement under one model, hands with a suspect finding left out.

    ranges : a row a recording and angle. curves : rows of cycle_curves, of flexion in evaluated recordings.
    differences, reliability : of that model. believed : one of BELIEFS by joint. measured : whether any
    recording has joint angles, counted or not. tasks : in the order in which they are shown, with whether
    each only calibrates. A frame without rows is that of a table that is empty or not there.
    """

    model: str
    ranges: pd.DataFrame
    curves: pd.DataFrame
    differences: pd.DataFrame
    reliability: pd.DataFrame
    believed: dict[str, str]
    measured: bool
    tasks: Mapping[str, bool]

    @cached_property
    def subject_means(self) -> pd.DataFrame:
        """Range of motion, deg, by task, joint, angle and subject: means over trials, sessions, then hands.

        Nothing is averaged over tasks.
        """
        return _subject_means(self.ranges, ["task", *OF_ANGLE], RANGE)

    def level_curves(self, level_of: Mapping[str, str]) -> dict[tuple[str, str], dict[str, dict[str, Curve]]]:
        """Return curves over subjects, by task and event, joint and level: of each subject's own mean cycle.

        level_of : by subject; a subject without a level is in none. Of a task's events those that most
        subjects have.
        """
        means = _subject_means(self.curves, ["task", "event", "joint", "percent"], "mean_deg")
        means = means.assign(level=means["subject"].map(dict(level_of))).dropna(subset=["level", "mean_deg"])
        curves: dict[tuple[str, str], dict[str, dict[str, Curve]]] = {}
        for task in self.tasks:
            of_task = means[means["task"] == task]
            most = of_task.groupby("event", sort=False)["subject"].nunique()
            for event in most.sort_values(ascending=False, kind="stable").index[:MOST_EVENTS]:
                of_joints = curves.setdefault((task, str(event)), {})
                of_event = of_task[of_task["event"] == event]
                for (joint, level), rows in of_event.groupby(["joint", "level"], sort=False):
                    numbers = rows.groupby("percent")["mean_deg"].agg(["mean", "std", "count"])
                    columns = numbers.reindex(PERCENT).to_numpy(float).T
                    of_joints.setdefault(str(joint), {})[str(level)] = Curve(
                        columns[0], columns[1], np.nan_to_num(columns[2])
                    )
        return curves


def _subject_means(numbers: pd.DataFrame, of: Sequence[str], value: str) -> pd.DataFrame:
    """Means by subject and the columns `of`: over trials, sessions, then hands."""
    whose = [*of, "subject", "hand", "session"]
    for _ in range(3):
        numbers = numbers.groupby(whose, sort=False)[value].mean().reset_index()
        whose.pop()
    return numbers


def read_movement(results: StudyResults) -> StudyMovement:
    """Read the study's tables of movement under the leading model; InputError where one is another table.

    Ranges are of hands that count in statistics, in recordings that calibrate as well.
    """
    model = results.leading
    measured = movement_table(results, RANGES_OF_MOTION, model)
    curves = movement_table(results, CYCLE_CURVES, model, "flexion")
    roles: dict[str, set[str]] = defaultdict(set)
    for recording in results.shown:
        roles[recording.task].add(recording.role)
    tasks = {
        task: roles[task] == {"calibration"}
        for task in sorted(roles, key=lambda t: "calibration" not in roles[t])
    }
    suspect = {(hand.subject, hand.session, hand.hand) for hand in results.suspect}

    def counted(rows: pd.DataFrame) -> pd.DataFrame:
        keys = zip(*(rows[name] for name in SUBJECT), strict=True)
        return rows[np.array([key not in suspect for key in keys], bool)]

    ranges = counted(measured)
    return StudyMovement(
        model=model,
        ranges=ranges[ranges[RANGE].notna()],
        curves=counted(curves[~curves["task"].isin([task for task, only in tasks.items() if only])]),
        differences=movement_table(results, MOVEMENT_DIFFERENCES, model),
        reliability=movement_table(results, MOVEMENT_RELIABILITY, model),
        measured=bool(measured[RANGE].notna().any()),
        believed=study_beliefs(results.judging, model),
        tasks=tasks,
    )


def movement_table(results: StudyResults, table: Table, model: str, angle: str = "") -> pd.DataFrame:
    """The table's rows of a model, and an angle; none where the study has no such table."""
    names = [column.name for column in table.columns]
    path = results.paths.study_table(table.name)
    if not path.is_file():
        return pa.table({name: pa.array([], table.column(name).type) for name in names}).to_pandas()
    rows = read_table(path, table, names).replace_schema_metadata()
    for column, value in (("model", model), ("angle", angle)):
        rows = rows.filter(pc.equal(rows.column(column), value)) if value else rows
    return rows.to_pandas()
