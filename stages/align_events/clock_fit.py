"""Two clocks brought together by pulses that both have: one straight line, offset and drift.

Intervals are what both clocks share. A window of successive pulses is laid over the other clock's at the
offset at which most coincide; the line through these is followed outward as far as it is known, and fitted
without pulses beyond five standard deviations. Where a clock was set or a recorder paused, no one line holds,
and none is given.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.stages.align_events.event_list import Array

Integers = npt.NDArray[np.int64]

TOLERANCE_S, SHORTEST_TOLERANCE_S = 0.05, 0.001
"""How far two pulses that are the same may lie from the line: a quarter of their usual interval where that is
less."""

USUAL_JITTER_S = 0.01
"""1-sigma error of a pulse's time before any is known."""

RATE_SD, LARGEST_RATE, MOST_RATES = 250e-6, 600e-6, 400
"""1-sigma of how far the rates of two clocks differ before anything is known; at most; rates to try."""

WINDOW_PULSES, WINDOWS = 32, 5
NEARLY = 0.85
"""Of offsets at which nearly as many pulses coincide, the one is taken that moves them least in number."""

CHANCE = 0.01
"""Windows that coincide as well by chance, expected in all places together, above which none is believed."""

FEWEST_PULSES = 3
LOST_RUN, LEAST_KEPT = 16, 0.25
"""Of so many successive pulses, while both clocks ran, the share that keeps to the line: else a clock was
set."""

SHIFTS, AS_WELL, MOST_JUDGING = 200, 0.6, 512
"""Pulses to either side of the middle one by which others are shifted; the share of hits that leaves a shift
open."""

WAS_SET = "its pulses keep to no one line: a clock was set or a recorder paused; bring each part by itself"

WANDER_BLOCKS = (8, 32)
"""Into how many pieces a recording is cut to see whether its errors hang together."""


@dataclass(frozen=True)
class Line:
    """reference = other + offset + rate * (other - at); variances in s^2 and of the rate."""

    at: float
    offset: float
    rate: float
    offset_variance: float = 0.0
    rate_variance: float = 0.0

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


@dataclass(frozen=True)
class ClockFit:
    """The line, and what was seen of the pulses.

    jitter_s : 1-sigma of a single pulse. common_sd_s : 1-sigma of what all times share beside the line: its
    bend, and the shift by whole periods that regular pulses leave open. clock_sd_s : largest 1-sigma error of
    a mapped time between the first and the last pulse. n_missing, n_extra : pulses that only the reference,
    only the other clock has while both ran. message : why the line is not sure, or empty.
    """

    line: Line
    jitter_s: float
    common_sd_s: float
    residual_s: float
    clock_sd_s: float
    n_pulses: int
    n_missing: int
    n_extra: int
    message: str

    def mapped(self, other_s: Array) -> tuple[Array, Array]:
        """Times of the reference clock (N,) and their 1-sigma error, without the jitter of the event."""
        return self.line(other_s), np.hypot(self.line.sd_s(other_s), self.common_sd_s)


def fit_clock(r: Array, o: Array) -> ClockFit | str:
    """Match the pulses of the reference clock, ascending, and the other, as written, and fit the line.

    Offsets may be of any size, rates differ by up to 600 ppm; pulses may be lost or added on either clock.
    Gives a sentence where no one line fits.
    """
    if not len(r) or not len(o):
        return "no common pulse on " + ("the file" if len(r) else "the recording's clock")
    if (np.diff(o) < -10 * USUAL_JITTER_S).any():
        return WAS_SET
    o = np.sort(o)
    intervals_s = [float(np.median(np.diff(times))) for times in (r, o) if len(times) > 1]
    within_s = max(SHORTEST_TOLERANCE_S, min([TOLERANCE_S, *(interval / 4 for interval in intervals_s)]))
    i, j, chance = _best_window(r, o, within_s)
    if chance >= 1:
        found = f"the {len(o)} pulses of the file fit the {len(r)} of the recording nowhere"
        return f"{found}; are they the same pulses?"
    i, j = _followed(r, o, i, j, within_s)
    sd_s = USUAL_JITTER_S
    for _ in range(3):
        line = Line.through(o[j], r[i], sd_s)
        if len(j) > 2 * FEWEST_PULSES:
            sd_s = max(1e-4, 1.4826 * float(np.median(np.abs(r[i] - line(o[j])))))
            within_s = min(within_s, max(5 * sd_s, 0.003))
        i, j = nearest_pairs(r, line(o), within_s)
    error = r[i] - Line.through(o[j], r[i], sd_s)(o[j])
    jitter_s = _stated_sd_s(error)
    line = Line.through(o[j], r[i], jitter_s)
    margin_s, at_s = 5 * jitter_s, line(o)
    both_ran = [max(r[0], at_s[0]) - margin_s, min(r[-1], at_s[-1]) + margin_s]
    seen_r, seen = (slice(*np.searchsorted(times, both_ran)) for times in (r, at_s))
    n_missing, n_extra = (max(0, len(times) - len(j)) for times in (r[seen_r], at_s[seen]))
    if len(j) > 1 and (_left(len(o), j, seen) or _left(len(r), i, seen_r)):
        return WAS_SET
    open_s = _open_shift_s(r, at_s, within_s)
    common_sd_s = float(np.hypot(open_s, _wander_s(error)))
    clock_sd_s = float(np.hypot(line.sd_s(o[j[[0, -1]]]).max(), common_sd_s))
    message = _doubt(len(j), min(n_missing, n_extra), open_s, chance)
    residual_s = float(np.sqrt(np.mean(error**2)))
    return ClockFit(line, jitter_s, common_sd_s, residual_s, clock_sd_s, len(j), n_missing, n_extra, message)


