"""Where a receiver jumps to its mirror image, at whatever rate and through any filter, or away and back.

A magnetic tracker knows a position only up to its sign. From one frame to the next no receiver goes from p to
near -p; the tracker's filter smears that jump over some frames, through the transmitter, where none can be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.hand.rotations import Array

Integers = npt.NDArray[np.int64]

FASTEST_MM_S, UNTIMED_STEP_MM = 3000.0, 20.0
"""No hand is faster; in a frame of which the time is not known none goes farther."""
LARGE_STEPS, MIRRORED, SMEARED = 3.0, 0.3, 0.6
"""So many times a recording's large steps, the 80th percentile, are none of them; and of a jump to the mirror
image, at once or through a filter, less than so much is left when that image is taken."""
SURE = 8.0
"""Log of the odds from which on two neighbouring poses are known to be on the same side, or on two."""
SMEARED_FRAMES = 12
"""After a jump, and before it, the filter's tail takes at most so many more frames."""
_BLOCK_ROWS = 1 << 15
"""Steps that are looked at at a time."""


@dataclass(frozen=True)
class OwnSides:
    """Pieces of a receiver's time, M in order: on one side each, or on the way.

    first : (M,) frame in which each begins. sign : (M,) 1 or -1, up to one sign for all; 0 on the way. run :
    (M,) between pieces of a run it is sure which is on which side.
    """

    first: Integers
    sign: Integers
    run: Integers

    @property
    def changes(self) -> bool:
        """Whether it is on two sides."""
        return bool((self.sign > 0).any() and (self.sign < 0).any())

    def piece_at(self, frame: Integers) -> Integers:
        """The piece in which frames (N,) lie, (N,)."""
        return np.maximum(np.searchsorted(self.first, frame, side="right") - 1, 0)


def own_sides(frame: Integers, time_s: Array, position_mm: Array) -> OwnSides:
    """The sides of a receiver in frames (N,), rising, at times (N,), NaN where unknown, and places (N, 3)."""
    sign, run = np.ones(len(frame), np.int64), np.zeros(len(frame), np.int64)
    if len(frame) > 1:
        lasts, frame_s, seconds = np.diff(frame).astype(float), np.nan, np.diff(time_s)
        timed = seconds > 0  # False for NaN
        if timed.any():
            frame_s = float(np.median(seconds[timed] / lasts[timed]))
            lasts = np.maximum(lasts, np.where(timed, seconds, 0.0) / frame_s)
        parts = []  # lengths of steps, those to the mirror image, scalar products; a block at a time
        for start in range(0, len(position_mm) - 1, _BLOCK_ROWS):
            here = position_mm[start : start + _BLOCK_ROWS + 1]
            along_mm2 = np.einsum("ij,ij->i", here[1:], here[:-1])
            parts.append(np.stack([*_apart_mm(here[:-1], here[1:]), along_mm2]))
        step_mm, mirrored_mm, along_mm2 = np.concatenate(parts, 1)
        nearer_mm = np.minimum(step_mm, mirrored_mm)
        usual_mm = float(np.quantile(nearer_mm / lasts, 0.8))
        fastest_mm = UNTIMED_STEP_MM if np.isnan(frame_s) else FASTEST_MM_S * frame_s
        reach_mm = max(LARGE_STEPS * usual_mm, fastest_mm)
        within_mm = _within_mm(reach_mm, lasts)
        odds = 2 * along_mm2 / within_mm**2
        jumps = (step_mm > _within_mm(fastest_mm, lasts)) & (mirrored_mm < MIRRORED * step_mm)
        breaks, way = np.abs(odds) < SURE, np.zeros(len(frame), bool)
        for before, after in _leaps(nearer_mm > within_mm, position_mm, usual_mm):
            ends_mm = position_mm[[before]], position_mm[before + 1 : after + 1]
            stay_mm, image_mm = _apart_mm(*ends_mm)
            away = image_mm < SMEARED * stay_mm
            odd = 2 * float(ends_mm[0][0] @ ends_mm[1][-1])
            odd /= float(_within_mm(reach_mm, lasts[before:after].sum())) ** 2
            breaks[before:after], jumps[before:after] = False, False
            breaks[after - 1], jumps[after - 1] = abs(odd) < SURE, away[-1]
            way[before + 1 : after] = away[-1] | away[:-1]
        sign[1:], run[1:] = np.cumprod(np.where(jumps, -1, 1)), np.cumsum(breaks)
        sign[way] = 0
    new = np.flatnonzero((np.diff(sign, prepend=2) != 0) | (np.diff(run, prepend=0) != 0))
    return OwnSides(frame[new], sign[new], run[new])


