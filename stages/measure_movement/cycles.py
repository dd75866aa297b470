"""Cycles of a movement, cut by events, and its mean course over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.skeleton.rotations import Array

PERCENT = np.arange(101)
SHORTEST, LONGEST = 0.5, 2.0
"""Of the median duration of an event's cycles; a shorter or longer one is another movement."""

MOST_ONSET_SD = 0.05
"""1-sigma of an onset, of the cycle's duration, above which it is not used: a sine-like course read so far
off is 16 % of its range out where it is steepest."""


@dataclass(frozen=True)
class Cycle:
    """A cycle of the events of one name; refusal : why it is not used, or empty."""

    event: str
    number: int
    onset_s: float
    duration_s: float
    refusal: str = ""


def cut_cycles(
    event: str, onset_s: Sequence[float], duration_s: Sequence[float], sd_s: Sequence[float] | None = None
) -> list[Cycle]:
    """Cycles of the events of one name, whose own duration counts where it has one (else NaN).

    A cycle without one lasts to the next onset; the last is none. Refused are those that are much shorter or
    longer than the median, and those whose ends are not known well enough. sd_s : 1-sigma of the onsets, NaN
    where nothing says it, infinite of a clock that is weak.
    """
    order = np.argsort(np.asarray(onset_s, float), kind="stable")
    onset, own = np.asarray(onset_s, float)[order], np.asarray(duration_s, float)[order]
    sd = np.nan_to_num(np.zeros(len(own)) if sd_s is None else np.asarray(sd_s, float), posinf=np.inf)[order]
    to_next = ~(own > 0)
    duration = np.where(to_next, np.append(np.diff(onset), np.nan), own)
    sd = np.where(to_next, np.maximum(sd, np.append(sd[1:], 0.0)), sd)
    kept = duration > 0
    onset, duration, sd = onset[kept], duration[kept], sd[kept]
    usual = float(np.median(duration)) if len(duration) else np.nan
    cycles = []
    found = zip(onset.tolist(), duration.tolist(), sd.tolist(), strict=True)
    for number, (start, length, off) in enumerate(found):
        refusal = ""
        if np.isinf(off):
            refusal = "the clock of its events is weak"
        elif off > MOST_ONSET_SD * length:
            refusal = f"its onset is known to {1e3 * off:.0f} ms (1-sigma), too little for {length:.2f} s"
        elif not SHORTEST * usual <= length <= LONGEST * usual:
            word = "short" if length < usual else "long"
            refusal = f"too {word}: {length:.2f} s, median {usual:.2f} s"
        cycles.append(Cycle(event, number, start, length, refusal))
    return cycles


def within_recording(cycles: Sequence[Cycle], time_s: Array) -> list[Cycle]:
    """The cycles, those refused that are not wholly within the recording's times (T,)."""
    first, last = time_s[0], time_s[-1]
    return [
        replace(one, refusal="not wholly within the recording")
        if not one.refusal and not first <= one.onset_s <= one.onset_s + one.duration_s <= last
        else one
        for one in cycles
    ]


def normalised(values: Array, time_s: Array, cycle: Cycle) -> Array:
    """Series (T, C) at 0 to 100 % of a cycle, (101, C), by straight lines between frames.

    time_s : (T,) of the frames, rising. NaN in a column with a gap within the cycle.
    """
    at_s = cycle.onset_s + cycle.duration_s * PERCENT / 100.0
    first = max(0, int(np.searchsorted(time_s, at_s[0], "right")) - 1)
    last = min(len(time_s), int(np.searchsorted(time_s, at_s[-1], "left")) + 1)
    time_s, values = time_s[first:last], values[first:last]
    after = np.clip(np.searchsorted(time_s, at_s, "left"), 1, len(time_s) - 1)
    share = ((at_s - time_s[after - 1]) / (time_s[after] - time_s[after - 1]))[:, None]
    out = np.asarray(values[after - 1] + share * (values[after] - values[after - 1]))
    out[:, np.isnan(values).any(0)] = np.nan
    return out


def mean_curves(curves: Array) -> tuple[Array, Array, Array]:
    """Mean and SD (101, C) between cycles, and cycles used (C,), of curves (N, 101, C).

    A cycle with a gap in a column is left out of it. NaN of a mean without cycles, an SD with fewer than two.
    """
    whole = np.asarray(~np.isnan(curves).any(1))
    count = whole.sum(0)
    kept = np.where(whole[:, None], curves, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = kept.sum(0) / count
        squared = np.where(whole[:, None], (curves - mean) ** 2, 0.0).sum(0)
        sd = np.where(count > 1, np.sqrt(squared / (count - 1)), np.nan)
    return mean, sd, count
