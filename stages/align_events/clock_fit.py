"""Two clocks brought together by pulses that both have: a straight line, and a new offset after every step.

time of the reference = time of the other + offset + rate * (time of the other - its middle). The rate is one
crystal's against another's and holds throughout; the offset is another after a clock was set or a recorder
paused. See docs/events.md for what the numbers mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from shukotsu.stages.align_events.period_shifts import as_well, best_shift
from shukotsu.stages.align_events.pulse_matching import (
    CHANCE,
    NEARLY,
    RATE_SD,
    USUAL_JITTER_S,
    Array,
    Integers,
    Line,
    Stretch,
    match_pulses,
    nearest,
    nearest_pairs,
    tolerance_s,
)

WANDER_BLOCKS = (8, 16, 32, 64)
"""Into how many pieces a recording is cut to see whether its errors hang together."""

LEAST_STEP_S = 0.005
"""A smaller change of the offset is a clock that wanders."""

STEP_GAIN = 25.0
"""How much the sum of squared residuals, in units of their variance, must fall for a step to be believed,
besides twice the logarithm of the places at which it may be: five sigma."""

AHEAD_S = 1000.0
FEWEST_GAINED = 3
"""Pulses that must coincide more than without a step where one is believed."""

FEWEST_PULSES = 3
"""Below this nothing but the usual rate and jitter says how far the line is off."""


@dataclass(frozen=True)
class ClockFit:
    """The line of every stretch, and what was seen of the pulses.

    steps_between_s : (K - 1, 2) last pulse before and first after every step, on the other clock. steps_s :
    (K - 1,) by how much the other clock was set ahead. jitter_s : 1-sigma of a single pulse. ambiguity_s :
    1-sigma of the shift by whole periods that pulses at regular intervals leave open. wander_s : 1-sigma of
    what a rate that changes bends the line. residual_s : rms of the pulses. clock_sd_s : largest 1-sigma
    error of a mapped time between the first and the last pulse. n_missing, n_extra : pulses that only the
    reference, only the other clock has while both ran.
    """

    lines: tuple[Line, ...]
    steps_between_s: Array
    steps_s: Array
    jitter_s: float
    ambiguity_s: float
    wander_s: float
    residual_s: float
    clock_sd_s: float
    n_pulses: int
    n_missing: int
    n_extra: int
    status: str
    message: str

    @property
    def scale_ppm(self) -> float:
        """Return how much faster the reference runs, in parts per million."""
        return self.lines[0].rate * 1e6

    @property
    def offset_s(self) -> float:
        """Time of the reference at the other clock's zero, on the line of the first stretch."""
        return float(self.lines[0](np.zeros(1))[0])

    def near_step(self, other_s: Array) -> npt.NDArray[np.bool_]:
        """Whether times (N,) lie between the two pulses about a step, so that either line may be theirs."""
        near = np.zeros(len(other_s), bool)
        for before, after in self.steps_between_s:
            near |= (other_s > before) & (other_s < after)
        return near

    def mapped(self, other_s: Array) -> tuple[Array, Array]:
        """Times of the reference clock (N,) and their 1-sigma error, for any times of the other clock.

        The error is that of the line and its bend, of the shift left open, and between the two pulses about a
        step also that of not knowing where it was; without the jitter of the event itself.
        """
        stretch = np.searchsorted(self.steps_between_s.mean(-1), other_s)
        time_s, sd_s = np.empty(len(other_s)), np.empty(len(other_s))
        for number, line in enumerate(self.lines):
            own = stretch == number
            time_s[own], sd_s[own] = line(other_s[own]), line.sd_s(other_s[own])
        variance = sd_s**2 + self.ambiguity_s**2 + self.wander_s**2
        for (before, after), step in zip(self.steps_between_s, self.steps_s, strict=True):
            variance[(other_s > before) & (other_s < after)] += step**2 / 4
        return time_s, np.sqrt(variance)


def ascending(time_s: Array) -> tuple[Array, Array]:
    """Give times in the order of their recording without steps back, and by how much each was put ahead.

    A step back is a clock that was set: what follows is put AHEAD_S after it, and `fit_clock` finds the step.
    Events that were written out of order by no more than jitter are left as they are.
    """
    back = np.diff(time_s, prepend=time_s[:1])
    ahead_s = np.cumsum(np.where(back < -1.5 * USUAL_JITTER_S, AHEAD_S - back, 0.0))
    return time_s + ahead_s, ahead_s


