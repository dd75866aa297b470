"""Which pulses of one clock are which of another, whatever the offset between the two.

Intervals are what both clocks share. A window of successive pulses is laid over all of the other clock's at
the offset at which most of them coincide, and the line through these is followed both ways for as long as
pulses keep to it. Where they stop, a clock was set or a recorder paused: what is left before and after is
matched by itself, in the order of time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

TOLERANCE_S = 0.05
"""How far two pulses that are the same may lie from the line: five times a jitter of 10 ms. It is a quarter
of the interval between pulses where these are denser than 5 Hz."""

SHORTEST_TOLERANCE_S = 0.001

USUAL_JITTER_S = 0.01
"""1-sigma error of a pulse's time before any is known."""

RATE_SD = 250e-6
"""1-sigma of how far the rates of two clocks differ before anything is known: 500 ppm is two of it."""

LARGEST_RATE = 600e-6
MOST_RATES = 400
WINDOW_PULSES = (32, 16, 8, 4)
"""Pulses in a window: fewer where more do not fit, as between two steps."""

WINDOWS = 5
NEARLY = 0.85
"""Of several offsets at which nearly as many pulses of a window coincide, as they do where pulses come at
regular intervals, the one is taken that moves them least in number."""

RUN_PULSES = 8
"""A stretch ends where fewer than half of so many successive pulses keep to its line."""

MISS_COST = 0.25
"""What a pulse that only one clock has takes from a stretch, of what one that both have gives it. A stretch
is what pays most: a chance hit far from all others, beyond a step, is none of it."""

CHANCE = 0.01
"""Windows that coincide as well by chance, expected in all places together, above which none is believed."""


@dataclass(frozen=True)
class Line:
    """reference = other + offset + rate * (other - at); variances in s^2 and of the rate."""

    at: float
    offset: float
    rate: float
    offset_variance: float
    rate_variance: float

    @classmethod
    def through(cls, other_s: Array, reference_s: Array, sd_s: float = USUAL_JITTER_S) -> Line:
        """Fit the line to matched pulses (M,), at least one; the rate is drawn towards 0, see RATE_SD."""
        at = float(other_s.mean())
        x, y = other_s - at, reference_s - other_s
        weight = float(x @ x) + sd_s**2 / RATE_SD**2
        rate = float(x @ (y - y.mean())) / weight
        return cls(at, float(y.mean()), rate, sd_s**2 / len(x), sd_s**2 / weight)

    def __call__(self, other_s: Array) -> Array:
        """Times of the reference clock."""
        return np.asarray(other_s + self.offset + self.rate * (other_s - self.at))

    def sd_s(self, other_s: Array) -> Array:
        """1-sigma error of those times."""
        return np.sqrt(self.offset_variance + self.rate_variance * (other_s - self.at) ** 2)


@dataclass(frozen=True, eq=False)
class Stretch:
    """Pulses between two steps: indices (M,) of those that both clocks have, ascending.

    by_chance : expected number of places at which as many would coincide by chance.
    """

    reference: Integers
    other: Integers
    by_chance: float


def tolerance_s(reference_s: Array, other_s: Array) -> float:
    """Return how far the same pulse may lie from the line, see TOLERANCE_S."""
    intervals = [float(np.median(np.diff(times))) for times in (reference_s, other_s) if len(times) > 1]
    return max(SHORTEST_TOLERANCE_S, min([TOLERANCE_S, *(interval / 4 for interval in intervals)]))


def match_pulses(reference_s: Array, other_s: Array, within_s: float) -> list[Stretch]:
    """Match pulses, both ascending; give the stretches in order of time, none where nothing fits."""
    if len(reference_s) == len(other_s) == 1:
        return [Stretch(np.array([0]), np.array([0]), 0.0)]
    stretches: list[Stretch] = []
    left = [(0, len(reference_s), 0, len(other_s))]
    while left:
        first, end, other_first, other_end = left.pop()
        r, o = reference_s[first:end], other_s[other_first:other_end]
        own = _stretch(r, o, within_s) if min(len(r), len(o)) > 1 else None
        if own is None or (own.by_chance > CHANCE and stretches):
            continue
        stretches.append(Stretch(first + own.reference, other_first + own.other, own.by_chance))
        before = (first, first + int(own.reference[0]), other_first, other_first + int(own.other[0]))
        after = (first + int(own.reference[-1]) + 1, end, other_first + int(own.other[-1]) + 1, other_end)
        left += [before, after]
    return sorted(stretches, key=lambda stretch: int(stretch.other[0]))


def nearest_pairs(
    reference_s: Array, expected_s: Array, within_s: float | Array
) -> tuple[Integers, Integers]:
    """Pairs (i, j) of a pulse and the expected time that is nearest to it, each pulse in one pair."""
    if not len(reference_s) or not len(expected_s):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    at = nearest(reference_s, expected_s)
    error = np.abs(reference_s[at] - expected_s)
    order = np.flatnonzero(error <= within_s)
    order = order[np.argsort(error[order], kind="stable")]
    _, best = np.unique(at[order], return_index=True)
    chosen = np.sort(order[best])
    keeps_order = np.diff(at[chosen], prepend=-1) > 0
    return at[chosen][keeps_order], chosen[keeps_order]


def nearest(reference_s: Array, expected_s: Array) -> Integers:
    """Index of the pulse nearest to each expected time; pulses ascending, at least one."""
    right = np.clip(np.searchsorted(reference_s, expected_s), 1, max(1, len(reference_s) - 1))
    left = right - 1
    right = np.minimum(right, len(reference_s) - 1)
    closer = np.abs(expected_s - reference_s[left]) <= np.abs(reference_s[right] - expected_s)
    return np.where(closer, left, right).astype(np.int64)


