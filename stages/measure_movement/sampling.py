"""A recording's frames on an even grid of time, with what was not recorded left empty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.schemas.device_clock import device_clock
from shukotsu.skeleton.rotations import Array

MOST_GAP_S = 0.05
"""Gaps up to this length are bridged by a straight line, but for ranges and distances; longer ones stay."""

_LONGEST_PAUSE_S = 1.0
"""A longer pause takes no more room than this: no filter reaches across it."""

_PARTS = (1, 2, 3)
"""Of the median interval, what a step may be: where most frames are missing, intervals are several steps."""

_UNSURE, _MOST_UNSURE = 0.35, 0.01
"""How far an interval may be from a whole number of steps, in steps, and what share may be farther."""


@dataclass(frozen=True)
class Grid:
    """Place T frames on an even grid of `count` places, `step_s` apart; place : (T,) their indices."""

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


def grid_of(time_s: Array) -> Grid | None:
    """The grid of the frames' device times (T,), NaN where unknown; None where they tell no rate.

    Stamps that are rounded, as to milliseconds, tell the rate by their mean. Where stamps scatter too much to
    say which frames are missing, as those that a host gives, none is taken for missing but in pauses.
    """
    apart = np.diff(time_s)
    known = apart[apart > 0]
    usual_s = float(np.median(known)) if len(known) else np.nan
    pause = ~(np.abs(apart) <= usual_s + MOST_GAP_S)
    for one in device_clock(time_s)[1]:
        if one.kind == "still":
            pause[one.row : one.row + one.rows - 1] = True
    if not apart[~pause].sum() > 0:
        return None
    for part in _PARTS:
        steps = np.where(apart > 0, np.maximum(np.round(apart * part / usual_s), 1.0), 1.0)
        step_s = float(apart[~pause].sum() / steps[~pause].sum())
        off = np.abs(apart / step_s - steps)[~pause]
        if np.mean(off > _UNSURE) <= _MOST_UNSURE:
            break
    else:
        step_s = float(apart[~pause].mean())
        steps = np.where(pause & (apart > 0), np.round(apart / step_s), 1.0)
    steps = np.clip(steps, 1, max(1.0, round(_LONGEST_PAUSE_S / step_s))).astype(np.int64)
    place = np.concatenate([[0], np.cumsum(steps)])
    return Grid(place, int(place[-1]) + 1, step_s)


def bridged(values: Array, step_s: float, most_s: float = MOST_GAP_S) -> Array:
    """Series (T, C) with gaps of at most most_s filled by straight lines; longer ones stay NaN.

    A gap before a series' first value or after its last stays, too.
    """
    longest, out = int(most_s / step_s + 1e-9), values
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
