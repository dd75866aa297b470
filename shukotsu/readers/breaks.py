"""Find breaks and exchanges of receivers by the joints between them.

From some frame on a receiver permanently contradicts its neighbours, or two receivers swap. Examples are a
receiver that fell off and hangs from its cable, or a program that changed the unit or an order within a file.
At that frame the distance to a neighbour leaps, or the receiver turns faster than any joint can; and a joint
centre fits the part before or after it, but not the whole recording. A receiver that only slips on its bone
moves less, and is left to the fit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from shukotsu.arrays import Array, Integers
from shukotsu.hand.rotations import matrix
from shukotsu.readers.jumps import turned_and_apart

ReceiverPoses = tuple[Integers, Array]
"""Frames (N,), ascending, and numbers (N, 7) of a receiver's usable poses."""
PosesOf = Callable[[str], ReceiverPoses]
"""Function from a segment to its poses."""
Links = Sequence[tuple[str, str]]
"""Parent and child of each joint between two segments."""
OPEN_MM, OPEN_SHARE = 4.0, 0.12
"""Smallest gap of an open joint, in mm and as a share of its receivers' distance; both must be exceeded."""
CLOSED = 0.35
"""Largest gap in the part where the joint still closes, as a share of the gap over the whole recording."""
LEAP_MM, LEAP_SHARE, LEAP_POSES, TURN_DEG = 15.0, 0.25, 12, 45.0
"""Smallest leap of a distance within LEAP_POSES poses, in mm and as its share; smallest turn in one step."""
SAMPLED, MOMENTS, FEWEST = 400, 60, 8
"""Frames used to judge a joint, most moments that are tried, and fewest frames before and after a break."""
LEVER_MM, LEAST_GAP_MM = 200.0, 0.5
"""Distance of a joint's centre from a receiver that costs as much as a gap of 1 mm; gaps below LEAST_GAP_MM
are treated as equal to it."""
PUT_ON = 0.1
"""Share of a recording, from its beginning, in which a receiver may not have been put on yet."""
EVERY = 0.8
"""Share of broken joints above which the file itself changed, so that all receivers break."""


TELLING = 1.0
"""Log ratio of joint gaps above which the gaps decide which of two receivers is which."""
EXCHANGED, EXCHANGE_MM, EXCHANGE_DEG = 0.4, 5.0, 60.0
"""Conditions of an exchange: largest ratio of the steps with names swapped to the steps as named; smallest
deviation of a pose from constant velocity; largest turn in one step with names swapped."""


@dataclass(frozen=True)
class Exchange:
    """Two receivers with swapped names in the frames `first` to `last`; frame : where the swap happens."""

    segments: tuple[str, str]
    first: int
    last: int
    frame: int


def exchanges(segments: Sequence[str], poses: PosesOf, links: Links) -> list[Exchange]:
    """Find pairs of receivers that exchange their names within a recording, from one pose to the next.

    Of the two assignments the correct one is that in which the joints close better over the whole recording;
    if the gaps do not decide, that in which neighbouring receivers are closer.

    Parameters
    ----------
    segments : sequence of str
        Segments with poses.
    poses : callable
        Function from a segment to its frames (N,) and poses (N, 7).
    links : sequence of (str, str)
        Parent and child of each joint between two of the segments.

    Returns
    -------
    list of Exchange
        Runs of frames with swapped names.

    """
    steps = {name: _long_steps(*poses(name)) for name in segments}
    out = []
    for pair in combinations(segments, 2):
        moments = _changes_of_places(steps[pair[0]], steps[pair[1]])
        if not len(moments):
            continue
        frame = np.union1d(*(poses(name)[0] for name in pair))
        way = np.searchsorted(moments, frame, side="right") % 2
        wider = _wider(pair, moments, poses, links)
        wrong = way == (wider > 0 if wider else 2 * way.sum() < len(way))
        ends = np.flatnonzero(np.diff(wrong, prepend=False, append=False))
        for start, end in zip(ends[::2], ends[1::2] - 1, strict=True):
            changes = frame[start] if start else frame[end + 1]
            out.append(Exchange(pair, int(frame[start]), int(frame[end]), int(changes)))
    return out


