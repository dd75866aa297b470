"""Which receivers were reported on the other side of the transmitter, and when.

A magnetic tracker knows a position only up to its sign. A jump to the mirror image shows in a receiver's own
poses (`trackers.decode.hemisphere`), but not which side of it is the right one, and a coarse file hides it. A
joint tells: its two receivers agree about its centre by millimetres on one choice of signs and by decimetres
on the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skeleton.rotations import matrix
from trackers.decode.hemisphere import Flip, FlipFinder, flip_states

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]

SLOWEST_JUMP_MM_S = 3000.0
"""A receiver that is carried past the transmitter comes to its mirror image, too, but not so fast."""

LEVER_MM = 200.0
"""Distance of a joint's centre from a receiver at which to be so far costs as much as 1 mm of gap."""

LONGEST_LEVER_MM = 600.0
SAMPLED, TRIED, FRAMES_A_TRIAL = 300, 80, 4
"""Frames by which a centre is judged, centres that are tried, and frames that each is computed from."""

LARGEST_GAP_MM = 30.0
"""Of a joint's receivers about its centre, skin and all, in most frames."""

SPREAD = 4.0
"""A gap that is so many times the usual one is of a frame in which a receiver is on its way."""


@dataclass(frozen=True)
class Sides:
    """Of a receiver's frames (N,): sign is -1 where the position is mirrored, 0 where it is on its way."""

    frame: Integers
    sign: Integers

    def without(self, jumping: Sides | None) -> Sides:
        """The same, unknown where `jumping` is on its way: its joint may close by chance."""
        if jumping is None:
            return self
        lost = np.isin(self.frame, jumping.frame[jumping.sign == 0])
        return Sides(self.frame, np.where(lost, 0, self.sign))


def jumps(
    frame: Integers, time_s: Array, numbers: Array, hemisphere: tuple[float, float, float] | None
) -> list[Flip]:
    """Where a receiver jumped to its mirror image, of its poses numbers (N, 7) mm in those frames.

    hemisphere : the vector of its half of space, None where it is not known: then only a jump that no hand
    makes is one.
    """
    finder = FlipFinder(0, hemisphere)
    finder.feed(frame, numbers[:, :3], numbers[:, 3:], final=True)
    if hemisphere is not None:
        return finder.flips
    return [flip for flip in finder.flips if not _carried(flip, frame, time_s, numbers)]


def _carried(flip: Flip, frame: Integers, time_s: Array, numbers: Array) -> bool:
    before, after = np.searchsorted(frame, [flip.before, flip.after])
    moved_mm = float(np.linalg.norm(numbers[after, :3] - numbers[before, :3]))
    return bool(moved_mm < SLOWEST_JUMP_MM_S * (time_s[after] - time_s[before]))  # False where times are NaN


def sides_by_jumps(flips: list[Flip], frame: Integers) -> Sides:
    """Sides of a receiver that no joint tells: on the right one at first, on the other after each jump."""
    transit, mirrored = flip_states(flips, frame)
    return Sides(frame, np.where(transit, 0, np.where(mirrored, -1, 1)))


def link_sides(
    parent: tuple[Integers, Array], child: tuple[Integers, Array], known: Sides | None
) -> tuple[Sides, Sides] | None:
    """Sides of two receivers that share a joint: in each frame the signs on which the joint closes.

    parent, child : frames (N,) and poses (N, 7) that are valid. known : the parent's sides, where another
    joint told them. None where no choice of signs closes the joint.
    """
    frame, at_parent, at_child = np.intersect1d(parent[0], child[0], return_indices=True)
    signs = _choices(frame, known)
    link = _Link.of(parent[1][at_parent], child[1][at_child], signs)
    centre = link.centre()
    if centre is None:
        return None
    gaps_mm = link.gaps_mm(centre)
    chosen = gaps_mm.argmin(1)
    rows = np.arange(len(frame))
    sign = signs[rows, chosen]
    if known is None and (sign < 0).sum() > sign.size / 2:  # all mirrored closes as well as none
        sign = -sign
    gap_mm = gaps_mm[rows, chosen]
    closes = gap_mm < max(LARGEST_GAP_MM, SPREAD * float(np.median(gap_mm)))
    return Sides(frame, np.where(closes, sign[:, 0], 0)), Sides(frame, np.where(closes, sign[:, 1], 0))


