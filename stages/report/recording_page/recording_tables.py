"""The recording's tables: tip errors, ranges of motion, and what the data say of each joint."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from stages.report.pictures.joint_rows import Range
from stages.report.recording_results import ANGLES, JointAngles, ModelResults
from stages.report.skeleton_tables import STATUS
from stages.report.study_results import Row
from stages.report.table_cells import Column, DataTable, number, number_column, table_of, text_column
from stages.report.viewer.packed_motion import Block

ANGLE_STEP_DEG = 0.1
"""As the page prints angles: rounded to it once, they show the table's own digits."""
PERCENTILES = (0, 5, 50, 95, 100)


@dataclass(frozen=True)
class AngleRange:
    """How far one angle of a joint went, degrees at PERCENTILES, and in how many frames it is known."""

    joint: str
    angle: str
    at_deg: Range
    n_frames: int


def angle_ranges(angles: JointAngles) -> list[AngleRange]:
    """The range of every angle of every joint; one that is never known has none."""
    ranges = []
    for j, joint in enumerate(angles.joints):
        for a, angle in enumerate(ANGLES):
            values = angles.angle_deg[:, j, a]
            known = values[np.isfinite(values)]
            if len(known):
                least, first, median, last, most = np.percentile(known, PERCENTILES).tolist()
                ranges.append(AngleRange(joint, angle, (least, first, median, last, most), len(known)))
    return ranges


def angle_blocks(angles: Sequence[JointAngles], every: int) -> list[Block]:
    """One frame in `every`, packed with the motion as blocks angles0, angles1, ..., (T, J, 3)."""
    return [Block(f"angles{i}", ANGLE_STEP_DEG, own.angle_deg[::every]) for i, own in enumerate(angles)]


def tip_error_table(caption: str, models: Iterable[ModelResults]) -> DataTable:
    """The recording's rows of tip_errors, mm: the replay under every model, both bindings."""
    return table_of(caption, _TIP_ERROR_COLUMNS, [row for model in models for row in model.tip_errors])


def range_table(caption: str, ranges: Iterable[AngleRange], joints: Iterable[Row]) -> DataTable:
    """Percentiles of every angle, degrees; beside them the range about the joint's axis in calibration."""
    calibrated = {row["joint"]: row["range_deg"] for row in joints}
    columns = (
        Column("Joint", lambda own: own.joint, is_text=True),
        Column("Angle", lambda own: own.angle, is_text=True),
        Column("Min [deg]", lambda own: number(own.at_deg[0], 1)),
        Column("5 % [deg]", lambda own: number(own.at_deg[1], 1)),
        Column("Median [deg]", lambda own: number(own.at_deg[2], 1)),
        Column("95 % [deg]", lambda own: number(own.at_deg[3], 1)),
        Column("Max [deg]", lambda own: number(own.at_deg[4], 1)),
        Column("5 to 95 % [deg]", lambda own: number(own.at_deg[3] - own.at_deg[1], 1)),
        Column("Frames", lambda own: str(own.n_frames)),
        Column("Calibration, about the joint’s axis [deg]", lambda own: number(calibrated.get(own.joint), 1)),
    )
    return table_of(caption, columns, ranges)


def evidence_table(caption: str, model: ModelResults) -> DataTable:
    """What the calibration says of each joint: its gap, its error and its system's singular values."""
    values_of = {row["joint"]: row["singular_values"] or [None] * 6 for row in model.solutions}
    singular = [f"Singular value {n}" for n in range(1, 7)]
    nothing = dict.fromkeys(singular)
    rows = [
        nothing | row | dict(zip(singular, values_of.get(row["joint"], []), strict=False))
        for row in model.joints
    ]
    columns = (
        text_column("Joint", "joint"),
        STATUS,
        number_column("Gap rms [mm]", "gap_rms_mm"),
        number_column("Free gap rms [mm]", "gap_rms_free_mm"),
        number_column("SD of the centre [mm]", "sd_mm"),
        number_column("Frames", "n_frames", 0),
        number_column("Independent samples", "n_effective", 1),
        *(number_column(heading, heading, 4) for heading in singular),
        text_column("Message", "message"),
    )
    return table_of(caption, columns, rows)


_TIP_ERROR_COLUMNS = (
    text_column("Model", "model"),
    text_column("Digit", "digit"),
    text_column("Binding", "binding"),
    number_column("Mean [mm]", "mean_mm"),
    number_column("SD [mm]", "sd_mm"),
    number_column("Median [mm]", "median_mm"),
    number_column("95 % [mm]", "p95_mm"),
    number_column("Max [mm]", "max_mm"),
    number_column("Min [mm]", "min_mm"),
    number_column("Frames", "n_frames", 0),
    number_column("Of", "n_frames_total", 0),
    Column("Held out", lambda row: "held out" if row["held_out"] else "○ in-sample", is_text=True),
    text_column("Message", "message"),
)