_Steps = tuple[Integers, Array, Array]
"""A receiver's N long steps: frames (N, 2) before and after, poses (N, 7) extrapolated and measured after."""


def _long_steps(frame: Integers, numbers: Array) -> _Steps:
    expected = numbers[:-1].copy()
    on = np.diff(frame, 2) == 0
    expected[1:, :3] += np.where(on[:, None], np.diff(numbers[:-1, :3], axis=0), 0.0)
    off_mm = np.linalg.norm(numbers[1:, :3] - expected[:, :3], axis=-1)
    far_mm = max(EXCHANGE_MM, float(np.quantile(off_mm, 0.9)) if len(off_mm) else 0.0)
    rows = np.flatnonzero(off_mm >= far_mm)
    return np.stack([frame[rows], frame[rows + 1]], -1), expected[rows], numbers[rows + 1]


def _changes_of_places(first: _Steps, second: _Steps) -> Integers:
    """Return the frames (M,) from which on each of two receivers is where the other one was."""
    moments = [np.zeros(0, np.int64)]
    for side in (0, 1):  # match by the frame before and by that after: one of them may be missing in either
        frames = first[0][:, side], second[0][:, side]
        _, i, j = np.intersect1d(*frames, assume_unique=True, return_indices=True)
        (before, after), (before_2, after_2) = (first[1][i], first[2][i]), (second[1][j], second[2][j])
        starts, ends = np.stack([before, before_2]), np.stack([after, after_2])
        apart_mm = [(starts - there)[..., :3] for there in (ends, ends[::-1])]
        own_mm, crossed_mm = (np.linalg.norm(apart, axis=-1).sum(0) for apart in apart_mm)
        near = np.flatnonzero(crossed_mm < EXCHANGED * own_mm)
        if not len(near):
            continue
        pairs = zip(starts[:, near], ends[::-1, near], strict=True)
        turned_deg = [turned_and_apart(*pair)[1] for pair in pairs]
        changed = near[np.max(turned_deg, axis=0) < EXCHANGE_DEG]
        moments.append(np.minimum(first[0][i, 1], second[0][j, 1])[changed])
    return np.unique(np.concatenate(moments))


def _wider(pair: tuple[str, str], moments: Integers, poses: PosesOf, links: Links) -> float:
    """Return the log ratio of joint gaps, or else of receivers' distances, of assignment 1 to assignment 0.

    Assignment 0 keeps the names until the first exchange, assignment 1 swaps them there.
    """
    ratios = np.zeros(2)
    for link in links:
        if {*pair} & {*link}:
            named = [[_named(name, pair, poses, moments, way) for name in link] for way in (0, 1)]
            first, second = (_gap_and_length_mm(*ends) for ends in named)
            ratios += np.nan_to_num(np.log(second / first))
    return float(ratios[0] if abs(ratios[0]) > TELLING else ratios[1])


def _named(name: str, pair: Sequence[str], poses: PosesOf, moments: Integers, way: int) -> ReceiverPoses:
    """Return a receiver's poses under assignment `way` of an exchanged pair, see `_wider`."""
    if name not in pair:
        return poses(name)
    frames, numbers = [], []
    for part in pair:
        frame, every = poses(part)
        rows = np.searchsorted(moments, frame, side="right") % 2 == (way if part == name else 1 - way)
        frames.append(frame[rows])
        numbers.append(every[rows])
    order = np.argsort(np.concatenate(frames))
    return np.concatenate(frames)[order], np.concatenate(numbers)[order]


def _gap_and_length_mm(above: ReceiverPoses, below: ReceiverPoses) -> Array:
    """Return a joint's rms gap and its receivers' median distance in mm, (2,); NaN with too few frames."""
    both, rows, others = np.intersect1d(above[0], below[0], assume_unique=True, return_indices=True)
    if len(both) < FEWEST:
        return np.full(2, np.nan)
    sampled = np.linspace(0, len(both) - 1, min(SAMPLED, len(both))).astype(int)
    turn, apart = _turn_and_apart(above[1][rows[sampled]], below[1][others[sampled]])
    gap_mm = _rms_gap_mm(turn, apart, solve_centre(turn, apart))
    return np.maximum([gap_mm, np.median(np.linalg.norm(apart, axis=-1))], LEAST_GAP_MM)