def _stretch(r: Array, o: Array, within_s: float) -> Stretch | None:
    """The stretch about the window that coincides best."""
    best: tuple[float, Integers, Integers] | None = None
    for size in dict.fromkeys(min(size, len(o)) for size in WINDOW_PULSES):
        for start in np.unique(np.linspace(0, len(o) - size, WINDOWS).astype(int)):
            reference, other = _coinciding(r, o, int(start), size, within_s)
            if len(other) < max(2, size / 2):
                continue
            chance = _by_chance(r, o[start : start + size], len(other), within_s)
            if best is None or chance < best[0]:
                best = chance, reference, other
            if chance < CHANCE / 1000:
                break
        if best is not None and best[0] < CHANCE:
            break
    return best and Stretch(*_dense(*_followed(r, o, best[1], best[2], within_s)), best[0])


def _coinciding(r: Array, o: Array, start: int, size: int, within_s: float) -> tuple[Integers, Integers]:
    """Pairs of a window at the offset and the rate at which most coincide; of equals, the least shift."""
    middle = float(o[start + size // 2])
    x = o[start : start + size] - middle
    best: tuple[int, int, Line] | None = None
    for rate in _rates(float(x[-1] - x[0]), within_s):
        differences = np.sort((r[:, None] - middle - (1 + rate) * x).ravel())
        ends = np.searchsorted(differences, differences + 2 * within_s, "right")
        count = ends - np.arange(len(differences))
        good = np.flatnonzero(count >= NEARLY * count.max())
        shift = np.abs(np.searchsorted(r, middle + differences[good] + within_s) - (start + size // 2))
        chosen = differences[good[np.argmin(shift)]]
        same = good[np.abs(differences[good] - chosen) <= 2 * within_s]
        place = int(same[np.argmax(count[same])])
        if best is None or (count[place], -shift.min()) > best[:2]:
            offset = float(differences[place : ends[place]].mean())
            best = int(count[place]), -int(shift.min()), Line(middle, offset, float(rate), 0.0, 0.0)
    assert best is not None
    reference, other = nearest_pairs(r, best[2](o[start : start + size]), within_s)
    return reference, start + other


def _rates(span_s: float, within_s: float) -> Array:
    """Rates to try: none in between moves the ends of a window by more than a quarter of the tolerance."""
    n_steps = min(MOST_RATES // 2, int(np.ceil(LARGEST_RATE * span_s / within_s - 0.5)))
    return np.linspace(-LARGEST_RATE, LARGEST_RATE, 2 * n_steps + 1) if n_steps > 0 else np.zeros(1)


def _by_chance(r: Array, window_s: Array, hits: int, within_s: float) -> float:
    """Expected number of offsets at which so many pulses of a window coincide with others of the density."""
    from scipy.stats import binom

    span_s = max(float(r[-1] - r[0]), within_s)
    share = min(1.0, 2 * within_s * len(r) / span_s)
    return float(len(r) * len(window_s) * binom.sf(hits - 2, len(window_s) - 1, share))


def _followed(
    r: Array, o: Array, reference: Integers, other: Integers, within_s: float
) -> tuple[Integers, Integers]:
    """Follow the line through a window's pairs both ways, as far as it is known and pulses keep to it."""
    while True:
        line = Line.through(o[other], r[reference], min(USUAL_JITTER_S, within_s / 5))
        sure = np.concatenate([other, np.flatnonzero(2.5 * line.sd_s(o) < within_s)])
        first, end = int(sure.min()), int(sure.max()) + 1
        i, j = nearest_pairs(r, line(o[first:end]), within_s)
        hit = np.zeros(end - first, bool)
        hit[j] = True
        middle = int(other[len(other) // 2]) - first
        low, high = middle + 1 - _kept(hit[middle::-1]), middle + _kept(hit[middle:])
        keep = (j >= low) & (j < high)
        if keep.sum() <= len(other):
            return reference, other
        reference, other = i[keep], first + j[keep]


def _dense(reference: Integers, other: Integers) -> tuple[Integers, Integers]:
    """The run of pairs that pays most, see MISS_COST."""
    missed = reference - reference[0] + other - other[0] - 2 * np.arange(len(other))
    paid = np.arange(len(other)) - MISS_COST * missed
    end = int(np.argmax(paid - np.minimum.accumulate(paid)))
    first = int(np.argmin(paid[: end + 1]))
    return reference[first : end + 1], other[first : end + 1]


def _kept(hit: npt.NDArray[np.bool_]) -> int:
    """Count the leading pulses of a stretch, see RUN_PULSES; up to the last that keeps to the line."""
    runs = np.convolve(hit, np.ones(RUN_PULSES))[RUN_PULSES - 1 :][: max(1, len(hit) - RUN_PULSES + 1)]
    low = np.flatnonzero(runs < min(RUN_PULSES, len(hit)) / 2)
    end = int(low[0]) + RUN_PULSES // 2 if len(low) else len(hit)
    there = np.flatnonzero(hit[:end])
    return int(there[-1]) + 1 if len(there) else 0


def coincidences(reference_s: Array, expected_s: Array, within_s: float) -> int:
    """Count the expected times that have a pulse near them."""
    return int((np.abs(reference_s[nearest(reference_s, expected_s)] - expected_s) <= within_s).sum())
