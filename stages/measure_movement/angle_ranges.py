"""How far an angle moves in a recording, and what skin and skeleton leave uncertain of that.

The error of an angle has three parts. What is common to all frames moves the median, and leaves the range
as it is. What the fit leaves open of the hand and its skin grows with the distance from the mean posture,
mostly in proportion: at the two ends it has opposite signs, and adds up. What is of the frame alone is
independent at both ends; being of either sign in every frame, it also widens a range, as any noise does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skeleton.rotations import Array

LOW_PERCENT, HIGH_PERCENT = 2.5, 97.5
_ENDS_PERCENT = 5.0
"""Of the frames at either end, over which an end's error is averaged."""

_WIDTH_OF_NORMAL = 3.92
"""From the 2.5th to the 97.5th percentile of a normal distribution, in its standard deviations."""


@dataclass(frozen=True)
class AngleRange:
    """Range of an angle in degrees; the errors are 1-sigma, NaN where the model states none."""

    range_deg: float
    low_deg: float
    high_deg: float
    full_range_deg: float
    median_deg: float
    range_sd_deg: float
    median_sd_deg: float


def angle_range(angle_deg: Array, sd_deg: Array, change_sd_deg: Array) -> AngleRange:
    """The range of an angle (T,) without gaps, one frame at least.

    sd_deg, change_sd_deg : (T,) 1-sigma errors of the angle and of its change from the mean posture.
    """
    low, middle, high = np.percentile(angle_deg, [LOW_PERCENT, 50.0, HIGH_PERCENT])
    return AngleRange(
        float(high - low),
        float(low),
        float(high),
        float(np.ptp(angle_deg)),
        float(middle),
        range_sd_deg(angle_deg, change_sd_deg, float(high - low)),
        float(np.median(sd_deg)),
    )


def range_sd_deg(angle_deg: Array, change_sd_deg: Array, range_deg: float) -> float:
    """1-sigma error of the range of an angle (T,); change_sd_deg : as in `angle_range`."""
    frame = float(change_sd_deg.min())
    ends = np.percentile(angle_deg, [_ENDS_PERCENT, 100.0 - _ENDS_PERCENT])
    by_hand = sum(
        np.sqrt(max((change_sd_deg[at_end] ** 2).mean() - frame**2, 0.0))
        for at_end in (angle_deg <= ends[0], angle_deg >= ends[1])
    )
    widened = range_deg - np.sqrt(max(range_deg**2 - (_WIDTH_OF_NORMAL * frame) ** 2, 0.0))
    return float(np.sqrt(by_hand**2 + 2 * frame**2 + widened**2))
