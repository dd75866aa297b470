"""Read the study's tables of movement, under one model, for the movement page and its figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from shukotsu.schemas.movement_tables import (
    MOVEMENT_CURVES,
    MOVEMENT_DIFFERENCES,
    MOVEMENT_RELIABILITY,
    RANGES_OF_MOTION,
)
from shukotsu.schemas.tables import Table, open_table
from shukotsu.sentences.messages import read_message
from shukotsu.stages.report.belief import BELIEVED, NOT
from shukotsu.stages.report.study_results import StudyResults, recording_key
from shukotsu.stages.report.trust import study_beliefs

if TYPE_CHECKING:
    import pandas as pd

RANGE = "range_deg"
"""The quantity that the page draws; all others stand in tables."""
PLACE = ["hand", "task"]
OF_ANGLE = ["joint", "angle"]
SUBJECT = ["subject", "session", "hand"]


@dataclass(frozen=True)
class Movement:
    """A study's movement under one model, hands with a suspect finding left out.

    ranges : a row a recording and angle. curves : the mean course over subjects, with its standard deviation
    between them. differences, reliability : of that model. believed : one of BELIEFS by joint. factors : as
    `StudyResults` has them. measured : whether any recording has joint angles, counted or not. A frame
    without rows is that of a table that is empty or not there.
    """

    model: str
    ranges: pd.DataFrame
    curves: pd.DataFrame
    differences: pd.DataFrame
    reliability: pd.DataFrame
    believed: dict[str, str]
    factors: Mapping[str, str]
    measured: bool

    @cached_property
    def subject_means(self) -> pd.DataFrame:
        """Range of motion, deg, by hand, task, joint, angle and subject: means over trials, then sessions."""
        sessions = self.session_means
        whose = [*PLACE, *OF_ANGLE, "subject"]
        return sessions.groupby(whose, sort=False, observed=True)[RANGE].mean().reset_index()

    @cached_property
    def session_means(self) -> pd.DataFrame:
        """The same session by session."""
        whose = [*PLACE, *OF_ANGLE, "subject", "session"]
        return self.ranges.groupby(whose, sort=False, observed=True)[RANGE].mean().reset_index()

    @cached_property
    def moved_most(self) -> pd.DataFrame:
        """Joint angles by mean range, largest first: mean, std and n over subjects, hands and tasks averaged.

        Joints that are not to be believed are left out.
        """
        means = self.subject_means
        means = means[
            means["joint"].map(lambda joint: self.believed.get(joint, BELIEVED) != NOT).astype(bool)
        ]
        own = means.groupby([*OF_ANGLE, "subject"], sort=False, observed=True)[RANGE].mean()
        found = own.groupby(OF_ANGLE, sort=False, observed=True).agg(["mean", "std", "count"])
        return found.sort_values("mean", ascending=False, kind="stable").reset_index()

    def believable(self, rows: pd.DataFrame) -> pd.DataFrame:
        """Rows of comparisons less those of joints that are not to be believed."""
        doubted = {joint for joint, shown in self.believed.items() if shown == NOT}
        return rows[np.array([of.partition(" ")[0] not in doubted for of in rows["of"]], bool)]

    @cached_property
    def leading_angles(self) -> list[tuple[str, str]]:
        """Joints and angles that moved most, one angle a joint."""
        first = self.moved_most.drop_duplicates("joint")
        return [(joint, angle) for joint, angle in zip(first["joint"], first["angle"], strict=True)]


def read_movement(results: StudyResults) -> Movement:
    """Read the study's tables of movement under the leading model; InputError where one is another table."""
    model = results.leading
    measured = _evaluated(_frame(results, RANGES_OF_MOTION, model), results)
    ranges = _judged(measured, results)
    return Movement(
        model=model,
        ranges=ranges[ranges[RANGE].notna()],
        curves=_mean_curves(results, model),
        differences=_frame(results, MOVEMENT_DIFFERENCES, model),
        reliability=_frame(results, MOVEMENT_RELIABILITY, model),
        factors=results.factors,
        measured=bool(measured[RANGE].notna().any()),
        believed=study_beliefs(results.judging, model),
    )


def _frame(
    results: StudyResults, table: Table, model: str = "", columns: Sequence[str] | None = None
) -> pd.DataFrame:
    """The table's rows, of one model where one is named; none where the study has no such table.

    A long table is filtered batch by batch: most of its rows are other models'.
    """
    import pandas as pd
    import pyarrow as pa
    import pyarrow.compute as pc

    names = list(columns or [column.name for column in table.columns])
    path = results.paths.study_table(table.name)
    if not path.is_file():
        return pa.table({name: pa.array([], table.column(name).type) for name in names}).to_pandas()
    with open_table(path, table) as file:
        empty = file.schema_arrow.empty_table().select(names)
        parts = [pa.Table.from_batches([batch]) for batch in file.iter_batches(columns=names)]
    if model:
        parts = [part.filter(pc.equal(part["model"], model)) for part in parts]
    frame = pa.concat_tables([empty, *parts]).replace_schema_metadata().to_pandas()
    if "message_values" in frame:
        pairs = zip(frame["message"], frame.pop("message_values"), strict=True)
        frame["message"] = pd.Series([read_message(*pair) for pair in pairs], frame.index, object)
    return frame


def _judged(rows: pd.DataFrame, results: StudyResults) -> pd.DataFrame:
    """Rows of hands that count in statistics."""
    suspect = {(hand.subject, hand.session, hand.hand) for hand in results.suspect}
    keys = zip(*(rows[name] for name in SUBJECT), strict=True)
    return rows[np.array([key not in suspect for key in keys], bool)] if suspect else rows


def _evaluated(rows: pd.DataFrame, results: StudyResults) -> pd.DataFrame:
    """Rows of recordings that are compared: not of those that only calibrate."""
    calibrating = {recording_key(own) for own in results.recordings if own.role == "calibration"}
    keys = zip(*(rows[name] for name in (*SUBJECT, "task", "trial")), strict=True)
    return rows[np.array([key not in calibrating for key in keys], bool)]


def _mean_curves(results: StudyResults, model: str) -> pd.DataFrame:
    """Mean and standard deviation over subjects of their mean curves, deg, and how many there are.

    A subject's is the mean over trials, then over sessions.
    """
    columns = [*SUBJECT, "task", "model", *OF_ANGLE, "event", "percent", "mean_deg"]
    rows = _judged(_frame(results, MOVEMENT_CURVES, model, columns), results)
    curve = [*PLACE, *OF_ANGLE, "event", "percent"]
    sessions = rows.groupby([*curve, "subject", "session"], sort=False, observed=True)["mean_deg"].mean()
    own = sessions.groupby([*curve, "subject"], sort=False, observed=True).mean()
    return own.groupby(curve, sort=False, observed=True).agg(["mean", "std", "count"]).reset_index()
