"""Find faults of a recording in time: flips to the other side, spikes, constant poses, a wrong clock."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array, Bools, Index
from shukotsu.readers.jumps import own_sides

SPIKE_MM, SPIKE_DEG, SPIKE_TIMES = 60.0, 60.0, 8.0
"""Smallest spike, and smallest multiple of the 90th percentile of all deviations."""
STUCK_S, STUCK_FRAMES = 0.25, 20
"""Shortest run of identical poses that counts as stuck; the longer of both."""
MOVED_MM, ALL_ALONG = 5.0, 0.99
"""Smallest motion of another receiver meanwhile; share of identical poses above which runs are ignored."""
RATE_HZ, RATE_LOG_SD = 100.0, 1.1
"""Typical frame rate, and SD of its logarithm."""
SPEED_RAD_S, SPEED_LOG_SD = 1.5, 1.3
"""Typical turning speed, and SD of its logarithm."""
CLOCKS = (1e-3, 1e-6, 1e-9, 1e3, 1e6, 1e9)
"""Factors by which times may be wrong."""
CLOCK_MARGIN = 8.0
"""Log odds above which a factor is accepted."""
JUMP_MM, JUMP_DEG = 5.0, 30.0
"""Median second difference of positions, and median turn per frame, above which poses jump about."""

BLOCK_ROWS = 1 << 15
"""Number of rows processed at a time, which limits memory for long recordings."""


@dataclass(frozen=True)
class Timeline:
    """Poses of S receivers in T frames.

    time_s : (T,), NaN if unknown. position_mm : (T, S, 3). quaternion : (T, S, 4). valid : (T, S).
    """

    time_s: Array
    position_mm: Array
    quaternion: Array
    valid: Bools

    @property
    def interval_s(self) -> float:
        """Median time between frames, s; NaN if times are unknown."""
        steps = np.diff(self.time_s)
        steps = steps[np.isfinite(steps) & (steps > 0)]
        return float(np.median(steps)) if len(steps) else float("nan")

    @cached_property
    def same_as_before(self) -> Bools:
        """Whether each receiver's pose is bitwise equal to that of the previous frame, (S, T - 1)."""
        n_frames, n_receivers = self.valid.shape
        same = [_same_as_before(self, receiver) for receiver in range(n_receivers)]
        return np.array(same, bool).reshape(n_receivers, max(0, n_frames - 1))


def _windows(
    rows: Index, more: int, function: Callable[[Index | slice], npt.NDArray[Any]]
) -> npt.NDArray[Any]:
    """Apply a function to rows (N,) in overlapping blocks, to save memory; return results (..., N - more).

    more : number of rows by which a block overlaps the next one and by which results are shorter. Contiguous
    rows are passed as a slice, which makes no copy.
    """
    count = max(0, len(rows) - more)
    ends = [(s, min(s + BLOCK_ROWS, count) + more) for s in range(0, max(count, 1), BLOCK_ROWS)]
    blocks: list[Index | slice] = [rows[start:end] for start, end in ends]
    if len(rows) > more and rows[-1] - rows[0] == len(rows) - 1:
        blocks = [slice(int(rows[0]) + start, int(rows[0]) + end) for start, end in ends]
    return np.concatenate([function(block) for block in blocks], -1)


def sides(line: Timeline) -> npt.NDArray[np.int8]:
    """Return the side of the transmitter of each pose (T, S): 1 the usual one, -1 the other, 0 in transit.

    Invalid poses have the side of the previous pose.
    """
    sign = np.ones(line.valid.shape, np.int8)
    for receiver in range(line.valid.shape[1]):
        rows = np.flatnonzero(line.valid[:, receiver])
        pieces = own_sides(rows, line.time_s[rows], line.position_mm[rows, receiver])
        if pieces.changes:
            side = pieces.sign[pieces.piece_at(np.arange(len(sign)))]
            sign[:, receiver] = side if side[rows].sum() >= 0 else -side
    return sign


def away(sign: npt.NDArray[Any]) -> Index:
    """Return how often each receiver goes to the other side, (S,); sign : sides (T, S)."""
    other = sign < 0
    return np.asarray((other[1:] & ~other[:-1]).sum(0) + other[:1].sum(0))