def fit_clock(reference_s: Array, other_s: Array, ahead_s: Array | None = None) -> ClockFit | str:
    """Match the pulses of two clocks and fit the lines; both ascending. Gives a sentence where nothing fits.

    Offsets may be of any size, rates differ by up to 600 ppm; pulses may be lost or added on either clock.
    ahead_s : by how much `ascending` has put each pulse of the other clock ahead; steps are without it.
    """
    if not len(reference_s) or not len(other_s):
        which = "the recording's clock" if not len(reference_s) else "the file"
        return f"no common pulse on {which}"
    within_s = tolerance_s(reference_s, other_s)
    stretches = match_pulses(reference_s, other_s, within_s)
    if not stretches or stretches[0].by_chance >= 1:
        return (
            f"the {len(other_s)} pulses of the file fit the {len(reference_s)} of the recording nowhere; "
            "are they the same pulses?"
        )
    stretches = _in_one(reference_s, other_s, stretches, within_s)
    stretches = _supported(reference_s, other_s, stretches, within_s)
    stretches, ambiguity_s = _best_shifts(reference_s, other_s, stretches, within_s)
    fit = _fitted(reference_s, other_s, _refined(reference_s, other_s, stretches, within_s))
    ahead_s = np.zeros(len(other_s)) if ahead_s is None else ahead_s
    before_s, after_s = ahead_s[np.searchsorted(other_s, fit.steps_between_s)].T
    fit = replace(fit, steps_s=fit.steps_s - (after_s - before_s))
    by_chance = max(stretch.by_chance for stretch in stretches)
    set_at_s = fit.steps_between_s[:, 0] - before_s
    status, message = _judgement(fit, set_at_s, ambiguity_s, by_chance)
    clock_sd_s = float(np.hypot(fit.clock_sd_s, ambiguity_s))
    return replace(fit, ambiguity_s=ambiguity_s, clock_sd_s=clock_sd_s, status=status, message=message)


def _best_shifts(
    r: Array, o: Array, stretches: list[Stretch], within_s: float
) -> tuple[list[Stretch], float]:
    """Shift each stretch to where its pulses fit best; give the 1-sigma of the shifts that are as good."""
    moved, open_s = [], 0.0
    for number, stretch in enumerate(stretches):
        before = stretches[number - 1] if number else None
        after = stretches[number + 1] if number + 1 < len(stretches) else None
        first, start = (0, 0) if before is None else (before.reference[-1] + 1, before.other[-1] + 1)
        last, end = (len(r), len(o)) if after is None else (after.reference[0], after.other[0])
        expected_s = Line.through(o[stretch.other], r[stretch.reference])(o[start:end])
        shift_s, own_open_s = best_shift(r[first:last], expected_s, within_s)
        if abs(shift_s) > within_s:
            i, j = nearest_pairs(r[first:last], expected_s + shift_s, within_s)
            stretch = Stretch(first + i, start + j, stretch.by_chance)
        moved.append(stretch)
        open_s = max(open_s, own_open_s)
    return moved, open_s


def _in_one(r: Array, o: Array, stretches: list[Stretch], within_s: float) -> list[Stretch]:
    """Put one stretch in the place of several where, shifted by whole periods, it alone is right or has
    nearly all.
    """
    if len(stretches) == 1:
        return stretches
    longest = max(stretches, key=lambda stretch: len(stretch.other))
    expected_s = Line.through(o[longest.other], r[longest.reference])(o)
    shift_s, open_s = best_shift(r, expected_s, within_s)
    i, j = nearest_pairs(r, expected_s + shift_s, within_s)
    is_right = abs(shift_s) > within_s and not open_s
    has_all = open_s > 0 and len(j) >= NEARLY * sum(len(stretch.other) for stretch in stretches)
    return [Stretch(i, j, longest.by_chance)] if is_right or has_all else stretches


