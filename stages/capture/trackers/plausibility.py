"""Which poses cannot be right, whatever tracker they come from."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stages.capture.trackers.records import Records

NORM_TOLERANCE = 1e-3
FARTHEST_MM = 3048.0
"""120 inches: no magnetic tracker of this kind sees farther."""


def doubtful_poses(
    records: Records, *, position: bool = True, orientation: bool = True
) -> npt.NDArray[np.bool_]:
    """Say which poses cannot be right, (N,): not finite, no unit quaternion, farther than FARTHEST_MM.

    position, orientation : whether the stream has them; what it does not have is no reason.
    """
    wrong = np.zeros(len(records), bool)
    if position:
        squared = np.einsum("ij,ij->i", records.position_mm, records.position_mm)
        wrong |= ~(squared <= FARTHEST_MM**2)
    if orientation:
        squared = np.einsum("ij,ij->i", records.quaternion, records.quaternion)
        wrong |= ~(np.abs(squared - 1) <= 2 * NORM_TOLERANCE)
    return wrong
