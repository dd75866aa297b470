"""A recording's clock: duration of the recording, and breaks in its times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.arrays import Array, Integers

LEAST_S, LEAST_STEPS = 0.5, 10.0
"""Limits above which a deviation is a break of the clock, in s and in median steps; both must be exceeded."""

DAY_S = 86400.0
WRAPS_S = (2**16 * 1e-3, *(2**bits * unit for unit in (1e-3, 1e-6, 1e-9) for bits in (31, 32)))
"""Amounts in s by which a counter in ms, us or ns falls back when it overflows."""


PACKET_STEP, PACKET_GAP = 0.1, 3.0
"""Frames closer than this share of the usual interval belong to one packet; a gap before a packet longer than
this multiple of the duration of its frames is a pause."""


@dataclass(frozen=True)
class Packets:
    """Arrival of frames in packets. frames : median number per packet. rate_hz : frame rate."""

    frames: int
    rate_hz: float


def without_packets(time_s: Array) -> tuple[Array, Packets | None]:
    """Spread the times of frames that arrived in packets evenly.

    The last frame of a packet keeps its time; the others are placed between it and the previous packet. Times
    of frames that usually arrive singly are unchanged, even if the clock sometimes stood still.

    Parameters
    ----------
    time_s : array, shape (T,)
        Times of the frames, NaN where unknown.

    Returns
    -------
    time_s : array, shape (T,)
        Times, spread.
    packets : Packets or None
        Size of packets and frame rate; None if frames arrived singly.

    """
    timed = np.flatnonzero(np.isfinite(time_s))
    if len(timed) < 3:
        return time_s, None
    times, over = time_s[timed], min(len(timed) - 1, max(64, len(timed) // 10))
    usual_s = float(np.median(times[over:] - times[:-over])) / over
    if not usual_s > 0:
        return time_s, None
    ends = np.append(np.flatnonzero(np.abs(np.diff(times)) >= PACKET_STEP * usual_s), len(times) - 1)
    sizes = np.diff(ends, prepend=-1)
    usual = int(np.median(sizes))
    if usual < 2:
        return time_s, None
    since_s = np.diff(times[ends], prepend=times[0] - 1.0)
    runs_on = (since_s > 0) & (since_s < PACKET_GAP * sizes * usual_s)
    runs_on[0] = False
    usual_s = float(since_s[runs_on].sum() / sizes[runs_on].sum()) if runs_on.any() else usual_s
    step_s = np.where(runs_on, since_s / sizes, usual_s)
    before = np.repeat(ends, sizes) - np.arange(len(times))
    spread = time_s.copy()
    spread[timed] = np.repeat(times[ends], sizes) - before * np.repeat(step_s, sizes)
    return spread, Packets(usual, 1 / usual_s)


@dataclass(frozen=True)
class ClockBreak:
    """A step in a recording's times at which the clock did not run on.

    Attributes
    ----------
    kind : str
        ahead, back, still, midnight or wrap.
    row : int
        First frame after the step; for a clock that stood still, the first frame with the repeated time.
    rows : int
        Number of frames with the repeated time; 1 for other kinds.
    from_s, to_s : float
        Times before and after the step.
    by_s : float
        Amount by which the clock jumps ahead, or by which the times after a step back are too small.

    """

    kind: str
    row: int
    rows: int
    from_s: float
    to_s: float
    by_s: float


def device_clock(time_s: Array, frame: Integers | None = None) -> tuple[float | None, list[ClockBreak]]:
    """Return the duration of a recording by its clock, and the breaks of the clock.

    Parameters
    ----------
    time_s : array, shape (T,)
        Times of the frames, NaN where unknown.
    frame : array of int, shape (T,), optional
        Frame numbers; a step as long as the missing frames is not a break.

    Returns
    -------
    duration_s : float or None
        Time for which frames were recorded; None if the times do not determine it.
    breaks : list of ClockBreak
        In the order of time.

    """
    time_s = without_packets(time_s)[0]
    timed = np.flatnonzero(np.isfinite(time_s))
    at = np.flatnonzero(np.diff(time_s[timed]) != 0) + 1
    if not len(at):
        return None, _stood(timed[0], len(timed), time_s[timed[0]]) if len(timed) > 1 else []
    changes, alike = timed[at], np.diff(at, prepend=0)
    rows = np.diff(changes, prepend=timed[0])
    times = np.concatenate([time_s[timed[:1]], time_s[changes]])
    step = np.diff(times)
    usual_s, row_s = float(np.median(np.abs(step))), float(np.median(np.abs(step) / rows))
    least_s = max(LEAST_S, LEAST_STEPS * usual_s)
    expected = rows * row_s
    back = step < -LEAST_STEPS * usual_s
    gap = step - expected > least_s
    still = alike * row_s > least_s + usual_s
    counted = expected if frame is None else np.diff(frame[changes], prepend=frame[timed[0]]) * row_s
    breaks = []
    for k in np.flatnonzero(back | still | (step - counted > least_s)).tolist():
        start, end = times[k : k + 2].tolist()
        by_s = float(step[k] - expected[k])
        if still[k] and not back[k]:
            breaks += _stood(changes[k] - rows[k], alike[k], start)
        elif back[k]:
            wrap = next((fall for fall in (DAY_S, *WRAPS_S) if abs(by_s + fall) <= 3 * usual_s), 0.0)
            kind = {0.0: "back", DAY_S: "midnight"}.get(wrap, "wrap")
            breaks.append(ClockBreak(kind, int(changes[k]), 1, start, end, wrap or start - end))
        else:
            breaks.append(ClockBreak("ahead", int(changes[k]), 1, start, end, by_s))
    tail = len(timed) - int(at[-1])
    if tail * row_s > least_s + usual_s:
        breaks += _stood(changes[-1], tail, times[-1])
    off = back | gap | still
    running_s = float(times[-1] - times[0] - step[off].sum())
    more = int(timed[0]) + int(rows[off].sum()) + len(time_s) - 1 - int(changes[-1])
    return abs(running_s + more * row_s), breaks


def _stood(row: int, rows: int, time_s: float) -> list[ClockBreak]:
    """Return the break of a clock that stood still."""
    return [ClockBreak("still", int(row), int(rows), float(time_s), float(time_s), 0.0)]


def nominal_rate_hz(frame: Integers, time_s: Array) -> float:
    """Return the median frame rate of a recording.

    Parameters
    ----------
    frame : array of int, shape (T,)
        Frame numbers.
    time_s : array, shape (T,)
        Times of the frames, NaN where unknown.

    Returns
    -------
    float
        Rate, Hz; NaN without increasing times.

    """
    step = np.diff(frame)
    usual = step == (np.median(step) if len(step) else 0)
    interval = np.diff(without_packets(time_s)[0])[usual]
    interval = interval[np.isfinite(interval) & (interval > 0)]
    return float(1.0 / np.median(interval)) if len(interval) else float("nan")