def _turn_and_apart(parent: Array, child: Array) -> tuple[Array, Array]:
    """Return the equations, (M, 3, 6) and (M, 3), of a joint's centre from its receivers' poses (M, 7)."""
    turn = np.concatenate([-matrix(parent[:, 3:]), matrix(child[:, 3:])], -1)
    return turn, parent[:, :3] - child[:, :3]


@dataclass(frozen=True)
class Break:
    """Receivers that are unusable from `frame` on, or, if `until` is true, before it.

    grown : ratio of the distance to the neighbours after the break to that before.
    """

    segments: tuple[str, ...]
    frame: int
    until: bool
    grown: float


def breaks(segments: Sequence[str], poses: PosesOf, links: Links) -> list[Break]:
    """Find all breaks of a recording.

    Parameters
    ----------
    segments, poses, links
        As for `exchanges`.

    Returns
    -------
    list of Break
        In the order of their frames.

    """
    broken = {link: joint for link in links if (joint := _broken_joint(poses(link[0]), poses(link[1]), link))}
    every = [*broken.values()]
    frames = [joint.frame for joint in every]
    if len(every) >= max(2, EVERY * len(links)) and np.ptp(frames) <= LEAP_POSES:
        grown = float(np.median([joint.grown for joint in every]))
        return [Break(tuple(segments), min(frames), every[0].until, grown)]
    out: list[Break] = []
    parents = {child: parent for parent, child in links}
    while broken:
        ends = [name for joint in broken.values() for name in joint.segments]
        joints = {name: sum(name in link for link in links) for name in ends}
        # the receiver with most broken joints, then with the largest share of its joints broken, then the one
        # farther from the body
        culprit = max(joints, key=lambda name: (ends.count(name), -joints[name], ends[::-1].index(name)))
        of_culprit = [joint for joint in broken.values() if culprit in joint.segments]
        first = min(of_culprit, key=lambda joint: joint.frame)
        grown = float(np.median([joint.grown for joint in of_culprit]))
        out.append(Break((culprit,), first.frame, first.until, grown))
        broken = {link: joint for link, joint in broken.items() if culprit not in link}
        above, off = parents.get(culprit, ""), {name for joint in out for name in joint.segments}
        while above in off:
            above = parents.get(above, "")
        for parent, child in links if above else ():  # the culprit's children may be broken, too
            if parent == culprit and (joint := _broken_joint(poses(above), poses(child), (above, child))):
                broken[above, child] = replace(joint, segments=(child,))
    return sorted(out, key=lambda joint: joint.frame)


