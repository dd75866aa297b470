"""On which side of the transmitter each receiver is, and when: which positions are mirror images.

A magnetic tracker knows a position only up to its sign. Where a receiver jumps to the other side its own
positions show (`readers.jumps`), but not which side is right. Three things tell, weighed together over
the layout's tree: a joint's two receivers agree about its centre on one pair of sides and not on the other,
unless one of them stands still; the centre lies near both, and of a hand where anatomy has it; and most
poses of a receiver are right.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.arrays import Array, Integers
from shukotsu.hand.average_hand import DIGITS
from shukotsu.hand.known_digits import known_digits
from shukotsu.hand.rotations import matrix, unit
from shukotsu.readers.jumps import OwnSides, solve_centres
from shukotsu.study.layout import Layout

LONGEST_LEVER_MM = 600.0
SAMPLED, TRIED, FRAMES_A_TRIAL = 300, 80, 4
"""Frames by which a centre is judged, centres that are tried, and frames that each is computed from."""
LARGEST_GAP_MM, SKIN_MM = 30.0, 8.0
"""Gaps of a joint's receivers about its centre in most frames: the largest, and one that tells nothing."""
CLOSING, NEARNESS, ANATOMY, SHARE, START = 12.0, 4.0, 3.0, 4.0, 0.6
"""Weights in log odds: a joint that closes, its centre's distance, its place by anatomy, the share of poses
that are right, and that the first is. Anatomy never outweighs receivers that stay on a side all along."""
FEWEST_JOINTS = 3
"""Fewest joints from which anatomy may decide that a whole recording is on the other side."""
DECIDED = 1.0
"""Log odds from which on the side of a receiver is taken as decided."""
CERTAIN = 5.0
"""Log odds from which on a joint overrules the side suggested by a receiver's own positions."""

Poses = tuple[Integers, Array]
"""Frames (N,) and numbers (N, 7) of a receiver's poses that are valid."""


@dataclass(frozen=True)
class Sides:
    """pieces : of the receiver's time, signs as they are best taken. decided : whether anything tells so."""

    pieces: OwnSides
    decided: bool

    def sign(self, frame: Integers) -> Integers:
        """Return 1, -1 where frames (N,) are mirrored, 0 on the way; where undecided no side is mirrored."""
        sign = self.pieces.sign[self.pieces.piece_at(frame)]
        return sign if self.decided else np.abs(sign)


def expected_joints(layout: Layout) -> dict[str, Array]:
    """Return the expected joint towards the body, (3,) mm in the receiver's frame, by segment of a hand."""
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
    poses: Callable[[str], Poses],
    parents: Mapping[str, str],
    expected_mm: Mapping[str, Array],
    *,
    all_along: bool = False,
) -> dict[str, Sides]:
    """Decide the sides of all receivers together.

    receivers : by segment, what its own positions tell. poses : gives a segment's poses. parents : of a
    segment the one towards the body. expected_mm : see `expected_joints`. all_along : whether all may be on
    the other side in all poses, of which anatomy alone tells: then joints lie opposite to where they are
    expected.
    """
    links = [(parents[name], name) for name in receivers if parents.get(name, "") in receivers]
    settled = _settle(receivers, poses, links)
    tables = {}
    for parent, child in links:
        pair = _pair(settled[parent], poses(parent), settled[child], poses(child))
        tables[child] = _odds(pair, expected_mm.get(child))
    share = {}  # log likelihood (2,) of the signs as they are and of their opposites, by what poses are right
    for name, receiver in settled.items():
        sign = receiver.sign[receiver.piece_at(poses(name)[0])]
        right = SHARE * sign.sum() / max(1, np.abs(sign).sum()) + START * sign[0]
        share[name] = np.array([right, -right])
    odds = _marginal(share, tables, parents)
    other = {name: int(odd < 0) for name, odd in odds.items()}
    judged = [
        (tables[child], other[parents[child]], other[child]) for child in tables if child in expected_mm
    ]
    for_it = sum(float(table[i, j] - table[1 - i, 1 - j]) for table, i, j in judged)
    if all_along and len(judged) >= FEWEST_JOINTS and for_it < -ANATOMY * len(judged):
        other = {name: 1 - side for name, side in other.items()}
    return {
        name: Sides(replace(receiver, sign=receiver.sign * (1 - 2 * other[name])), abs(odds[name]) >= DECIDED)
        for name, receiver in settled.items()
    }


