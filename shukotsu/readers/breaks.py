"""Find where a recording breaks within itself: from a moment on, for good, a receiver is not where its
neighbours say.

A receiver that fell off hangs from its cable; a program changes the unit or an order in the middle of a file.
At that moment the distance to a neighbour leaps, or the receiver turns at once, as no joint lets it; and the
joint, which no centre closes over the whole recording, closes on one side. What slips on its bone moves by
less, and is left to the fit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shukotsu.hand.rotations import Array, matrix

Integers = npt.NDArray[np.int64]
ReceiverPoses = tuple[Integers, Array]
"""Frames (N,), ascending, and numbers (N, 7) of a receiver's usable poses."""
OPEN_MM, OPEN_SHARE = 4.0, 0.12
"""Gap of a joint from which on it is open, and its share of the distance between the joint's receivers."""
CLOSED = 0.35
"""Share of the gap over the whole recording that is left at most on the side that closes."""
LEAP_MM, LEAP_SHARE, LEAP_POSES, TURN_DEG = 15.0, 0.25, 12, 45.0
"""Change of a distance within so many poses, and its share; turn from one pose to the next."""
SAMPLED, MOMENTS, FEWEST = 400, 60, 8
"""Frames by which a joint is judged, moments that are tried, and frames that either side has."""
LEVER_MM, LEAST_GAP_MM = 200.0, 0.5
PUT_ON = 0.1
"""Share of a recording, at its beginning, in which a receiver may not have been put on yet."""
EVERY = 0.8
"""Share of the joints from which on all receivers break together: the file changes."""


@dataclass(frozen=True)
class Break:
    """Receivers of no use from `frame` on, or `until` it; grown : as the distance to neighbours does."""

    segments: tuple[str, ...]
    frame: int
    until: bool
    grown: float


def breaks(
    segments: Sequence[str], poses: Callable[[str], ReceiverPoses], links: Sequence[tuple[str, str]]
) -> list[Break]:
    """Find all breaks of a recording; links : parent and child of each joint between two of the segments."""
    broken = {link: joint for link in links if (joint := _broken_joint(poses(link[0]), poses(link[1]), link))}
    if len(broken) >= max(2, EVERY * len(links)):
        frames = [broken_joint.frame for broken_joint in broken.values()]
        if np.ptp(frames) <= LEAP_POSES:
            usual = broken[links[0]] if links[0] in broken else next(iter(broken.values()))
            grown = float(np.median([broken_joint.grown for broken_joint in broken.values()]))
            return [Break(tuple(segments), min(frames), usual.until, grown)]
    out: list[Break] = []
    parents = {child: parent for parent, child in links}
    while broken:
        ends = [name for broken_joint in broken.values() for name in broken_joint.segments]
        joints = {name: sum(name in link for link in links) for name in ends}
        # most of them, then the largest share of its own, then farther from the body
        culprit = max(joints, key=lambda name: (ends.count(name), -joints[name], ends[::-1].index(name)))
        of_culprit = [broken_joint for broken_joint in broken.values() if culprit in broken_joint.segments]
        first = min(of_culprit, key=lambda broken_joint: broken_joint.frame)
        grown = float(np.median([joint.grown for joint in of_culprit]))
        out.append(Break((culprit,), first.frame, first.until, grown))
        broken = {link: joint for link, joint in broken.items() if culprit not in link}
        above, off = parents.get(culprit, ""), {name for joint in out for name in joint.segments}
        while above in off:
            above = parents.get(above, "")
        for parent, child in links if above else ():  # which hangs on the culprit, and may be off as well
            if parent == culprit and (joint := _broken_joint(poses(above), poses(child), (above, child))):
                broken[above, child] = replace(joint, segments=(child,))
    return sorted(out, key=lambda broken_joint: broken_joint.frame)


def _broken_joint(above: ReceiverPoses, below: ReceiverPoses, link: tuple[str, str]) -> Break | None:
    """The break of a joint, with those of its receivers that can have caused it; None where it has none."""
    frame, rows, others = np.intersect1d(above[0], below[0], assume_unique=True, return_indices=True)
    if len(frame) < 2 * FEWEST:
        return None
    parent, child = above[1][rows], below[1][others]
    sampled = np.unique(np.linspace(0, len(frame) - 1, min(SAMPLED, len(frame))).astype(int))
    apart = parent[sampled, :3] - child[sampled, :3]
    turn = np.concatenate([-matrix(parent[sampled, 3:]), matrix(child[sampled, 3:])], -1)
    distance_mm = np.linalg.norm(child[:, :3] - parent[:, :3], axis=-1)
    centre = _centre(turn, apart)
    open_mm = max(OPEN_MM, OPEN_SHARE * float(np.median(distance_mm[sampled])))
    whole_mm = _rms(_gap_mm(turn, apart, centre))
    if whole_mm < open_mm:
        return None
    best, least = None, np.inf
    for row, turned in _moments(parent, child, distance_mm):
        split = int(np.searchsorted(sampled, row))
        if not FEWEST <= split <= len(sampled) - FEWEST:
            continue
        sides = slice(0, split), slice(split, None)
        centres = [_centre(turn[side], apart[side]) for side in sides]
        gaps_mm = [
            _rms(_gap_mm(turn[side], apart[side], middle))
            for side, middle in zip(sides, centres, strict=True)
        ]
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
    """Rows at which the distance leaps (None), or at which the parent (0) or the child (1) turns at once."""
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
        cosine = np.abs((numbers[1:, 3:] * numbers[:-1, 3:]).sum(-1)).clip(0.0, 1.0)
        rows = np.flatnonzero(2 * np.degrees(np.arccos(cosine)) > TURN_DEG)
        # what turns at once all along is written in another unit or order, and breaks nowhere
        for row in rows if len(rows) <= MOMENTS else ():
            yield int(row) + 1, end


def _centre(turn: Array, apart: Array) -> Array:
    """The joint's centre (6,) in both receivers, held near them where the motion leaves it open."""
    rows = turn.reshape(-1, 6)
    normal = rows.T @ rows + len(turn) / LEVER_MM**2 * np.eye(6)
    return np.asarray(np.linalg.solve(normal, rows.T @ apart.ravel()))


def _gap_mm(turn: Array, apart: Array, centre: Array) -> Array:
    return np.asarray(np.linalg.norm(turn @ centre - apart, axis=-1))


def _rms(gap_mm: Array) -> float:
    return float(np.sqrt((gap_mm**2).mean()))
