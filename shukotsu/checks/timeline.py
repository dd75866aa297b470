"""Find what a recording does in time: flips to the other side, spikes, poses that stay, its clock."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.checks.mirror_jumps import own_sides
from shukotsu.skeleton.rotations import Array

Bools = npt.NDArray[np.bool_]

SPIKE_MM, SPIKE_DEG, SPIKE_TIMES = 60.0, 60.0, 8.0
STUCK_S, STUCK_FRAMES = 0.25, 20
MOVED_MM, ALL_ALONG = 5.0, 0.99
RATE_HZ, RATE_LOG_SD = 100.0, 1.1
SPEED_RAD_S, SPEED_LOG_SD = 1.5, 1.3
CLOCKS = (1e-3, 1e-6, 1e3, 1e6)
CLOCK_MARGIN = 8.0
JUMP_MM, JUMP_DEG = 5.0, 30.0


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


def sides(line: Timeline) -> Array:
    """Give the side of the transmitter on which each pose (T, S) is, by its receiver's jumps.

    1 where it mostly is, -1 on the other, 0 on the way; where a pose is not valid, the side of those before.
    """
    sign = np.ones(line.valid.shape)
    for place in range(line.valid.shape[1]):
        rows = np.flatnonzero(line.valid[:, place])
        found = own_sides(rows, line.time_s[rows], line.position_mm[rows, place])
        if found.changes:
            own = found.sign[found.piece_at(np.arange(len(sign)))]
            sign[:, place] = own if own[rows].sum() >= 0 else -own
    return sign


def away(sign: Array) -> npt.NDArray[np.int64]:
    """Count how often each receiver (S,) is on the other side, of sides (T, S): there and back is once."""
    other = np.concatenate([np.zeros((1, sign.shape[1])), sign]) < 0
    return np.asarray((np.diff(other.astype(int), axis=0) > 0).sum(0))


def spikes(line: Timeline) -> Bools:
    """Poses (T, S) that are far off while those one or two rows before and after agree with each other."""
    odd = np.zeros(line.valid.shape, bool)
    for place in range(line.valid.shape[1]):
        rows = np.flatnonzero(line.valid[:, place])
        for far in (1, 2):
            rows = rows[~odd[rows, place]]
            if len(rows) <= 2 * far:
                continue
            here = line.position_mm[rows, place]
            before, middle, after = here[: -2 * far], here[far:-far], here[2 * far :]
            off = np.linalg.norm(middle - (before + after) / 2, axis=-1)
            apart = np.linalg.norm(after - before, axis=-1)
            least = max(SPIKE_MM, SPIKE_TIMES * float(np.quantile(off, 0.9)))
            turn = line.quaternion[rows, place]
            away = _between_deg(turn[far:-far], turn[: -2 * far])
            around = _between_deg(turn[: -2 * far], turn[2 * far :])
            most = max(SPIKE_DEG, SPIKE_TIMES * float(np.quantile(away, 0.9)))
            found = ((off > least) & (apart < 0.5 * off)) | ((away > most) & (around < 0.3 * away))
            odd[rows[far:-far][found], place] = True
    return odd


def _between_deg(first: Array, second: Array) -> Array:
    cosine = np.abs((first * second).sum(-1))
    return np.asarray(np.degrees(2 * np.arccos(np.clip(cosine, 0, 1))))


def stuck(line: Timeline) -> Bools:
    """Poses (T, S) that stay the same to the last bit for long while another receiver moves.

    A receiver that never moves at all is none of these: it may be fixed to a bench.
    """
    interval = line.interval_s
    least = max(STUCK_FRAMES, int(STUCK_S / interval)) if interval > 0 else STUCK_FRAMES
    still = np.zeros(line.valid.shape, bool)
    same = _same_as_before(line) & line.valid[1:] & line.valid[:-1]
    for place in range(line.valid.shape[1]):
        if not same[:, place].any() or same[line.valid[1:, place], place].mean() > ALL_ALONG:
            continue
        edges = np.flatnonzero(np.diff(np.concatenate([[False], same[:, place], [False]]).astype(int)))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            if end - start >= least and _others_move(line, place, start, end):
                still[start : end + 1, place] = True
    return still


def _same_as_before(line: Timeline) -> Bools:
    """Say whether a pose (T - 1, S) is to the last bit that of the frame before."""
    arrays = (line.position_mm, line.quaternion)
    places, turns = ((array[1:] == array[:-1]).all(-1) for array in arrays)
    return np.asarray(places & turns)


def _others_move(line: Timeline, place: int, start: int, end: int) -> bool:
    rows = np.linspace(start, end, 8).astype(int)
    seen = line.valid[rows].all(0)
    seen[place] = False
    moved = np.ptp(line.position_mm[rows][:, seen], axis=0)
    return bool(seen.any() and moved.max() > MOVED_MM)


def zeros(line: Timeline) -> Bools:
    """Poses (T, S) at the transmitter's own place and not turned, to the last bit, of receivers with others.

    A receiver that is there all along may be what the others are measured against.
    """
    there = (line.position_mm == 0).all(-1) & (line.quaternion[..., 1:] == 0).all(-1) & line.valid
    return np.asarray(there & (line.valid & ~there).any(0))


def alike(line: Timeline) -> dict[tuple[int, int], npt.NDArray[np.int64]]:
    """Rows in which two receivers, of which one moves, have one pose to the last bit, by their places."""
    x = np.sort(np.where(line.valid, line.position_mm[..., 0], np.nan), axis=1)
    rows = np.flatnonzero((np.diff(x, axis=1) == 0).any(1))
    position, turn, valid = (array[rows] for array in (line.position_mm, line.quaternion, line.valid))
    found = {}
    for first, second in itertools.combinations(range(valid.shape[1]), 2):
        same = (position[:, first] == position[:, second]).all(-1) & valid[:, [first, second]].all(1)
        same &= (turn[:, first] == turn[:, second]).all(-1)
        if same.any() and (_moves(line, first) or _moves(line, second)):
            found[first, second] = rows[same]
    return found


def _moves(line: Timeline, place: int) -> bool:
    here = line.position_mm[line.valid[:, place], place]
    return bool((here != here[:1]).any())


def repeated_share(line: Timeline) -> float:
    """Share of frames in which every receiver stands as in the frame before."""
    same = (_same_as_before(line) | ~line.valid[1:]).all(-1) & line.valid[1:].any(-1)
    return float(same.mean()) if same.size else 0.0


def true_clock(line: Timeline) -> float | None:
    """Give the factor by which times are better seconds; None where they are right."""
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
    """Return how fast receivers turn when they are fast, rad/s: the 90th percentile, median over them.

    most_frames : from one to the next, over which turns are measured; beyond half a turn they fold back.
    """
    interval = line.interval_s
    stride = max(1, min(most_frames, len(line.valid) // 10))
    both = line.valid[stride:] & line.valid[:-stride]
    turned = np.radians(_between_deg(line.quaternion[stride:], line.quaternion[:-stride]))
    speeds = [np.quantile(turned[own, place], 0.9) for place, own in enumerate(both.T) if own.any()]
    return float(np.median(speeds) / (stride * interval)) if speeds else 0.0


def jumping_share(line: Timeline) -> float:
    """Share of receivers whose poses jump about in most frames, as no body moves."""
    jumping: Sequence[bool] = [_jumps(line, place) for place in range(line.valid.shape[1])]
    return float(np.mean(jumping)) if len(jumping) else 0.0


def _jumps(line: Timeline, place: int) -> bool:
    rows = np.flatnonzero(line.valid[:, place])
    if len(rows) < 5:
        return False
    here = line.position_mm[rows, place]
    bent = np.median(np.linalg.norm(here[2:] - 2 * here[1:-1] + here[:-2], axis=-1))
    spread = np.median(np.linalg.norm(here - np.median(here, axis=0), axis=-1))
    turned = np.median(_between_deg(line.quaternion[rows[1:], place], line.quaternion[rows[:-1], place]))
    return bool((bent > JUMP_MM and bent > spread) or turned > JUMP_DEG)
