"""Find what a recording does in time: flips to the other side, spikes, poses that stay, its clock."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.checks.mirror_jumps import own_sides
from shukotsu.skeleton.rotations import Array

Bools = npt.NDArray[np.bool_]
Rows = npt.NDArray[np.int64]

SPIKE_MM, SPIKE_DEG, SPIKE_TIMES = 60.0, 60.0, 8.0
STUCK_S, STUCK_FRAMES = 0.25, 20
MOVED_MM, ALL_ALONG = 5.0, 0.99
RATE_HZ, RATE_LOG_SD = 100.0, 1.1
SPEED_RAD_S, SPEED_LOG_SD = 1.5, 1.3
CLOCKS = (1e-3, 1e-6, 1e-9, 1e3, 1e6, 1e9)
CLOCK_MARGIN = 8.0
JUMP_MM, JUMP_DEG = 5.0, 30.0

BLOCK_ROWS = 1 << 15
"""Rows that are looked at at a time: of a long recording's numbers no more are in memory."""


@dataclass(frozen=True)
class Timeline:
    """time_s (T,), NaN where unknown; position_mm (T, S, 3); quaternion (T, S, 4); valid (T, S)."""

    time_s: Array
    position_mm: Array
    quaternion: Array
    valid: Bools

    @property
    def interval_s(self) -> float:
        """Median time between frames; NaN where times are not known."""
        steps = np.diff(self.time_s)
        steps = steps[np.isfinite(steps) & (steps > 0)]
        return float(np.median(steps)) if len(steps) else float("nan")


def _windows(rows: Rows, more: int, function: Callable[[Rows], npt.NDArray[Any]]) -> npt.NDArray[Any]:
    """Apply a function to rows (N,) some at a time, each time to `more` beyond; return (..., N - more)."""
    count = max(0, len(rows) - more)
    starts = range(0, max(count, 1), BLOCK_ROWS)
    parts = [function(rows[start : min(start + BLOCK_ROWS, count) + more]) for start in starts]
    return np.concatenate(parts, -1)


def sides(line: Timeline) -> npt.NDArray[np.int8]:
    """Side of the transmitter of each pose (T, S): 1 mostly, -1 the other, 0 on the way; else as before."""
    sign = np.ones(line.valid.shape, np.int8)
    for place in range(line.valid.shape[1]):
        rows = np.flatnonzero(line.valid[:, place])
        found = own_sides(rows, line.time_s[rows], line.position_mm[rows, place])
        if found.changes:
            own = found.sign[found.piece_at(np.arange(len(sign)))]
            sign[:, place] = own if own[rows].sum() >= 0 else -own
    return sign


def away(sign: npt.NDArray[Any]) -> Rows:
    """How often each receiver (S,) is on the other side, of sides (T, S): there and back is once."""
    other = sign < 0
    return np.asarray((other[1:] & ~other[:-1]).sum(0) + other[:1].sum(0))


def spikes(line: Timeline) -> Bools:
    """Poses (T, S) that are far off while those one or two rows before and after agree with each other."""
    odd = np.zeros(line.valid.shape, bool)
    for place in range(line.valid.shape[1]):
        rows = np.flatnonzero(line.valid[:, place])
        for far in (1, 2):
            rows = rows[~odd[rows, place]]
            if len(rows) <= 2 * far:
                continue

            def steps(part: Rows, place: int = place, far: int = far) -> Array:
                here, turn = line.position_mm[part, place], line.quaternion[part, place]
                before, middle, after = here[: -2 * far], here[far:-far], here[2 * far :]
                off, apart = middle - (before + after) / 2, after - before
                away = _between_deg(turn[far:-far], turn[: -2 * far])
                around = _between_deg(turn[: -2 * far], turn[2 * far :])
                return np.stack([*(np.linalg.norm(own, axis=-1) for own in (off, apart)), away, around])

            off, apart, away, around = _windows(rows, 2 * far, steps)
            least = max(SPIKE_MM, SPIKE_TIMES * float(np.quantile(off, 0.9)))
            most = max(SPIKE_DEG, SPIKE_TIMES * float(np.quantile(away, 0.9)))
            found = ((off > least) & (apart < 0.5 * off)) | ((away > most) & (around < 0.3 * away))
            odd[rows[far:-far][found], place] = True
    return odd


def _between_deg(first: Array, second: Array) -> Array:
    cosine = np.abs((first * second).sum(-1))
    return np.asarray(np.degrees(2 * np.arccos(np.clip(cosine, 0, 1))))


def stuck(line: Timeline) -> Bools:
    """Poses (T, S) that stay the same to the last bit for long while another receiver moves."""
    interval = line.interval_s
    least = max(STUCK_FRAMES, int(STUCK_S / interval)) if interval > 0 else STUCK_FRAMES
    still = np.zeros(line.valid.shape, bool)
    for place, valid in enumerate(line.valid.T):
        same = _same_as_before(line, place) & valid[1:] & valid[:-1]
        if not same.any() or same[valid[1:]].mean() > ALL_ALONG:
            continue
        edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8)))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            if end - start < least:
                continue
            rows = np.linspace(start, end, 8).astype(int)
            seen = line.valid[rows].all(0)
            seen[place] = False
            moved_mm = np.ptp(line.position_mm[rows][:, seen], axis=0).max(initial=0.0)
            if moved_mm > MOVED_MM:
                still[start : end + 1, place] = True
    return still