def _marginal(
    share: Mapping[str, Array], tables: Mapping[str, Array], parents: Mapping[str, str]
) -> dict[str, float]:
    """Return log odds of each receiver's signs against their opposites, all others weighed over the tree.

    tables : of a child, (2, 2) log likelihood by its parent's signs (as they are, opposite) and its own.
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
    """Poses (N, 7) of two receivers at one time, put on one side each as best known, and their runs (N,)."""

    parent: Array
    child: Array
    parent_run: Integers
    child_run: Integers


def _pair(parent: OwnSides, above: Poses, child: OwnSides, below: Poses, sampled: int = SAMPLED) -> _Pair:
    """Return both receivers at the child's frames, the parent interpolated where they are not in step."""
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
    """Return rows of the child's frames that lie between two of the parent's, those, and how near each is."""
    if len(parent) < 2 or not len(child):
        empty = np.zeros(0, np.int64)
        return empty, empty, empty, np.zeros(0)
    right = np.clip(np.searchsorted(parent, child), 1, len(parent) - 1)
    apart, past = parent[right] - parent[right - 1], child - parent[right - 1]
    exact = (past == 0) | (past == apart)
    rows = np.flatnonzero(exact | ((past > 0) & (past < apart) & (apart <= 3 * np.median(np.diff(parent)))))
    return rows, right[rows] - 1, right[rows], past[rows] / apart[rows]


def _settle(
    receivers: Mapping[str, OwnSides], poses: Callable[[str], Poses], links: Sequence[tuple[str, str]]
) -> dict[str, OwnSides]:
    """Put runs of a receiver on one side by its joints, where its own positions let guess only."""
    votes = {name: np.zeros(receiver.run[-1] + 1) for name, receiver in receivers.items()}
    for parent, child in links:
        unsure = [len(votes[name]) > 1 for name in (parent, child)]
        if not any(unsure):
            continue
        pair = _pair(receivers[parent], poses(parent), receivers[child], poses(child), 10**9)
        signs = np.array([(x, y) for x in (1, -1)[: 1 + unsure[0]] for y in (1, -1)[: 1 + unsure[1]]])
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
    """Return log likelihoods (2, 2) by the parent's signs, as they are or opposite, and the child's."""
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
    """Two receivers in N frames: turn (N, 3, 6) centre = apart (N, C, 3) of some choice of C signs."""

    turn: Array
    apart: Array

    @classmethod
    def of(cls, pair: _Pair, signs: Integers) -> _Link:
        """Return that of signs (C, 2) of parent and child to choose from."""
        turn = np.concatenate([matrix(pair.parent[:, 3:]), -matrix(pair.child[:, 3:])], -1)
        parent, child = signs[:, :1] * pair.parent[:, None, :3], signs[:, 1:] * pair.child[:, None, :3]
        return cls(turn, child - parent)

    def gaps_mm(self, centre: Array) -> Array:
        """Return the gap (N, C) about a centre (6,) in either frame, by frame and choice of signs."""
        return np.asarray(np.linalg.norm((self.turn @ centre)[:, None] - self.apart, axis=-1))

    def fitted(self) -> tuple[Array, float]:
        """Return the centre on the first choice of signs, but of frames that do not close, and the gap."""
        weight = np.ones(len(self.turn))
        for _ in range(8):
            root = np.sqrt(weight)[:, None]
            turn, apart = self.turn * root[..., None], self.apart[:, 0] * root
            centre = solve_centres(turn.reshape(-1, 6), apart.reshape(1, -1))[0]
            gap_mm = self.gaps_mm(centre)[:, 0]
            usual_mm = float(np.median(gap_mm))
            weight = 1 / (1 + np.square(gap_mm / max(2 * usual_mm, 1e-6)))
        return centre, usual_mm

    def centre(self) -> Array | None:
        """Return the centre about which most frames close on some choice of signs; None where few do."""
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
        for _ in range(3):  # the least-squares centre of the frames that close about the last
            gaps_mm = few.gaps_mm(best)
            rows, chosen = np.arange(len(gaps_mm)), gaps_mm.argmin(1)
            closes = gaps_mm[rows, chosen] < LARGEST_GAP_MM
            apart = few.apart[rows, chosen][closes].reshape(1, -1)
            best = np.asarray(solve_centres(few.turn[closes].reshape(-1, 6), apart)[0])
        return best

    def _trial(self, rows: Integers) -> Array:
        """Return centres (M, 6) on which those frames close, of all their choices of signs."""
        choices = np.indices((self.apart.shape[1],) * len(rows)).reshape(len(rows), -1)
        apart = self.apart[rows[:, None], choices].swapaxes(0, 1).reshape(choices.shape[1], -1)
        turn = self.turn[rows].reshape(-1, 6)
        centres = solve_centres(turn, apart)
        gap_mm = np.sqrt(np.square(centres @ turn.T - apart).mean(1) * 3)
        near = np.linalg.norm(centres.reshape(-1, 2, 3), axis=-1).max(1) < LONGEST_LEVER_MM
        good = np.flatnonzero(near & (gap_mm < LARGEST_GAP_MM))
        return centres[good[np.argsort(gap_mm[good])[:8]]]
