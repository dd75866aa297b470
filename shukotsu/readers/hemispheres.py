"""Decide on which side of the transmitter each receiver is, and so which positions are mirror images.

A magnetic tracker measures a position only up to its sign. A receiver's own positions show when it jumps to
the other side (`readers.jumps`), but not which side is right. Three kinds of evidence are combined over the
layout's tree: a joint centre fits both receivers for one combination of sides but not for the other, unless
one of them does not move; the centre is near both receivers and, in a hand, where anatomy expects it; and
most poses of a receiver are on the right side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from shukotsu.arrays import Array, Integers
from shukotsu.hand.average_hand import DIGITS
from shukotsu.hand.known_digits import known_digits
from shukotsu.hand.rotations import matrix, unit
from shukotsu.readers.breaks import Links, PosesOf, ReceiverPoses, solve_centre, solve_centres
from shukotsu.readers.jumps import OwnSides
from shukotsu.study.layout import Layout

LONGEST_LEVER_MM = 600.0
"""Distance of a joint's centre from its receivers beyond which it is implausible."""
SAMPLED, TRIED, FRAMES_A_TRIAL = 300, 80, 4
"""Frames used to judge a centre, number of random trials, and frames from which each trial is computed."""
LARGEST_GAP_MM, SKIN_MM = 30.0, 8.0
"""Median gap of a joint: the largest that is accepted, and the size that skin motion explains."""
CLOSING, NEARNESS, ANATOMY, SHARE, START = 12.0, 4.0, 3.0, 4.0, 0.6
"""Weights in log odds: the joint's gap, its centre's distance from the receivers, its expected position, the
majority of poses, and the first pose. Anatomy alone never outweighs a receiver that stays on one side."""
FEWEST_JOINTS = 3
"""Smallest number of joints from which anatomy may decide that a whole recording is on the wrong side."""
DECIDED = 1.0
"""Log odds above which the side of a receiver counts as decided."""
CERTAIN = 5.0
"""Log odds above which joints overrule the side that a receiver's own positions suggest."""


@dataclass(frozen=True)
class Sides:
    """A receiver's pieces with their most likely signs; decided : whether the evidence is sufficient."""

    pieces: OwnSides
    decided: bool

    def sign(self, frame: Integers) -> Integers:
        """Return -1 for mirrored frames, 0 in transit, else 1, (N,); no frame is mirrored if undecided."""
        sign = self.pieces.sign[self.pieces.piece_at(frame)]
        return sign if self.decided else np.abs(sign)


def expected_joints(layout: Layout) -> dict[str, Array]:
    """Return the expected position of each segment's proximal joint, (3,) mm in its receiver's frame."""
    expected_mm = {}
    for digit in known_digits(layout):
        for bone, name in enumerate(digit.segments):
            worn, mount = layout.segments[name], DIGITS[digit.name].mounts_mm()[bone]
            faces_known = digit.name != "thumb"  # the roll of a thumb's receivers about the bone is unknown
            side_mm = faces_known * mount[2] * np.array(worn.dorsal)
            expected_mm[name] = -mount[0] * np.array(worn.distal) - side_mm
    return expected_mm


def sides(
    receivers: Mapping[str, OwnSides],
    poses: PosesOf,
    parents: Mapping[str, str],
    expected_mm: Mapping[str, Array],
    *,
    all_along: bool = False,
) -> dict[str, Sides]:
    """Decide the sides of all receivers together.

    Parameters
    ----------
    receivers : mapping
        Pieces of each segment's recording, from its own positions.
    poses : callable
        Function from a segment to its valid poses.
    parents : mapping
        Proximal neighbour of each segment.
    expected_mm : mapping
        See `expected_joints`.
    all_along : bool
        Whether all receivers may be on the wrong side in all poses. Only anatomy can show that: all joints
        then lie opposite to their expected positions.

    Returns
    -------
    dict of str to Sides
        By segment.

    """
    links = [(parents[name], name) for name in receivers if parents.get(name, "") in receivers]
    settled = _settle(receivers, poses, links)
    tables = {}
    for parent, child in links:
        pair = _pair(settled[parent], poses(parent), settled[child], poses(child))
        tables[child] = _odds(pair, expected_mm.get(child))
    share = {}  # log likelihood (2,) of the signs and their opposites, from the majority and the first pose
    for name, receiver in settled.items():
        sign = receiver.sign[receiver.piece_at(poses(name)[0])]
        right = SHARE * sign.sum() / max(1, np.abs(sign).sum()) + START * sign[0]
        share[name] = np.array([right, -right])
    odds = _marginal(share, tables, parents)
    other = {name: int(odd < 0) for name, odd in odds.items()}
    judged = [child for child in tables if child in expected_mm]
    ends = [(tables[child], other[parents[child]], other[child]) for child in judged]
    for_it = sum(float(table[i, j] - table[1 - i, 1 - j]) for table, i, j in ends)
    if all_along and len(judged) >= FEWEST_JOINTS and for_it < -ANATOMY * len(judged):
        other = {name: 1 - side for name, side in other.items()}
    return {
        name: Sides(replace(receiver, sign=receiver.sign * (1 - 2 * other[name])), abs(odds[name]) >= DECIDED)
        for name, receiver in settled.items()
    }