def _broken_joint(above: ReceiverPoses, below: ReceiverPoses, link: tuple[str, str]) -> Break | None:
    """Return the break of a joint, with the receivers that may have caused it; None if there is no break."""
    frame, rows, others = np.intersect1d(above[0], below[0], assume_unique=True, return_indices=True)
    if len(frame) < 2 * FEWEST:
        return None
    parent, child = above[1][rows], below[1][others]
    sampled = np.unique(np.linspace(0, len(frame) - 1, min(SAMPLED, len(frame))).astype(int))
    turn, apart = _turn_and_apart(parent[sampled], child[sampled])
    distance_mm = np.linalg.norm(child[:, :3] - parent[:, :3], axis=-1)
    open_mm = max(OPEN_MM, OPEN_SHARE * float(np.median(distance_mm[sampled])))
    whole_mm = _rms_gap_mm(turn, apart, solve_centre(turn, apart))
    if whole_mm < open_mm:
        return None
    best, least = None, np.inf
    for row, turned in _moments(parent, child, distance_mm):
        split = int(np.searchsorted(sampled, row))
        if not FEWEST <= split <= len(sampled) - FEWEST:
            continue
        sides = slice(0, split), slice(split, None)
        centres = [solve_centre(turn[side], apart[side]) for side in sides]
        gaps_mm = [_rms_gap_mm(turn[s], apart[s], middle) for s, middle in zip(sides, centres, strict=True)]
        sizes_mm = [float(np.median(distance_mm[sampled[side]])) for side in sides]
        shares = [gap / max(size, LEAST_GAP_MM) for gap, size in zip(gaps_mm, sizes_mm, strict=True)]
        until = split < PUT_ON * len(sampled) and shares[1] < CLOSED * shares[0]
        kept, left = (1, 0) if until else (0, 1)
        after_mm = float(np.median(_gap_mm(turn[sides[left]], apart[sides[left]], centres[kept])))
        lasts = after_mm > max(OPEN_MM, OPEN_SHARE * sizes_mm[kept]) and after_mm > gaps_mm[kept] / CLOSED
        counts = split, len(sampled) - split
        cost = float(np.log(np.maximum(gaps_mm, LEAST_GAP_MM)) @ counts)
        if gaps_mm[kept] <= CLOSED * whole_mm and lasts and cost < least:
            culprits = (link[turned],) if turned is not None else link
            grown = sizes_mm[1] / max(sizes_mm[0], 1e-9)
            best, least = Break(culprits, int(frame[row]), until, grown), cost
    return best


def _moments(parent: Array, child: Array, distance_mm: Array) -> Iterator[tuple[int, int | None]]:
    """Yield rows at which the distance leaps (None), or the parent (0) or the child (1) turns abruptly."""
    within = min(LEAP_POSES, len(distance_mm) - 1)
    step_mm = np.abs(distance_mm[within:] - distance_mm[:-within])
    before_mm, after_mm = distance_mm[:-within], distance_mm[within:]
    leaps = np.flatnonzero((step_mm > LEAP_MM) & (step_mm > LEAP_SHARE * np.minimum(before_mm, after_mm)))
    runs = np.split(leaps, np.flatnonzero(np.diff(leaps) > 1) + 1) if len(leaps) else []
    for run in runs[:MOMENTS]:
        window = distance_mm[run[0] : run[0] + within + 1]
        half_mm = np.abs(window[-1] - window[0]) / 2
        yield int(run[0] + np.argmax(np.abs(window - window[0]) >= half_mm)), None
    for end, numbers in enumerate((parent, child)):
        rows = np.flatnonzero(turned_and_apart(numbers[:-1], numbers[1:])[1] > TURN_DEG)
        # abrupt turns throughout the recording are due to a wrong unit or order, not to a break
        for row in rows if len(rows) <= MOMENTS else ():
            yield int(row) + 1, end


def solve_centres(turn: Array, apart: Array) -> Array:
    """Solve turn @ centre = apart for joint centres by least squares, regularised by LEVER_MM.

    The regularisation pulls the centre towards the receivers where the motion does not determine it.

    Parameters
    ----------
    turn : array, shape (3 N, 6)
        Rotations of both receivers in N frames.
    apart : array, shape (M, 3 N)
        Differences of their positions in mm, for M choices of signs.

    Returns
    -------
    array, shape (M, 6)
        Centre in both receivers' frames, mm.

    """
    normal = turn.T @ turn + len(turn) / 3 / LEVER_MM**2 * np.eye(6)
    return np.asarray(np.linalg.solve(normal, turn.T @ apart.T).T)


def solve_centre(turn: Array, apart: Array) -> Array:
    """Return one joint's centre, (6,) mm, from turn (N, 3, 6) and apart (N, 3), see `solve_centres`."""
    return np.asarray(solve_centres(turn.reshape(-1, 6), apart.reshape(1, -1))[0])


def _gap_mm(turn: Array, apart: Array, centre: Array) -> Array:
    return np.asarray(np.linalg.norm(turn @ centre - apart, axis=-1))


def _rms_gap_mm(turn: Array, apart: Array, centre: Array) -> float:
    return float(np.sqrt((_gap_mm(turn, apart, centre) ** 2).mean()))
