"""A recording's frames on an even grid of time, with what was not recorded left empty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skeleton.rotations import Array

MOST_GAP_S = 0.05
"""Gaps up to this length are bridged by a straight line, for speeds and curves alone; longer ones stay."""

_LONGEST_PAUSE_S = 1.0
"""A longer pause takes no more room than this: no filter reaches across it."""


@dataclass(frozen=True)
class Grid:
    """Where T frames are on an even grid of `count` places, `step_s` apart; place : (T,) their indices."""

    place: npt.NDArray[np.int64]
    count: int
    step_s: float

    def spread(self, values: Array) -> Array:
        """Values (T, ...) at their places (count, ...), NaN where there is no frame."""
        if self.count == len(values):
            return values
        out = np.full((self.count, *values.shape[1:]), np.nan)
        out[self.place] = values
        return out

    def times(self, time_s: Array) -> Array:
        """Times (count,) of all places, from those of the frames (T,), NaN where unknown."""
        known = np.isfinite(time_s)
        return np.interp(np.arange(self.count), self.place[known], time_s[known])


def grid_of(time_s: Array) -> Grid | None:
    """The grid of the frames' device times (T,), NaN where unknown; None where they tell no rate."""
    apart = np.diff(time_s)
    known = apart[apart > 0]
    if not len(known):
        return None
    step_s = float(np.median(known))
    with np.errstate(invalid="ignore"):
        steps = np.where(apart > 0, np.round(apart / step_s), 1.0)
    steps = np.clip(steps, 1, max(1.0, round(_LONGEST_PAUSE_S / step_s))).astype(np.int64)
    place = np.concatenate([[0], np.cumsum(steps)])
    return Grid(place, int(place[-1]) + 1, step_s)


def bridged(values: Array, step_s: float) -> Array:
    """Series (T, C) with gaps of at most MOST_GAP_S filled by straight lines; longer ones stay NaN.

    A gap before a series' first value or after its last stays, too.
    """
    longest, out = int(MOST_GAP_S / step_s + 1e-9), values
    for column in np.flatnonzero(np.isnan(values).any(0)):
        known = np.flatnonzero(~np.isnan(values[:, column]))
        short = np.flatnonzero((np.diff(known) > 1) & (np.diff(known) <= longest + 1))
        if not len(short):
            continue
        out = values.copy() if out is values else out
        for first, last in zip(known[short], known[short + 1], strict=True):
            gap = slice(first, last + 1)
            out[gap, column] = np.linspace(values[first, column], values[last, column], last - first + 1)
    return out