def _supported(r: Array, o: Array, stretches: list[Stretch], within_s: float) -> list[Stretch]:
    """Leave out stretches without which the line before or after, of all pulses, has nearly as many.

    So are those that only keep to the beat: a step of whole periods cannot be told from lost pulses.
    """
    kept = list(stretches)
    for own in sorted(stretches, key=lambda stretch: len(stretch.other)):
        place = kept.index(own)
        first = kept[place - 1].other[-1] + 1 if place else 0
        end = kept[place + 1].other[0] if place + 1 < len(kept) else len(o)
        hits = _keeps(r, o, own, within_s)[first:end]
        before, after = (
            _keeps(r, o, kept[near], within_s)[first:end] if 0 <= near < len(kept) else None
            for near in (place - 1, place + 1)
        )
        gained = [_gained(before, hits, before)] if before is not None else []
        gained += [_gained(hits, after, after)] if after is not None else []
        here = slice(own.other[0] - first, own.other[-1] + 1 - first)
        again = any(
            as_well(int(line[here].sum()), len(own.other), r, within_s)
            for line in (before, after)
            if line is not None
        )
        if again or min(gained, default=FEWEST_GAINED) < FEWEST_GAINED:
            kept.remove(own)
    return kept


def _keeps(r: Array, o: Array, stretch: Stretch, within_s: float) -> npt.NDArray[np.bool_]:
    """Tell whether pulses (N,) of the other clock keep to the line of a stretch."""
    expected_s = Line.through(o[stretch.other], r[stretch.reference])(o)
    return np.abs(r[nearest(r, expected_s)] - expected_s) <= within_s


def _gained(first: npt.NDArray[np.bool_], then: npt.NDArray[np.bool_], alone: npt.NDArray[np.bool_]) -> int:
    """By how many more pulses (N,) keep to one line and, after a step, to another than to one alone."""
    up_to = np.concatenate([[0], np.cumsum(first)])
    left = then.sum() - np.concatenate([[0], np.cumsum(then)])
    return int((up_to + left).max() - alone.sum())


@dataclass(frozen=True)
class _Pairs:
    """Matched pulses x (other clock) and y = reference - other, (M,), and the stretch of each, from 0."""

    x: Array
    y: Array
    stretch: Integers

    def lines(self, sd_s: float) -> tuple[Line, ...]:
        """The line of each stretch, with one rate."""
        groups = [(self.x[own], self.y[own]) for own in self._groups()]
        weight = sum(float(((x - x.mean()) ** 2).sum()) for x, _ in groups) + sd_s**2 / RATE_SD**2
        rate = sum(float((x - x.mean()) @ (y - y.mean())) for x, y in groups) / weight
        return tuple(
            Line(float(x.mean()), float(y.mean()), rate, sd_s**2 / len(x), sd_s**2 / weight)
            for x, y in groups
        )

    def residuals_s(self, lines: Sequence[Line]) -> Array:
        """Return the pulses' distances from their lines."""
        parts = [
            self.y[own] + self.x[own] - line(self.x[own])
            for own, line in zip(self._groups(), lines, strict=True)
        ]
        return np.concatenate(parts)

    def _groups(self) -> list[slice]:
        ends = np.searchsorted(self.stretch, np.arange(self.stretch[-1] + 2))
        return [slice(first, end) for first, end in pairwise(ends.tolist())]

    def with_steps(self) -> _Pairs:
        """Take away steps that the pulses do not ask for, add those that they do."""
        pairs = self
        while (number := pairs._needless()) is not None:
            pairs = replace(pairs, stretch=pairs.stretch - (pairs.stretch > number))
        while (place := pairs._step()) is not None:
            later = np.arange(len(pairs.x)) >= place
            pairs = replace(pairs, stretch=pairs.stretch + later)
        return pairs

    def _needless(self) -> int | None:
        """A stretch that the next one continues; None where there is a step after each."""
        sd_s = _robust_sd_s(self)
        for number in range(int(self.stretch[-1])):
            joined = replace(self, stretch=self.stretch - (self.stretch > number))
            apart = [float((p.residuals_s(p.lines(sd_s)) ** 2).sum()) for p in (self, joined)]
            gain = (apart[1] - apart[0] + _pull(joined, sd_s) - _pull(self, sd_s)) / sd_s**2
            one, other = (line.offset + line.rate * (0 - line.at) for line in self.lines(sd_s)[number:][:2])
            if gain < STEP_GAIN + 2 * np.log(len(self.x)) or abs(one - other) < LEAST_STEP_S:
                return number
        return None

    def _step(self) -> int | None:
        """The pulse at which a new offset explains most, None where no step is to be believed."""
        sd_s = _robust_sd_s(self)
        lines = self.lines(sd_s)
        error = self.residuals_s(lines)
        weight = sd_s**2 / lines[0].rate_variance
        best, place = STEP_GAIN + 2 * np.log(len(self.x)), None
        for own, line in zip(self._groups(), lines, strict=True):
            n = own.stop - own.start
            if n < 2 * FEWEST_PULSES:
                continue
            earlier = np.arange(1, n)
            left = np.cumsum(self.x[own] - line.at)[:-1]
            free = earlier * (n - earlier) / n - left**2 / weight
            step = -np.cumsum(error[own])[:-1] / np.maximum(free, 1e-9)
            gain = np.where(np.abs(step) >= LEAST_STEP_S, step**2 * free / sd_s**2, 0.0)
            gain[: FEWEST_PULSES - 1] = gain[n - FEWEST_PULSES :] = 0.0
            at = int(np.argmax(gain))
            if gain[at] > best:
                best, place = float(gain[at]), own.start + at + 1
        return place