def _same_as_before(line: Timeline, place: int) -> Bools:
    """Whether a receiver's poses (T - 1,) are to the last bit those of the frame before."""

    def same(part: Rows) -> Bools:
        places, turns = (
            (own[1:] == own[:-1]).all(-1)
            for own in (line.position_mm[part, place], line.quaternion[part, place])
        )
        return np.asarray(places & turns)

    return _windows(np.arange(len(line.valid)), 1, same)


def zeros(line: Timeline) -> Bools:
    """Poses (T, S) at the transmitter's own place and not turned, to the last bit, if not all along."""
    empty = np.zeros(line.valid.shape, bool)
    for place, valid in enumerate(line.valid.T):

        def there(part: Rows, place: int = place) -> Bools:
            here, turn = line.position_mm[part, place], line.quaternion[part, place, 1:]
            return np.asarray((here == 0).all(-1) & (turn == 0).all(-1))

        own = _windows(np.arange(len(valid)), 0, there) & valid
        if (valid & ~own).any():
            empty[:, place] = own
    return empty


def alike(line: Timeline) -> dict[tuple[int, int], Rows]:
    """Rows in which two receivers, of which one moves, have one pose to the last bit, by their places."""
    found: dict[tuple[int, int], list[Rows]] = {
        pair: [] for pair in itertools.combinations(range(line.valid.shape[1]), 2)
    }
    for start in range(0, len(line.valid), BLOCK_ROWS):
        part = slice(start, start + BLOCK_ROWS)
        x = np.sort(np.where(line.valid[part], line.position_mm[part][..., 0], np.nan), axis=1)
        rows = start + np.flatnonzero((np.diff(x, axis=1) == 0).any(1))
        position, turn, valid = (array[rows] for array in (line.position_mm, line.quaternion, line.valid))
        for (first, second), own in found.items() if len(rows) else ():
            same = (position[:, first] == position[:, second]).all(-1) & valid[:, [first, second]].all(1)
            same &= (turn[:, first] == turn[:, second]).all(-1)
            own += [rows[same]] if same.any() else []
    pairs = {pair: np.concatenate(own) for pair, own in found.items() if own}
    moving = {place: _moves(line, place) for place in {place for pair in pairs for place in pair}}
    return {pair: rows for pair, rows in pairs.items() if moving[pair[0]] or moving[pair[1]]}


def _moves(line: Timeline, place: int) -> bool:
    rows = np.flatnonzero(line.valid[:, place])
    first = line.position_mm[rows[0], place]
    return bool(_windows(rows, 0, lambda part: (line.position_mm[part, place] != first).any(-1)).any())


def repeated_share(line: Timeline) -> float:
    """Share of frames in which every receiver stands as in the frame before."""
    same = np.asarray(line.valid[1:].any(-1))
    for place, valid in enumerate(line.valid.T):
        same &= _same_as_before(line, place) | ~valid[1:]
    return float(same.mean()) if same.size else 0.0


def true_clock(line: Timeline) -> float | None:
    """The factor by which times are better seconds; None where they are right."""
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
    """How fast receivers turn when fast, rad/s: the 90th percentile over so many frames, median over them."""
    interval = line.interval_s
    stride = max(1, min(most_frames, len(line.valid) // 10))
    speeds = []
    for place, valid in enumerate(line.valid.T):
        both = valid[stride:] & valid[:-stride]
        if both.any():
            turned = np.radians(_turned_deg(line, place, np.arange(len(valid)), stride))
            speeds.append(np.quantile(turned[both], 0.9))
    return float(np.median(speeds) / (stride * interval)) if speeds else 0.0


def _turned_deg(line: Timeline, place: int, rows: Rows, stride: int) -> Array:
    """Angles (N - stride,) between a receiver's poses in rows (N,), so many of them apart."""

    def turned(part: Rows) -> Array:
        own = line.quaternion[part, place]
        return _between_deg(own[stride:], own[:-stride])

    return _windows(rows, stride, turned)


def jumps(line: Timeline, place: int) -> bool:
    """Whether a receiver's poses jump about in most frames, as no body moves."""
    rows = np.flatnonzero(line.valid[:, place])
    if len(rows) < 5:
        return False
    middle = np.array([np.median(line.position_mm[rows, place, axis]) for axis in range(3)])

    def bends(part: Rows) -> Array:
        here = line.position_mm[part, place]
        return np.asarray(np.linalg.norm(here[2:] - 2 * here[1:-1] + here[:-2], axis=-1))

    def away_mm(part: Rows) -> Array:
        return np.asarray(np.linalg.norm(line.position_mm[part, place] - middle, axis=-1))

    bent, spread = np.median(_windows(rows, 2, bends)), np.median(_windows(rows, 0, away_mm))
    turned = np.median(_turned_deg(line, place, rows, 1))
    return bool((bent > JUMP_MM and bent > spread) or turned > JUMP_DEG)
