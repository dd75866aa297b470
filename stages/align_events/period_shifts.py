"""Other ways to lay the pulses of two clocks over each other: shifted by whole periods.

Pulses at regular intervals coincide at every such shift. Where losses on the two clocks have nothing to do
with each other, how many coincide says nothing, and nothing says that both recorders ran from the first pulse
to the last. A shift is refuted only by what both clocks have in common besides the beat: pulses off it, a
scatter of the beat itself, or beats that are missing on both far oftener than by chance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.stages.align_events.pulse_matching import CHANCE, Array, Integers, coincidences, nearest

Booleans = npt.NDArray[np.bool_]

SHIFTS = 200
"""So many pulses to either side are tried for another way to lay them over each other."""

_ANCHORS, _SOME, _MOST = 8, 64, 1024
"""Pulses of the reference that give shifts; pulses that sort them, and that judge what is left, at most."""

_TICK_S = 1e-4
"""A pulse that is nearer by less is as near."""

_NEARER = 2 / 3
"""Of another shift's median error, what the right one has at most: of stamps that are rounded it has all."""

_OFF_BEAT_CHANCE = 0.05
"""Coincidences of pulses off the beat, expected by chance at any shift, above which they decide nothing."""

_LONGEST = 8.5
"""In periods: a longer interval does not tell whether it is a whole number of them."""

_MOST_OFF_BEAT = 64
"""So many intervals off the beat are looked at: where there are more, there is hardly a beat."""


def best_shift(r: Array, expected_s: Array, within_s: float) -> tuple[float, float]:
    """Choose where the expected times of the other clock's pulses (N,) lie on the reference's (M,).

    Gives the shift, and the 1-sigma of those that fit about as well, 0 where there is none. Of shifts that
    cannot be told apart, the one that leaves the fewest pulses beyond the other clock's ends is taken.
    """
    laid = _Laid.of(r, expected_s, within_s)
    if len(laid.shift_s) == 1:
        return 0.0, 0.0
    beyond = np.array([_beyond(r, expected_s + shift, within_s) for shift in laid.shift_s])
    off_beat = _OffBeat.of(r, expected_s + laid.shift_s[:, None], within_s)
    share = laid.hit.sum(1) / laid.known.sum(1)
    candidates = {int(np.argmin(beyond)), int(np.argmin(laid.typical_s)), int(np.argmax(share))}
    candidates.add(int(np.argmax(off_beat.together(within_s))))
    found = []
    for own in sorted(candidates):
        left = ~(laid.refuted(own) | off_beat.refuted(own, 3 * 1.4826 * laid.typical_s[own], 1 - share[own]))
        left[own] = True
        found.append((int(left.sum()), int(beyond[own]), own, left))
    _, _, own, left = min(found, key=lambda one: one[:3])
    apart_s = laid.shift_s[left] - laid.shift_s[own]
    return float(laid.shift_s[own]), float(np.sqrt(np.mean(apart_s**2)))


def as_well(hits: int, own_hits: int, r: Array, within_s: float) -> bool:
    """Tell whether hits are nearer to those of the best line than to what chance gives."""
    by_chance = min(0.5, 2 * within_s / max(_period_s(r), within_s))
    return hits >= own_hits * (1 + by_chance) / 2