def _marginal(
    share: Mapping[str, Array], tables: Mapping[str, Array], parents: Mapping[str, str]
) -> dict[str, float]:
    """Return the marginal log odds of each receiver's signs against their opposites (belief propagation).

    share : (2,) log likelihood of each receiver's signs and their opposites. tables : for each child, (2, 2)
    log likelihood by its parent's signs (as they are, opposite) and its own signs.
    """

    def depth(name: str) -> int:
        return 0 if name not in parents else 1 + depth(parents[name])

    log_marginal = {name: likely.copy() for name, likely in share.items()}
    order, up = sorted(tables, key=depth), {}
    for child in reversed(order):
        up[child] = np.logaddexp.reduce(tables[child] + log_marginal[child], axis=1)
        log_marginal[parents[child]] += up[child]
    for child in order:
        rest = log_marginal[parents[child]] - up[child]
        log_marginal[child] = log_marginal[child] + np.logaddexp.reduce(tables[child] + rest[:, None], axis=0)
    return {name: float(likely[0] - likely[1]) for name, likely in log_marginal.items()}


@dataclass(frozen=True)
class _Pair:
    """Simultaneous poses (N, 7) of two receivers, with their present signs applied, and their runs (N,)."""

    parent: Array
    child: Array
    parent_run: Integers
    child_run: Integers


def _pair(
    parent: OwnSides, above: ReceiverPoses, child: OwnSides, below: ReceiverPoses, sampled: int = SAMPLED
) -> _Pair:
    """Return both receivers at the child's frames; the parent is interpolated if they are not in step."""
    frames, positions, runs = [], [], []
    for sided_by, (frame, numbers) in ((parent, above), (child, below)):
        piece = sided_by.piece_at(frame)
        kept = sided_by.sign[piece] != 0
        sided = numbers[kept].copy()
        sided[:, :3] *= sided_by.sign[piece[kept], None]
        frames.append(frame[kept])
        positions.append(sided)
        runs.append(sided_by.run[piece[kept]])
    rows, left, right, share = _between(frames[0], frames[1])
    thinned = np.unique(np.linspace(0, len(rows) - 1, min(sampled, len(rows))).astype(int))
    rows, left, right, share = rows[thinned], left[thinned], right[thinned], share[thinned, None]
    before, after = positions[0][left], positions[0][right].copy()
    after[(before[:, 3:] * after[:, 3:]).sum(-1) < 0, 3:] *= -1
    between = (1 - share) * before + share * after
    between[:, 3:] = unit(between[:, 3:])
    near = np.where(share[:, 0] < 0.5, left, right)
    return _Pair(between, positions[1][rows], runs[0][near], runs[1][rows])


def _between(parent: Integers, child: Integers) -> tuple[Integers, Integers, Integers, Array]:
    """Return rows of the child between two rows of the parent, these two rows, and the fraction between."""
    if len(parent) < 2 or not len(child):
        empty = np.zeros(0, np.int64)
        return empty, empty, empty, np.zeros(0)
    right = np.clip(np.searchsorted(parent, child), 1, len(parent) - 1)
    apart, past = parent[right] - parent[right - 1], child - parent[right - 1]
    exact = (past == 0) | (past == apart)
    rows = np.flatnonzero(exact | ((past > 0) & (past < apart) & (apart <= 3 * np.median(np.diff(parent)))))
    return rows, right[rows] - 1, right[rows], past[rows] / apart[rows]


def _settle(receivers: Mapping[str, OwnSides], poses: PosesOf, links: Links) -> dict[str, OwnSides]:
    """Flip those runs of receivers that their joints contradict.

    Only receivers with several runs are changed: their own positions leave the runs' relative signs
    uncertain.
    """
    votes = {name: np.zeros(receiver.run[-1] + 1) for name, receiver in receivers.items()}
    for parent, child in links:
        unsure = [len(votes[name]) > 1 for name in (parent, child)]
        if not any(unsure):
            continue
        pair = _pair(receivers[parent], poses(parent), receivers[child], poses(child), 10**9)
        signs = np.array(list(product(*((1, -1) if several else (1,) for several in unsure))))
        link = _Link.of(pair, signs)
        centre = link.centre()
        if centre is None:
            continue
        cost = CLOSING / 8 * np.log1p(np.square(link.gaps_mm(centre) / SKIN_MM))
        for name, run, sign in ((parent, pair.parent_run, signs[:, 0]), (child, pair.child_run, signs[:, 1])):
            if len(votes[name]) > 1:
                odds = cost[:, sign < 0].min(1) - cost[:, sign > 0].min(1)
                vote = np.bincount(run, odds, len(votes[name]))
                agreed = (np.sign(vote) * np.bincount(run, minlength=len(vote))).sum()
                votes[name] += vote if agreed >= 0 else -vote
    turned = {name: votes[name][receiver.run] < -CERTAIN for name, receiver in receivers.items()}
    return {name: replace(r, sign=np.where(turned[name], -r.sign, r.sign)) for name, r in receivers.items()}


