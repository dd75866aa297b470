"""Read the study's tables of movement under one model."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from shukotsu.report.belief import study_beliefs
from shukotsu.report.study_results import StudyResults
from shukotsu.tables.catalogue import MOVEMENT_DIFFERENCES, MOVEMENT_RELIABILITY, RANGES_OF_MOTION
from shukotsu.tables.typed_table import Table, read_table

if TYPE_CHECKING:
    import pandas as pd

RANGE = "range_deg"
"""The quantity that is drawn; all others stand in tables."""
OF_ANGLE = ["joint", "angle"]
SUBJECT = ["subject", "session", "hand"]


@dataclass(frozen=True)
class StudyMovement:
    """A study's movement under one model, hands with a suspect finding left out.

    ranges : a row a recording and angle. differences, reliability : of that model. believed : one of BELIEFS
    by joint. measured : whether any recording has joint angles, counted or not. tasks : in the order in which
    they are shown, with whether each only calibrates. A frame without rows is that of a table that is empty
    or not there.
    """

    model: str
    ranges: pd.DataFrame
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
        means, whose = self.ranges, ["task", *OF_ANGLE, "subject", "hand", "session"]
        for _ in range(3):
            means = means.groupby(whose, sort=False)[RANGE].mean().reset_index()
            whose.pop()
        return means


def read_movement(results: StudyResults) -> StudyMovement:
    """Read the study's tables of movement under the leading model; InputError where one is another table.

    Ranges are of hands that count in statistics, in recordings that calibrate as well.
    """
    model = results.leading
    measured = movement_table(results, RANGES_OF_MOTION, model)
    roles: dict[str, set[str]] = defaultdict(set)
    for recording in results.shown:
        roles[recording.task].add(recording.role)
    tasks = {
        task: roles[task] == {"calibration"}
        for task in sorted(roles, key=lambda t: "calibration" not in roles[t])
    }
    suspect = {(hand.subject, hand.session, hand.hand) for hand in results.suspect}
    keys = zip(*(measured[name] for name in SUBJECT), strict=True)
    ranges = measured[np.array([key not in suspect for key in keys], bool)]
    return StudyMovement(
        model=model,
        ranges=ranges[ranges[RANGE].notna()],
        differences=movement_table(results, MOVEMENT_DIFFERENCES, model),
        reliability=movement_table(results, MOVEMENT_RELIABILITY, model),
        measured=bool(measured[RANGE].notna().any()),
        believed=study_beliefs(results.judging, model),
        tasks=tasks,
    )


def movement_table(results: StudyResults, table: Table, model: str) -> pd.DataFrame:
    """The table's rows of a model; none where the study has no such table."""
    names = [column.name for column in table.columns]
    path = results.paths.study_table(table.name)
    if not path.is_file():
        return pa.table({name: pa.array([], table.column(name).type) for name in names}).to_pandas()
    frame = read_table(path, table, names).replace_schema_metadata().to_pandas()
    return frame[frame["model"] == model].reset_index(drop=True)