def spikes(line: Timeline) -> Bools:
    """Return spikes (T, S): poses far from those one or two rows before and after, which agree."""
    odd = np.zeros(line.valid.shape, bool)
    for receiver in range(line.valid.shape[1]):
        rows = np.flatnonzero(line.valid[:, receiver])
        for far in (1, 2):
            rows = rows[~odd[rows, receiver]]
            if len(rows) <= 2 * far:
                continue

            def steps(part: Index | slice, receiver: int = receiver, far: int = far) -> Array:
                here, turn = line.position_mm[part, receiver], line.quaternion[part, receiver]
                before, middle, after = here[: -2 * far], here[far:-far], here[2 * far :]
                off, apart = middle - (before + after) / 2, after - before
                away = _between_deg(turn[far:-far], turn[: -2 * far])
                around = _between_deg(turn[: -2 * far], turn[2 * far :])
                off_mm, apart_mm = (np.linalg.norm(step_mm, axis=-1) for step_mm in (off, apart))
                return np.stack([off_mm, apart_mm, away, around])

            off, apart, away, around = _windows(rows, 2 * far, steps)
            least = max(SPIKE_MM, SPIKE_TIMES * float(np.quantile(off, 0.9)))
            most = max(SPIKE_DEG, SPIKE_TIMES * float(np.quantile(away, 0.9)))
            spiky = ((off > least) & (apart < 0.5 * off)) | ((away > most) & (around < 0.3 * away))
            odd[rows[far:-far][spiky], receiver] = True
    return odd


def _between_deg(first: Array, second: Array) -> Array:
    cosine = np.abs((first * second).sum(-1))
    return np.asarray(np.degrees(2 * np.arccos(np.clip(cosine, 0, 1))))


def stuck(line: Timeline) -> Bools:
    """Return poses (T, S) of runs that are bitwise constant while another receiver moves."""
    interval = line.interval_s
    least = max(STUCK_FRAMES, int(STUCK_S / interval)) if interval > 0 else STUCK_FRAMES
    still = np.zeros(line.valid.shape, bool)
    for receiver, valid in enumerate(line.valid.T):
        same = line.same_as_before[receiver] & valid[1:] & valid[:-1]
        if not same.any() or same[valid[1:]].mean() > ALL_ALONG:
            continue
        edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8)))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            if end - start < least:
                continue
            rows = np.linspace(start, end, 8).astype(int)
            seen = line.valid[rows].all(0)
            seen[receiver] = False
            moved_mm = np.ptp(line.position_mm[rows][:, seen], axis=0).max(initial=0.0)
            if moved_mm > MOVED_MM:
                still[start : end + 1, receiver] = True
    return still


def _same_as_before(line: Timeline, receiver: int) -> Bools:
    """Return whether a receiver's pose is bitwise equal to that of the previous frame, (T - 1,)."""

    def same(part: Index | slice) -> Bools:
        place, turn = line.position_mm[part, receiver], line.quaternion[part, receiver]
        return np.asarray((place[1:] == place[:-1]).all(-1) & (turn[1:] == turn[:-1]).all(-1))

    return _windows(np.arange(len(line.valid)), 1, same)


def zeros(line: Timeline) -> Bools:
    """Return poses (T, S) that are exactly the identity, of receivers that also have other poses."""
    empty = np.zeros(line.valid.shape, bool)
    for receiver, valid in enumerate(line.valid.T):

        def there(part: Index | slice, receiver: int = receiver) -> Bools:
            here, turn = line.position_mm[part, receiver], line.quaternion[part, receiver, 1:]
            return np.asarray((here == 0).all(-1) & (turn == 0).all(-1))

        at_zero = _windows(np.arange(len(valid)), 0, there) & valid
        if (valid & ~at_zero).any():
            empty[:, receiver] = at_zero
    return empty


