"""Define how far an angle moves in a recording, and what skin and skeleton leave uncertain of that.

The error of an angle has three parts. What is common to all frames moves the median, and leaves the range
as it is. What the fit leaves open of the hand and its skin grows with the distance from the mean posture,
mostly in proportion: at the two ends it has opposite signs, and adds up. What is of the frame alone is
independent at both ends; being of either sign in every frame, it also widens a range, as any noise does.

Of a hand that puts the receivers on anew, and moves as before, only a part is another: the hand's that goes
with the receivers, and the frame's, which is another in every visit to an end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.skeleton.angle_range import HIGH_PERCENT, LOW_PERCENT
from shukotsu.skeleton.rotations import Array

Booleans = npt.NDArray[np.bool_]
_Ends = tuple[Booleans, Booleans]

_ENDS_PERCENT = 5.0
"""Of the frames at either end, over which an end's error is averaged."""

_WIDTH_OF_NORMAL = 3.92
"""From the 2.5th to the 97.5th percentile of a normal distribution, in its standard deviations."""


@dataclass(frozen=True)
class AngleErrors:
    """1-sigma errors of an angle in every frame, (T,) degrees each, NaN where the model states none.

    change_sd_deg : of its change from the mean posture. session_sd_deg, session_change_sd_deg : the hand's
    part of both that differs when the receivers are put on anew.
    """

    sd_deg: Array
    change_sd_deg: Array
    session_sd_deg: Array
    session_change_sd_deg: Array


def angle_range(angle_deg: Array, errors: AngleErrors) -> dict[str, float]:
    """Return the range of an angle (T,) without gaps, one frame at least: columns of ranges_of_motion."""
    low, middle, high = np.percentile(angle_deg, [LOW_PERCENT, 50.0, HIGH_PERCENT])
    below, above = np.percentile(angle_deg, [_ENDS_PERCENT, 100.0 - _ENDS_PERCENT])
    ends = (angle_deg <= below, angle_deg >= above)
    frame = float(errors.change_sd_deg.min())
    by_hand = _at_ends(np.sqrt(np.maximum(errors.change_sd_deg**2 - frame**2, 0.0)), ends)
    range_deg = float(high - low)
    widened = range_deg - np.sqrt(max(range_deg**2 - (_WIDTH_OF_NORMAL * frame) ** 2, 0.0))
    visits = _visits(ends[0], angle_deg > middle), _visits(ends[1], angle_deg < middle)
    anew = _at_ends(errors.session_change_sd_deg, ends)
    return {
        "range_deg": range_deg,
        "low_deg": float(low),
        "high_deg": float(high),
        "full_range_deg": float(np.ptp(angle_deg)),
        "median_deg": float(middle),
        "range_sd_deg": float(np.sqrt(by_hand**2 + 2 * frame**2 + widened**2)),
        "median_sd_deg": float(np.median(errors.sd_deg)),
        "range_session_sd_deg": float(np.sqrt(anew**2 + frame**2 * sum(1 / n for n in visits))),
        "median_session_sd_deg": float(
            np.sqrt(np.median(errors.session_sd_deg) ** 2 + frame**2 / sum(visits))
        ),
    }


def _at_ends(sd_deg: Array, ends: _Ends) -> float:
    """Root mean square over the frames (T,) at either end, added up."""
    return float(sum(np.sqrt((sd_deg[at_end] ** 2).mean()) for at_end in ends))


def _visits(at_end: Booleans, beyond: Booleans) -> int:
    """Count how often the angle comes to one end from beyond its median; both (T,)."""
    either = at_end | beyond
    there = at_end[either]
    return int(there[0]) + int((there[1:] & ~there[:-1]).sum())