@dataclass(frozen=True)
class _Laid:
    """The pulses of the other clock, some of many (n,), at shifts (S,), the first about 0.

    error_s : (S, n) distance to the nearest of the reference, without its median. hit : whether it is within
    the tolerance. known : whether the reference ran then. typical_s : (S,) median size of a hit's error.
    """

    shift_s: Array
    error_s: Array
    hit: Booleans
    known: Booleans
    typical_s: Array

    @classmethod
    def of(cls, r: Array, expected_s: Array, within_s: float) -> _Laid:
        some = expected_s[:: -(-len(expected_s) // _SOME)]
        own_hits = coincidences(r, some, within_s)
        shift_s = np.array(
            [0.0]
            + [
                shift
                for shift in _shifts_s(r, within_s).tolist()
                if abs(shift) > 2 * within_s
                and as_well(coincidences(r, some + shift, within_s), own_hits, r, within_s)
            ]
        )
        thinned_s = expected_s[:: -(-len(expected_s) // _MOST)]
        for _ in range(2):  # a shift is as good as the two pulses that it is from; its median error is better
            at_s = thinned_s + shift_s[:, None]
            error_s = at_s - r[nearest(r, at_s.ravel())].reshape(at_s.shape)
            hit = np.abs(error_s) <= within_s
            off_s = np.nan_to_num(np.nanmedian(np.where(hit, error_s, np.nan), 1))
            shift_s = shift_s - off_s
        known = (at_s >= r[0] - within_s) & (at_s <= r[-1] + within_s)
        error_s = np.abs(error_s - off_s[:, None])
        typical_s = np.nanmedian(np.where(hit, error_s, np.nan), 1)
        return cls(shift_s, error_s, hit, known, typical_s)

    def refuted(self, own: int) -> Booleans:
        """Tell which shifts (S,) fit clearly worse than one of them: by their errors, or by their hits."""
        from scipy.special import logit
        from scipy.stats import binom

        n, both = len(self.shift_s), self.hit & self.hit[own]
        apart_s = np.where(both, self.error_s - self.error_s[own], 0.0)
        nearer, farther = (apart_s > _TICK_S).sum(1), (apart_s < -_TICK_S).sum(1)
        by_errors = n**2 * binom.cdf(farther, nearer + farther, 0.5) < CHANCE
        by_errors &= self.typical_s[own] < _NEARER * self.typical_s
        both = self.known & self.known[own]
        net = (self.hit[own].astype(int) - self.hit).sum(1, where=both)
        others = np.delete(np.arange(n), own)
        share, usual = (
            (self.hit[rows].sum() + 0.5) / (self.known[rows].sum() + 1) for rows in ([own], others)
        )
        by_hits = net * (logit(share) - logit(usual)) > 2 * np.log(n) - np.log(CHANCE)
        return np.asarray(by_errors | (by_hits & (share > usual)))


@dataclass(frozen=True)
class _OffBeat:
    """Intervals that are no whole number of periods, before and after a pulse between two beats, or of a beat
    that stopped and went on: start and end (2, K) on the reference, and (S, 2, K) of the other clock at every
    shift. of_pulse : whether it is of a pulse between beats, of either clock.
    """

    r_s: Array
    other_s: Array
    r_of_pulse: Booleans
    other_of_pulse: Booleans
    period_s: float

    @classmethod
    def of(cls, r: Array, at_s: Array, within_s: float) -> _OffBeat:
        period_s = _period_s(r)
        (own, alone), (other, other_alone) = (_off_beat(t, period_s, within_s) for t in (r, at_s[0]))
        both = np.stack([own, own + 1]), np.stack([other, other + 1])
        return cls(r[both[0]], at_s[:, both[1]], alone, other_alone, period_s)

    def together(self, within_s: float) -> Integers:
        """Count what coincides at each shift (S,): pulses between beats, and intervals with both ends."""
        near = np.abs(self.other_s[..., None] - self.r_s[:, None, :]) <= within_s
        pulses, intervals = self._pairs()
        count = (near[:, 1] & pulses).any(-1).sum(-1) + (near.all(1) & intervals).any(-1).sum(-1)
        return np.asarray(count)

    def _pairs(self) -> tuple[Booleans, Booleans]:
        """Tell which pairs (K, K') are two pulses between beats, and which two intervals."""
        pulses = self.other_of_pulse[:, None] & self.r_of_pulse
        return pulses, ~(self.other_of_pulse[:, None] | self.r_of_pulse)

    def refuted(self, own: int, within_s: float, lost: float) -> Booleans:
        """Tell which shifts (S,) lack coincidences that one of them has, and has not by chance.

        lost : share of pulses that one clock has lost. An interval whose first pulse one clock lacks is as
        long as one whose last the other lacks, a period away.
        """
        from scipy.stats import poisson

        within_s = max(within_s, 0.003)
        n, count = len(self.other_s), self.together(within_s)
        by_place = 2 * within_s / self.period_s
        pulses, intervals = (int(pairs.sum()) for pairs in self._pairs())
        expected = (pulses * by_place + intervals * (by_place + 2 * lost)) / n
        more = count[own] - count
        return np.asarray((more > 0) & (n * poisson.sf(more - 1, expected) < _OFF_BEAT_CHANCE))


def _period_s(time_s: Array) -> float:
    return float(np.median(np.diff(time_s))) if len(time_s) > 1 else np.inf


def _off_beat(time_s: Array, period_s: float, within_s: float) -> tuple[Integers, Booleans]:
    """Give intervals (K,) off the beat, and whether each ends with a pulse between two beats."""
    steps = np.diff(time_s) / period_s
    some = (steps > 0.5) & (steps < _LONGEST) & (np.abs(steps - np.round(steps)) * period_s < within_s)
    if some.any():  # the median's error adds up over a pause
        steps *= np.round(steps[some]).sum() / steps[some].sum()

    def is_off(steps: Array) -> Booleans:
        return np.asarray((np.abs(steps - np.round(steps)) * period_s > within_s) & (steps < _LONGEST))

    off = is_off(steps)
    alone = np.append(off[:-1] & off[1:] & ~is_off(steps[:-1] + steps[1:]), False)
    off[1:] &= ~alone[:-1]
    found = np.flatnonzero(off)[:_MOST_OFF_BEAT]
    return found, alone[found]


def _shifts_s(r: Array, within_s: float) -> Array:
    """Shifts (S,) that take a pulse of the reference to another; of several, as any may lack a neighbour."""
    few = range(0, len(r), -(-len(r) // _ANCHORS))
    apart = np.sort(np.concatenate([r[max(0, k - SHIFTS) : k + SHIFTS + 1] - r[k] for k in few]))
    alike = np.split(apart, np.flatnonzero(np.diff(apart) > within_s) + 1)
    return np.array([own.mean() for own in alike])


def _beyond(reference_s: Array, expected_s: Array, within_s: float) -> int:
    """Pulses of either clock before the other's first or after its last."""
    count = 0
    for one, other in ((reference_s, expected_s), (expected_s, reference_s)):
        count += int(((one < other[0] - within_s) | (one > other[-1] + within_s)).sum())
    return count
