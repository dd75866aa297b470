"""Joint angles of one recording: over time for the plots, and how far each joint went."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from schemas.tables import column_array
from stages.report.viewer.motion_data import Block

Array = npt.NDArray[np.float64]

ANGLES = ("flexion", "abduction", "rotation")
ANGLE_STEP_DEG = 0.1
"""As the page prints angles: rounded to it once, they show the table's own digits."""
PERCENTILES = (0, 5, 50, 95, 100)


@dataclass(frozen=True)
class JointAngles:
    """Angles under one model: joints (J,) names, frame (T,), angle_deg (T, J, 3) as ANGLES, NaN in gaps."""

    model: str
    joints: tuple[str, ...]
    frame: npt.NDArray[np.int64]
    angle_deg: Array

    def at(self, frame: npt.NDArray[np.int64]) -> Array:
        """The angles (F, J, 3) at those frames, NaN in those that no joint has a row for."""
        out = np.full((len(frame), *self.angle_deg.shape[1:]), np.nan)
        _, there, here = np.intersect1d(frame, self.frame, return_indices=True)
        out[there] = self.angle_deg[here]
        return out


@dataclass(frozen=True)
class AngleRange:
    """How far one angle of a joint went, degrees at PERCENTILES, and in how many frames it is known."""

    joint: str
    angle: str
    at_deg: tuple[float, ...]
    n_frames: int


def joint_angles_of(model: str, rows: pa.Table) -> JointAngles | None:
    """The angles in one recording's rows of joint_angles; None where there is no row."""
    if not rows.num_rows:
        return None
    coded = rows["joint"].combine_chunks().dictionary_encode()
    frame, at = np.unique(column_array(rows, "frame"), return_inverse=True)
    angle_deg = np.full((len(frame), len(coded.dictionary), len(ANGLES)), np.nan)
    columns = [column_array(rows, f"{angle}_deg").astype(float) for angle in ANGLES]
    angle_deg[at, coded.indices.to_numpy()] = np.stack(columns, -1)
    return JointAngles(model, tuple(coded.dictionary.to_pylist()), frame, angle_deg)


def angle_ranges(angles: JointAngles) -> list[AngleRange]:
    """The range of every angle of every joint; one that is never known has none."""
    ranges = []
    for j, joint in enumerate(angles.joints):
        for a, angle in enumerate(ANGLES):
            values = angles.angle_deg[:, j, a]
            known = values[np.isfinite(values)]
            if len(known):
                at_deg = tuple(float(value) for value in np.percentile(known, PERCENTILES))
                ranges.append(AngleRange(joint, angle, at_deg, len(known)))
    return ranges


def angle_blocks(angles: Sequence[JointAngles], frame: npt.NDArray[np.int64]) -> list[Block]:
    """Angles at those frames, packed with the motion as blocks angles0, angles1, ..., (T, J, 3)."""
    return [Block(f"angles{i}", ANGLE_STEP_DEG, own.at(frame)) for i, own in enumerate(angles)]