def _best_window(r: Array, o: Array, within_s: float) -> tuple[Integers, Integers, float]:
    """Pairs of the window that coincides best, and in how many places as many would by chance."""
    from scipy.stats import binom

    first = np.zeros(1, np.int64)
    if len(r) == len(o) == 1:
        return first, first, 0.0
    best = first, first, 1.0
    size = min(WINDOW_PULSES, len(o))
    share = min(1.0, 2 * within_s * len(r) / max(float(r[-1] - r[0]), within_s))
    for start in np.unique(np.linspace(0, len(o) - size, WINDOWS).astype(int)).tolist():
        i, j = _coinciding(r, o, start, size, within_s)
        chance = float(len(r) * size * binom.sf(len(j) - 2, size - 1, share)) if len(j) > 1 else 1.0
        if chance < best[2]:
            best = i, j, chance
    return best


def _coinciding(r: Array, o: Array, start: int, size: int, within_s: float) -> tuple[Integers, Integers]:
    """Pairs of a window at the offset and the rate at which most coincide; of equals, the least shift."""
    middle = float(o[start + size // 2])
    x = o[start : start + size] - middle
    n_rates = min(MOST_RATES // 2, max(0, int(np.ceil(LARGEST_RATE * float(x[-1] - x[0]) / within_s - 0.5))))
    best: tuple[int, int, Line] | None = None
    for rate in np.linspace(-LARGEST_RATE, LARGEST_RATE, 2 * n_rates + 1) if n_rates else np.zeros(1):
        differences = np.sort((r[:, None] - middle - (1 + rate) * x).ravel())
        ends = np.searchsorted(differences, differences + 2 * within_s, "right")
        count = ends - np.arange(len(differences))
        good = np.flatnonzero(count >= NEARLY * count.max())
        shift = np.abs(np.searchsorted(r, middle + differences[good] + within_s) - (start + size // 2))
        same = good[np.abs(differences[good] - differences[good[np.argmin(shift)]]) <= 2 * within_s]
        at = int(same[np.argmax(count[same])])
        if best is None or (count[at], -shift.min()) > best[:2]:
            offset = float(differences[at : ends[at]].mean())
            best = int(count[at]), -int(shift.min()), Line(middle, offset, float(rate))
    assert best is not None
    i, j = nearest_pairs(r, best[2](o[start : start + size]), within_s)
    return i, start + j


def _followed(r: Array, o: Array, i: Integers, j: Integers, within_s: float) -> tuple[Integers, Integers]:
    """Follow the line through a window's pairs both ways, as far as it is known."""
    while True:
        line = Line.through(o[j], r[i], min(USUAL_JITTER_S, within_s / 5))
        sure = np.flatnonzero((2.5 * line.sd_s(o) < within_s) | ((o >= o[j[0]]) & (o <= o[j[-1]])))
        more_i, more_j = nearest_pairs(r, line(o[sure]), within_s)
        if len(more_j) <= len(j):
            return i, j
        i, j = more_i, sure[more_j]


def nearest_pairs(reference_s: Array, expected_s: Array, within_s: float) -> tuple[Integers, Integers]:
    """Pairs (i, j) of a pulse and the expected time that is nearest to it, each pulse in one pair."""
    at = _nearest(reference_s, expected_s)
    error = np.abs(reference_s[at] - expected_s)
    order = np.flatnonzero(error <= within_s)
    order = order[np.argsort(error[order], kind="stable")]
    _, best = np.unique(at[order], return_index=True)
    chosen = np.sort(order[best])
    keeps_order = np.diff(at[chosen], prepend=-1) > 0
    return at[chosen][keeps_order], chosen[keeps_order]


def _nearest(reference_s: Array, expected_s: Array) -> Integers:
    """Index of the pulse nearest to each expected time."""
    right = np.clip(np.searchsorted(reference_s, expected_s), 0, len(reference_s) - 1)
    left = np.maximum(right - 1, 0)
    closer = np.abs(expected_s - reference_s[left]) <= np.abs(reference_s[right] - expected_s)
    return np.where(closer, left, right).astype(np.int64)


def _left(count: int, matched: Integers, ran: slice) -> bool:
    """Whether a run of one clock's pulses, while both ran, has left the line, see LOST_RUN."""
    kept = np.isin(np.arange(count), matched)[ran]
    size = min(LOST_RUN, max(FEWEST_PULSES, len(kept) // 2))
    runs = np.convolve(kept, np.ones(size), "valid") if len(kept) >= size else np.full(1, size)
    return bool(runs.min() < LEAST_KEPT * size)


def _stated_sd_s(error: Array) -> float:
    """1-sigma of a pulse, widened so that 1.96 of it hold 95 % where it is known from a few pulses only."""
    from scipy.stats import t

    free = len(error) - 2
    if free < 1:
        return USUAL_JITTER_S
    return float(np.sqrt((error**2).sum() / free) * t.ppf(0.975, free) / 1.96)


def _open_shift_s(r: Array, at_s: Array, within_s: float) -> float:
    """1-sigma of the shifts at which pulses (N,), mapped, coincide about as well, as they do at regular
    intervals.
    """
    at_s = at_s[:: -(-len(at_s) // MOST_JUDGING)]
    middle = int(_nearest(r, np.median(at_s, keepdims=True))[0])
    shifts_s = r[max(0, middle - SHIFTS) : middle + SHIFTS + 1] - r[middle]
    moved_s = at_s + np.append(0.0, shifts_s[np.abs(shifts_s) > 2 * within_s])[:, None]
    hit = np.abs(r[_nearest(r, moved_s.ravel())].reshape(moved_s.shape) - moved_s) <= within_s
    ran = (moved_s >= r[0] - within_s) & (moved_s <= r[-1] + within_s)
    share = hit.sum(1) / np.maximum(1, ran.sum(1))
    as_well = (share >= AS_WELL * share[0]) & (2 * ran.sum(1) > ran[0].sum())
    return float(np.sqrt(np.mean((moved_s[as_well, 0] - at_s[0]) ** 2)))


def _wander_s(error: Array) -> float:
    """1-sigma of what many pulses in turn have in common, as of a changing rate; 0 if chance may be it."""
    from scipy.stats import chi2

    most = 0.0
    for n_blocks in WANDER_BLOCKS:
        if (size := len(error) // n_blocks) >= WANDER_BLOCKS[0]:
            blocks = error[: size * n_blocks].reshape(n_blocks, size)
            of_means = float(blocks.var(-1, ddof=1).mean()) / size
            seen = float(np.mean(blocks.mean(-1) ** 2))
            if seen * n_blocks > of_means * chi2.isf(0.0005, n_blocks):
                most = max(most, seen - of_means)
    return float(np.sqrt(most))


def _doubt(n: int, n_lost: int, open_s: float, by_chance: float) -> str:
    """Why a line is weak, or an empty text."""
    if n < FEWEST_PULSES:
        return (
            f"{n} common pulse{'s'[: n - 1]}: the rates of the clocks are taken to differ by less than "
            f"{2e6 * RATE_SD:.0f} ppm, which is {2 * RATE_SD * 60e3:.0f} ms in a minute"
        )
    if open_s > 0:
        return (
            "pulses at regular intervals can be laid over each other in several ways, whole periods apart "
            f"(1-sigma {open_s:.2f} s); pulse at irregular intervals"
        )
    if by_chance > CHANCE:
        return f"{n} pulses may fit so by chance; give more of them"
    return (
        "fewer than half of the pulses are common to both clocks; are they the same pulses?"
        if n < n_lost
        else ""
    )
