"""Cycles of a movement, cut by events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.skeleton.rotations import Array

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
    for number, (start, length, off) in enumerate(
        zip(onset.tolist(), duration.tolist(), sd.tolist(), strict=True)
    ):
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
