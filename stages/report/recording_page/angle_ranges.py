"""Joint angles of one recording: how far each joint went, and the angles over time for the plots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.report.pictures.joint_rows import Range
from stages.report.recording_results import ANGLES, JointAngles
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
