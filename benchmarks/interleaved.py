"""Times of rivals on a noisy machine: in turns A B A B, so that whatever slows one slows the others."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Timing:
    """Median seconds, and the median over the rounds of the ratio to the baseline in the same round."""

    seconds: float
    ratio: float


TURN_S = 0.2
"""A turn repeats quick work for this long, else it would pay for the caches that its predecessor emptied."""


def compare(
    rivals: Mapping[str, Callable[[], object]], baseline: str, rounds: int, turn_s: float = TURN_S
) -> dict[str, Timing]:
    """Give each rival a turn a round; its time is the mean over the turn's repetitions."""
    seconds: dict[str, list[float]] = {name: [] for name in rivals}
    for _ in range(rounds):
        for name, work in rivals.items():
            seconds[name].append(_turn(work, turn_s))
    return {
        name: Timing(
            statistics.median(own),
            statistics.median(a / b for a, b in zip(own, seconds[baseline], strict=True)),
        )
        for name, own in seconds.items()
    }


def _turn(work: Callable[[], object], turn_s: float) -> float:
    """Mean seconds of the work, repeated until the turn is over; once at least."""
    started = time.perf_counter()
    repetitions = 0
    while not repetitions or time.perf_counter() - started < turn_s:
        work()
        repetitions += 1
    return (time.perf_counter() - started) / repetitions
