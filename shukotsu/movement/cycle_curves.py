"""Joint angles over the cycle: mean and standard deviation over a recording's cycles, at every percent."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from shukotsu.arrays import Array
from shukotsu.hand.recorded_movement import AngleSeries
from shukotsu.movement.events import Cycle
from shukotsu.movement.sampling import Grid

if TYPE_CHECKING:
    from shukotsu.tables.rows import CycleCurvesRow

PERCENT = np.arange(101)

MOST_EVENTS = 4
"""Largest number of event names per recording for which curves are computed: those with the most cycles.

In recordings of music every pitch is an event name.
"""


def averaged_cycles(cycles: Sequence[Sequence[Cycle]]) -> list[list[Cycle]]:
    """Return the cycles that curves are averaged over: one list for each event name that has usable cycles.

    cycles : the cycles of a recording, one list per event name.
    """
    used = [[cycle for cycle in of_event if not cycle.refusal] for of_event in cycles]
    return sorted(filter(None, used), key=len, reverse=True)[:MOST_EVENTS]


def over_cycles(time_s: Array, values: Array, cycles: Sequence[Cycle], grid: Grid) -> Array:
    """Sample a series at every percent of each cycle, by linear interpolation between neighbouring frames.

    Parameters
    ----------
    time_s, values : array, shape (T,)
        Device times of the frames, NaN where unknown, and the series, NaN in gaps.
    cycles : sequence of Cycle, length C
        Cycles, which must be within the recording.
    grid : Grid
        Even grid of the frames; grid points without a frame are gaps.

    Returns
    -------
    array, shape (C, 101)
        Values in the unit of the series; NaN if the frame before or after is a gap, however short.

    """
    timed = np.isfinite(time_s)
    times_s = np.interp(np.arange(grid.count), grid.index[timed], time_s[timed])
    begin_s, length_s = (
        np.array([getattr(cycle, name) for cycle in cycles])[:, None] for name in ("onset_s", "duration_s")
    )
    read_at_s = begin_s + length_s * (PERCENT / PERCENT[-1])
    return np.asarray(np.interp(read_at_s, np.maximum.accumulate(times_s), grid.spread(values)))


def curve_rows(
    series: AngleSeries, time_s: Array, cycles: Sequence[Sequence[Cycle]], grid: Grid
) -> Iterator[CycleCurvesRow]:
    """Yield the rows of cycle_curves of an angle, if any cycle has it; cycles : from `averaged_cycles`."""
    for of_event in cycles:
        courses = over_cycles(time_s, series.angle_deg, of_event, grid)
        measured = ~np.isnan(courses)
        n = measured.sum(axis=0)
        if not n.any():
            continue
        mean = np.where(measured, courses, 0.0).sum(axis=0) / np.maximum(n, 1)
        squares = np.where(measured, (courses - mean) ** 2, 0.0).sum(axis=0)
        sd = np.sqrt(squares / np.maximum(n - 1, 1))
        for percent in PERCENT.tolist():
            count = int(n[percent])
            yield {
                "event": of_event[0].event,
                "joint": series.joint,
                "angle": series.angle,
                "cycle_percent": percent,
                "mean_deg": float(mean[percent]) if count else None,
                "sd_deg": float(sd[percent]) if count > 1 else None,
                "n_cycles": count,
            }