def _pull(pairs: _Pairs, sd_s: float) -> float:
    """Return the cost of a rate that is not 0, as a sum of squared residuals."""
    return float((pairs.lines(sd_s)[0].rate * sd_s / RATE_SD) ** 2)


def _robust_sd_s(pairs: _Pairs) -> float:
    """1-sigma of the pulses about their lines, from the median; never below what a tick of a clock is."""
    error = np.abs(pairs.residuals_s(pairs.lines(USUAL_JITTER_S)))
    usual = 1.4826 * float(np.median(error)) if len(error) > 2 * FEWEST_PULSES else USUAL_JITTER_S
    return max(usual, 1e-4)


def _refined(r: Array, o: Array, stretches: list[Stretch], within_s: float) -> _Pairs:
    """Fit the lines, match all pulses by them, and again."""
    i, j = (np.concatenate([getattr(s, name) for s in stretches]) for name in ("reference", "other"))
    pairs = _Pairs(o[j], r[i] - o[j], np.repeat(np.arange(len(stretches)), [len(s.other) for s in stretches]))
    for _ in range(3):
        pairs = pairs.with_steps()
        sd_s = _robust_sd_s(pairs)
        lines = pairs.lines(sd_s)
        stretch = _stretch_of_each(r, o, pairs, lines, within_s)
        expected_s = np.concatenate([line(o[stretch == number]) for number, line in enumerate(lines)])
        few = len(pairs.x) <= 2 * FEWEST_PULSES
        i, j = nearest_pairs(r, expected_s, within_s if few else min(within_s, max(5 * sd_s, 0.003)))
        _, own = np.unique(stretch[j], return_inverse=True)
        pairs = _Pairs(o[j], r[i] - o[j], own)
    return pairs


def _stretch_of_each(r: Array, o: Array, pairs: _Pairs, lines: Sequence[Line], within_s: float) -> Integers:
    """The stretch of every pulse of the other clock: each step where the most pulses keep to a line."""
    stretch = np.zeros(len(o), np.int64)
    keeps = []
    for line in lines:
        expected_s = line(o)
        keeps.append(np.abs(r[nearest(r, expected_s)] - expected_s) <= within_s)
    for number in range(1, len(lines)):
        own = [pairs.x[pairs.stretch == side] for side in (number - 1, number)]
        first, end = np.searchsorted(o, [np.median(own[0]), np.median(own[1])])
        gained = np.cumsum(keeps[number - 1][first:end].astype(int) - keeps[number][first:end])
        last_of_first = np.searchsorted(o, own[0][-1]) - first  # kept where both lines fit as well
        best = np.flatnonzero(gained == gained.max())
        place = best[np.argmin(np.abs(best - last_of_first))]
        stretch[first + place + 1 :] = number
    return stretch