def _choices(frame: Integers, known: Sides | None) -> Integers:
    """Signs (N, C, 2) of parent and child to choose from in each frame."""
    both = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    if known is None:
        return np.broadcast_to(both, (len(frame), 4, 2))
    sign = np.ones(len(frame), np.int64)
    _, here, there = np.intersect1d(frame, known.frame, return_indices=True)
    sign[here] = np.where(known.sign[there] == 0, 1, known.sign[there])
    return np.stack([np.stack([sign, child * np.ones_like(sign)], -1) for child in (1, -1)], 1)


@dataclass(frozen=True)
class _Link:
    """Two receivers in the frames that they share: turn (N, 3, 6) centre = apart (N, C, 3) of some choice."""

    turn: Array
    apart: Array

    @classmethod
    def of(cls, parent: Array, child: Array, signs: Integers) -> _Link:
        """Give that of poses (N, 7) and signs (N, C, 2) to choose from."""
        turn = np.concatenate([matrix(parent[:, 3:]), -matrix(child[:, 3:])], -1)
        return cls(turn, signs[..., 1:] * child[:, None, :3] - signs[..., :1] * parent[:, None, :3])

    def gaps_mm(self, centre: Array) -> Array:
        """Gap (N, C) about a centre (6,) in either frame, by frame and choice of signs."""
        return np.asarray(np.linalg.norm((self.turn @ centre)[:, None] - self.apart, axis=-1))

    def centre(self) -> Array | None:
        """The centre about which most frames close on some choice of signs; None where few do."""
        count = len(self.turn)
        if count < FRAMES_A_TRIAL:
            return None
        rng = np.random.default_rng(0)
        sampled = np.unique(np.linspace(0, count - 1, SAMPLED).astype(int))
        few = _Link(self.turn[sampled], self.apart[sampled])
        best, best_mm = None, np.inf
        for _ in range(TRIED):
            for centre in few._trial(rng.choice(len(sampled), FRAMES_A_TRIAL, replace=False)):
                usual_mm = float(np.median(few.gaps_mm(centre).min(1)))
                if usual_mm < best_mm:
                    best, best_mm = centre, usual_mm
        if best is None or best_mm > LARGEST_GAP_MM:
            return None
        for _ in range(3):
            best = few._refined(best)
        return best

    def _trial(self, rows: Integers) -> Array:
        """Centres (M, 6) on which those frames close, of all their choices of signs."""
        choices = np.indices((self.apart.shape[1],) * len(rows)).reshape(len(rows), -1)
        apart = self.apart[rows[:, None], choices].swapaxes(0, 1).reshape(choices.shape[1], -1)
        turn = self.turn[rows].reshape(-1, 6)
        centres = _solved(turn, apart)
        gap_mm = np.sqrt(np.square(centres @ turn.T - apart).mean(1) * 3)
        near = np.linalg.norm(centres.reshape(-1, 2, 3), axis=-1).max(1) < LONGEST_LEVER_MM
        good = np.flatnonzero(near & (gap_mm < LARGEST_GAP_MM))
        return centres[good[np.argsort(gap_mm[good])[:8]]]

    def _refined(self, centre: Array) -> Array:
        """The least-squares centre of the frames that close about this one."""
        gaps_mm = self.gaps_mm(centre)
        rows, chosen = np.arange(len(gaps_mm)), gaps_mm.argmin(1)
        closes = gaps_mm[rows, chosen] < LARGEST_GAP_MM
        apart = self.apart[rows, chosen][closes].reshape(1, -1)
        return np.asarray(_solved(self.turn[closes].reshape(-1, 6), apart)[0])


def _solved(turn: Array, apart: Array) -> Array:
    """Least-squares centres (M, 6) of turn (3 N, 6) centre = apart (M, 3 N); see LEVER_MM."""
    normal = turn.T @ turn + len(turn) / 3 / LEVER_MM**2 * np.eye(6)
    return np.asarray(np.linalg.solve(normal, turn.T @ apart.T).T)