def alike(line: Timeline) -> dict[tuple[int, int], Index]:
    """Return the rows in which two receivers have bitwise equal poses, by their indices.

    Pairs of receivers that never move are left out.
    """
    alike_rows: dict[tuple[int, int], list[Index]] = {
        pair: [] for pair in itertools.combinations(range(line.valid.shape[1]), 2)
    }
    for start in range(0, len(line.valid), BLOCK_ROWS):
        part = slice(start, start + BLOCK_ROWS)
        x = np.sort(np.where(line.valid[part], line.position_mm[part][..., 0], np.nan), axis=1)
        rows = start + np.flatnonzero((np.diff(x, axis=1) == 0).any(1))
        position, turn, valid = (array[rows] for array in (line.position_mm, line.quaternion, line.valid))
        for (first, second), blocks in alike_rows.items() if len(rows) else ():
            same = (position[:, first] == position[:, second]).all(-1) & valid[:, [first, second]].all(1)
            same &= (turn[:, first] == turn[:, second]).all(-1)
            blocks += [rows[same]] if same.any() else []
    pairs = {pair: np.concatenate(blocks) for pair, blocks in alike_rows.items() if blocks}
    moving = set()
    for receiver in {receiver for pair in pairs for receiver in pair}:
        rows = np.flatnonzero(line.valid[:, receiver])

        def moved(part: Index | slice, receiver: int = receiver, first: int = int(rows[0])) -> Bools:
            place_mm = line.position_mm[:, receiver]
            return np.asarray((place_mm[part] != place_mm[first]).any(-1))

        if _windows(rows, 0, moved).any():
            moving.add(receiver)
    return {pair: rows for pair, rows in pairs.items() if {*pair} & moving}


def repeated_share(line: Timeline) -> float:
    """Return the share of frames in which no receiver's pose differs from the previous frame's."""
    same = np.asarray(line.valid[1:].any(-1))
    for receiver, valid in enumerate(line.valid.T):
        same &= line.same_as_before[receiver] | ~valid[1:]
    return float(same.mean()) if same.size else 0.0


def true_clock(line: Timeline) -> float | None:
    """Return the factor that converts the times to plausible seconds; None if they are plausible already."""
    interval, speed = line.interval_s, turning_speed(line)
    if not (np.isfinite(interval) and speed > 0):
        return None

    def log_likelihood(factor: float) -> float:
        rate = np.log(1 / (factor * interval) / RATE_HZ) / RATE_LOG_SD
        turning = np.log(speed / factor / SPEED_RAD_S) / SPEED_LOG_SD
        return float(-0.5 * (rate**2 + turning**2))

    best = max(CLOCKS, key=log_likelihood)
    return best if log_likelihood(best) - log_likelihood(1.0) > CLOCK_MARGIN else None


def turning_speed(line: Timeline, most_frames: int = 12) -> float:
    """Return the receivers' median turning speed in rad/s; of each, the 90th percentile over some frames.

    most_frames : largest number of frames over which a turn is measured.
    """
    interval = line.interval_s
    stride = max(1, min(most_frames, len(line.valid) // 10))
    speeds = []
    for receiver, valid in enumerate(line.valid.T):
        both = valid[stride:] & valid[:-stride]
        if both.any():
            turned = np.radians(_turned_deg(line, receiver, np.arange(len(valid)), stride))
            speeds.append(np.quantile(turned[both], 0.9))
    return float(np.median(speeds) / (stride * interval)) if speeds else 0.0


def _turned_deg(line: Timeline, receiver: int, rows: Index, stride: int) -> Array:
    """Return the angles in deg between a receiver's poses `stride` rows apart, (N - stride,); rows : (N,)."""

    def turned(part: Index | slice) -> Array:
        quaternion = line.quaternion[part, receiver]
        return _between_deg(quaternion[stride:], quaternion[:-stride])

    return _windows(rows, stride, turned)


def jumps(line: Timeline, receiver: int) -> bool:
    """Return whether a receiver's poses jump about in most frames, unlike any body."""
    rows = np.flatnonzero(line.valid[:, receiver])
    if len(rows) < 5:
        return False
    middle = np.array([np.median(line.position_mm[rows, receiver, axis]) for axis in range(3)])

    def bends(part: Index | slice) -> Array:
        here = line.position_mm[part, receiver]
        return np.asarray(np.linalg.norm(here[2:] - 2 * here[1:-1] + here[:-2], axis=-1))

    def away_mm(part: Index | slice) -> Array:
        return np.asarray(np.linalg.norm(line.position_mm[part, receiver] - middle, axis=-1))

    bent, spread = np.median(_windows(rows, 2, bends)), np.median(_windows(rows, 0, away_mm))
    turned = np.median(_turned_deg(line, receiver, rows, 1))
    return bool((bent > JUMP_MM and bent > spread) or turned > JUMP_DEG)