def _odds(pair: _Pair, expected_mm: Array | None) -> Array:
    """Return log likelihoods (2, 2) by the parent's and the child's signs, each as they are or opposite."""
    odds = np.zeros((2, 2))
    if len(pair.child) < FRAMES_A_TRIAL:
        return odds
    fits = [_Link.of(pair, np.array([(1, sign)])).fitted() for sign in (1, -1)]
    if min(gap_mm for _, gap_mm in fits) > LARGEST_GAP_MM:
        return odds
    for other, (centre, gap_mm) in enumerate(fits):
        levers_mm = np.linalg.norm(centre.reshape(2, 3), axis=-1)
        likely = -CLOSING * np.log1p((gap_mm / SKIN_MM) ** 2)
        likely -= NEARNESS * float((1 / (1 + (LONGEST_LEVER_MM / levers_mm.clip(1.0)) ** 4)).sum())
        near = 0.0
        if expected_mm is not None:
            near = ANATOMY * float(np.clip(centre[3:] @ expected_mm / (expected_mm @ expected_mm), -1, 1))
        odds[0, other], odds[1, 1 - other] = likely + near, likely - near
    return odds


@dataclass(frozen=True)
class _Link:
    """Equations of a joint's centre in N frames for C choices of signs.

    turn (N, 3, 6) @ centre (6,) = apart (N, C, 3), in mm.
    """

    turn: Array
    apart: Array

    @classmethod
    def of(cls, pair: _Pair, signs: Integers) -> _Link:
        """Build the equations; signs : (C, 2) choices of the signs of parent and child."""
        turn = np.concatenate([matrix(pair.parent[:, 3:]), -matrix(pair.child[:, 3:])], -1)
        parent, child = signs[:, :1] * pair.parent[:, None, :3], signs[:, 1:] * pair.child[:, None, :3]
        return cls(turn, child - parent)

    def gaps_mm(self, centre: Array) -> Array:
        """Return the gaps (N, C) of a centre (6,) by frame and choice of signs."""
        return np.asarray(np.linalg.norm((self.turn @ centre)[:, None] - self.apart, axis=-1))

    def fitted(self) -> tuple[Array, float]:
        """Return the centre for the first choice of signs, robust against large gaps, and its median gap."""
        weight = np.ones(len(self.turn))
        for _ in range(8):
            root = np.sqrt(weight)[:, None]
            centre = solve_centre(self.turn * root[..., None], self.apart[:, 0] * root)
            gap_mm = self.gaps_mm(centre)[:, 0]
            usual_mm = float(np.median(gap_mm))
            weight = 1 / (1 + np.square(gap_mm / max(2 * usual_mm, 1e-6)))
        return centre, usual_mm

    def centre(self) -> Array | None:
        """Return the centre with the smallest median gap for each frame's best signs; None if too large."""
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
        for _ in range(3):  # least squares over the frames that close about the previous centre
            gaps_mm = few.gaps_mm(best)
            rows, chosen = np.arange(len(gaps_mm)), gaps_mm.argmin(1)
            closes = gaps_mm[rows, chosen] < LARGEST_GAP_MM
            best = solve_centre(few.turn[closes], few.apart[rows, chosen][closes])
        return best

    def _trial(self, rows: Integers) -> Array:
        """Return centres (M, 6) that close in these frames, for all combinations of their signs."""
        choices = np.indices((self.apart.shape[1],) * len(rows)).reshape(len(rows), -1)
        apart = self.apart[rows[:, None], choices].swapaxes(0, 1).reshape(choices.shape[1], -1)
        turn = self.turn[rows].reshape(-1, 6)
        centres = solve_centres(turn, apart)
        gap_mm = np.sqrt(np.square(centres @ turn.T - apart).mean(1) * 3)
        near = np.linalg.norm(centres.reshape(-1, 2, 3), axis=-1).max(1) < LONGEST_LEVER_MM
        good = np.flatnonzero(near & (gap_mm < LARGEST_GAP_MM))
        return centres[good[np.argsort(gap_mm[good])[:8]]]