def _apart_mm(first: Array, second: Array) -> tuple[Array, Array]:
    """Positions' distances from each other, and from each other's mirror image."""
    return np.linalg.norm(second - first, axis=-1), np.linalg.norm(second + first, axis=-1)


def _within_mm(reach_mm: float, lasts: Array) -> Array:
    """Return how far a receiver goes in so many frames: it does not keep its greatest speed."""
    return np.asarray(reach_mm * np.minimum(lasts, 2 * np.sqrt(lasts)))


def _leaps(leaping: npt.NDArray[np.bool_], position_mm: Array, usual_mm: float) -> list[tuple[int, int]]:
    """The last pose before and the first after each leap, of steps (N - 1,) that lead to no side."""
    leaps: list[tuple[int, int]] = []
    rows = np.flatnonzero(leaping)
    for part in np.split(rows, np.flatnonzero(np.diff(rows) > 3) + 1) if len(rows) else []:
        before, after = int(part[0]), int(part[-1]) + 1
        way = position_mm[after] - position_mm[before]
        way = way / max(float(np.linalg.norm(way)), 1e-9)

        def tail(row: int, way: Array = way) -> bool:  # still settling, or about to
            return bool((position_mm[row + 1] - position_mm[row]) @ way > usual_mm)

        earliest = max(before - SMEARED_FRAMES, leaps[-1][1] if leaps else 0)
        latest = min(after + SMEARED_FRAMES, len(leaping))
        while before > earliest and tail(before - 1):
            before -= 1
        while after < latest and not leaping[after] and tail(after):
            after += 1
        leaps.append((before, after))
    return leaps


Bools = npt.NDArray[np.bool_]

LONGEST_FRAMES = 5
FAR_MM, FAR_DEG, SPIKE_STEPS = 100.0, 90.0, 4.0
"""A spike is at most so long, and so far or so much turned away from the poses before and after it; in a
coarse recording so many times a large step, the 95th percentile. Those two agree to half of that and what
large steps come to between them."""


def spikes(numbers: Array) -> Bools:
    """Return which of a receiver's poses (N, 7), in mm and unit quaternions, are spikes, (N,)."""
    spiked = np.zeros(len(numbers), bool)
    if len(numbers) < 3:
        return spiked
    every = np.arange(len(numbers))
    steps = _turned_and_apart(numbers, every[:-1], every[1:])
    large = np.percentile(steps, 95, axis=1)[:, None]
    far = np.maximum([[FAR_MM], [FAR_DEG]], SPIKE_STEPS * large)
    if not (steps > far).any():
        return spiked
    for length in range(1, min(LONGEST_FRAMES, len(numbers) - 2) + 1):
        before = every[: -length - 1]
        near = _turned_and_apart(numbers, before, before + length + 1) < far / 2 + (length + 1) * large
        agree = before[near.all(0)]
        away = np.ones(len(agree), bool)
        for inside in range(1, length + 1):
            for end in (agree, agree + length + 1):
                away &= (_turned_and_apart(numbers, end, agree + inside) > far).any(0)
        spiked[agree[away, None] + np.arange(1, length + 1)] = True
    return spiked


def _turned_and_apart(numbers: Array, first: Integers, second: Integers) -> Array:
    """Return the distances (2, M), in mm and deg, of poses of those rows from each other."""
    cosine = np.abs(np.einsum("ij,ij->i", numbers[first, 3:], numbers[second, 3:])).clip(0.0, 1.0)
    moved_mm = np.linalg.norm(numbers[first, :3] - numbers[second, :3], axis=-1)
    return np.stack([moved_mm, 2 * np.degrees(np.arccos(cosine))])