def _fitted(r: Array, o: Array, pairs: _Pairs) -> ClockFit:
    """The fit, yet to be judged."""
    error = pairs.residuals_s(pairs.lines(_robust_sd_s(pairs)))
    sd_s = _stated_sd_s(error, int(pairs.stretch[-1]) + 2)
    lines = pairs.lines(sd_s)
    ends = np.flatnonzero(np.diff(pairs.stretch))
    steps = [  # between the two lines, on the other clock
        (a.offset - b.offset + a.rate * (b.at - a.at)) / (1 + a.rate) for a, b in pairwise(lines)
    ]
    fit = ClockFit(
        lines, np.stack([pairs.x[ends], pairs.x[ends + 1]], -1), np.array(steps), sd_s, 0.0, _wander_s(error),
        float(np.sqrt(np.mean(error**2))), 0.0, len(error), 0, 0, "", "",
    )  # fmt: skip
    ends_s = np.concatenate([pairs.x[pairs.stretch == number][[0, -1]] for number in range(len(lines))])
    own_s, margin_s = fit.mapped(o)[0], 5 * sd_s
    begin_s, end_s = max(r[0], own_s[0]) - margin_s, min(r[-1], own_s[-1]) + margin_s
    n_missing, n_extra = (
        max(0, int(((times >= begin_s) & (times <= end_s)).sum()) - len(error)) for times in (r, own_s)
    )
    clock_sd_s = float(fit.mapped(ends_s)[1].max())
    return replace(fit, clock_sd_s=clock_sd_s, n_missing=n_missing, n_extra=n_extra)


def _stated_sd_s(error: Array, n_unknown: int) -> float:
    """1-sigma of a pulse, widened so that 1.96 of it hold 95 % where it is known from a few pulses only."""
    from scipy.stats import t

    free = len(error) - n_unknown
    if free < 1:
        return USUAL_JITTER_S
    return float(np.sqrt((error**2).sum() / free) * t.ppf(0.975, free) / 1.96)


def _wander_s(error: Array) -> float:
    """1-sigma of what many pulses in turn have in common, as of a changing rate; 0 if chance may be it."""
    from scipy.stats import chi2

    most = 0.0
    for n_blocks in WANDER_BLOCKS:
        size = len(error) // n_blocks
        if size < WANDER_BLOCKS[0]:
            continue
        blocks = error[: size * n_blocks].reshape(n_blocks, size)
        of_means = float(blocks.var(-1, ddof=1).mean()) / size
        found = float(np.mean(blocks.mean(-1) ** 2))
        if found * n_blocks > of_means * chi2.isf(0.001 / len(WANDER_BLOCKS), n_blocks):
            most = max(most, found - of_means)
    return float(np.sqrt(most))


def _judgement(fit: ClockFit, set_at_s: Array, ambiguity_s: float, by_chance: float) -> tuple[str, str]:
    """Status and message."""
    steps = ", ".join(
        f"{step:+.3f} s after {at_s:.1f} s" for at_s, step in zip(set_at_s[:3], fit.steps_s, strict=False)
    )
    more = f" and {len(fit.steps_s) - 3} more" if len(fit.steps_s) > 3 else ""
    message = f"a clock was set or a recorder paused: {steps}{more}" if steps else ""
    if ambiguity_s > 0:
        return "weak", (
            "pulses at regular intervals can be laid over each other in several ways, whole periods apart "
            f"(1-sigma {ambiguity_s:.2f} s); give one more mark on both clocks, as a clap off the beat"
        )
    if by_chance > CHANCE:
        return "weak", f"{fit.n_pulses} pulses may fit so by chance; give more of them"
    if fit.n_pulses < FEWEST_PULSES:
        return "weak", (
            f"{fit.n_pulses} common pulse{'s'[: fit.n_pulses - 1]}: the rates of the clocks are taken to "
            f"differ by less than {2e6 * RATE_SD:.0f} ppm, which is {2 * RATE_SD * 60e3:.0f} ms in a minute"
        )
    if fit.n_pulses < (fit.n_pulses + min(fit.n_missing, fit.n_extra)) / 2:
        return "weak", "fewer than half of the pulses are common to both clocks; are they the same pulses?"
    return "ok", message
