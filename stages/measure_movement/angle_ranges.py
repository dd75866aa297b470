"""Define how far an angle moves in a recording, and what skin and skeleton leave uncertain of that.

The error of an angle has three parts. What is common to all frames moves the median, and leaves the range
as it is. What the fit leaves open of the hand and its skin grows with the distance from the mean posture,
mostly in proportion: at the two ends it has opposite signs, and adds up. What is of the frame alone is
independent at both ends; being of either sign in every frame, it also widens a range, as any noise does.
"""

from __future__ import annotations

import numpy as np

from shukotsu.skeleton.angle_range import HIGH_PERCENT, LOW_PERCENT
from shukotsu.skeleton.rotations import Array

_ENDS_PERCENT = 5.0
"""Of the frames at either end, over which an end's error is averaged."""

_WIDTH_OF_NORMAL = 3.92
"""From the 2.5th to the 97.5th percentile of a normal distribution, in its standard deviations."""


def angle_range(angle_deg: Array, sd_deg: Array, change_sd_deg: Array) -> dict[str, float]:
    """Return the range of an angle (T,) without gaps, one frame at least: columns of ranges_of_motion.

    sd_deg, change_sd_deg : (T,) 1-sigma errors of the angle, and of its change from the mean posture; NaN
    where the model states none.
    """
    low, middle, high = np.percentile(angle_deg, [LOW_PERCENT, 50.0, HIGH_PERCENT])
    below, above = np.percentile(angle_deg, [_ENDS_PERCENT, 100.0 - _ENDS_PERCENT])
    frame = float(change_sd_deg.min())
    of_hand = np.sqrt(np.maximum(change_sd_deg**2 - frame**2, 0.0))
    ends = angle_deg <= below, angle_deg >= above
    by_hand = float(sum(np.sqrt((of_hand[at_end] ** 2).mean()) for at_end in ends))
    range_deg = float(high - low)
    widened = range_deg - np.sqrt(max(range_deg**2 - (_WIDTH_OF_NORMAL * frame) ** 2, 0.0))
    return {
        "range_deg": range_deg,
        "low_deg": float(low),
        "high_deg": float(high),
        "full_range_deg": float(np.ptp(angle_deg)),
        "median_deg": float(middle),
        "range_sd_deg": float(np.sqrt(by_hand**2 + 2 * frame**2 + widened**2)),
        "median_sd_deg": float(np.median(sd_deg)),
    }
