"""Find jumps of a receiver: to its mirror image, or away and back within a few frames.

A magnetic tracker measures a position only up to its sign. No receiver can really move from p to near -p
between two frames; the tracker's filter may smear the jump over several frames, on a path through the
transmitter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.tables.device_clock import without_packets

FASTEST_MM_S, UNTIMED_STEP_MM = 3000.0, 20.0
"""Largest speed of a hand, and largest step per frame if the frame rate is unknown."""
LARGE_STEPS, MIRRORED, SMEARED = 3.0, 0.3, 0.6
"""A step longer than LARGE_STEPS times the 80th percentile is a leap. A step is a jump to the mirror image if
mirroring shortens it to less than MIRRORED of its length, or SMEARED of it if a filter spread the jump."""
SURE = 8.0
"""Log odds above which it is certain whether two consecutive poses are on the same side."""
SMEARED_FRAMES = 12
"""Largest number of frames before and after a jump over which the tracker's filter smears it."""
_BLOCK_ROWS = 1 << 15
"""Number of steps that are examined at a time."""


@dataclass(frozen=True)
class OwnSides:
    """A receiver's recording as M consecutive pieces, each on one side of the transmitter or in transit.

    first : (M,) first frame of each piece. sign : (M,) 1 or -1, up to a common sign; 0 in transit. run : (M,)
    pieces with the same number have certain relative signs.
    """

    first: Integers
    sign: Integers
    run: Integers

    @property
    def changes(self) -> bool:
        """Whether the receiver is on both sides at some time."""
        return bool((self.sign > 0).any() and (self.sign < 0).any())

    def piece_at(self, frame: Integers) -> Integers:
        """Return the index of the piece that contains each frame, (N,)."""
        return np.maximum(np.searchsorted(self.first, frame, side="right") - 1, 0)


def own_sides(frame: Integers, time_s: Array, position_mm: Array) -> OwnSides:
    """Split a receiver's recording at jumps to the mirror image.

    Parameters
    ----------
    frame : array, shape (N,)
        Frame numbers, increasing.
    time_s : array, shape (N,)
        Times, NaN if unknown.
    position_mm : array, shape (N, 3)
        Positions in the transmitter's frame.

    Returns
    -------
    OwnSides
        The pieces, with signs up to a common sign.

    """
    sign, run = np.ones(len(frame), np.int64), np.zeros(len(frame), np.int64)
    if len(frame) > 1:
        lasts, frame_s, seconds = np.diff(frame).astype(float), np.nan, np.diff(without_packets(time_s)[0])
        timed = seconds > 0  # False for NaN
        if timed.any():
            frame_s = float(np.median(seconds[timed] / lasts[timed]))
            lasts = np.maximum(lasts, np.where(timed, seconds, 0.0) / frame_s)
        parts = []  # step lengths, step lengths to the mirror image, scalar products, block by block
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
    """Return the distances of positions from others, and from the others' mirror images."""
    return np.linalg.norm(second - first, axis=-1), np.linalg.norm(second + first, axis=-1)


def _within_mm(reach_mm: float, lasts: Array) -> Array:
    """Return how far a receiver can move in `lasts` frames: over many frames no hand keeps its top speed."""
    return np.asarray(reach_mm * np.minimum(lasts, 2 * np.sqrt(lasts)))


def _leaps(leaping: Bools, position_mm: Array, usual_mm: float) -> list[tuple[int, int]]:
    """Return the rows of the last pose before and the first pose after each leap.

    leaping : (N - 1,) whether a step is too long for both the position and its mirror image.
    """
    leaps: list[tuple[int, int]] = []
    rows = np.flatnonzero(leaping)
    for part in np.split(rows, np.flatnonzero(np.diff(rows) > 3) + 1) if len(rows) else []:
        before, after = int(part[0]), int(part[-1]) + 1
        way = position_mm[after] - position_mm[before]
        way = way / max(float(np.linalg.norm(way)), 1e-9)

        def tail(row: int, way: Array = way) -> bool:  # a filtered step in the direction of the leap
            return bool((position_mm[row + 1] - position_mm[row]) @ way > usual_mm)

        earliest = max(before - SMEARED_FRAMES, leaps[-1][1] if leaps else 0)
        latest = min(after + SMEARED_FRAMES, len(leaping))
        while before > earliest and tail(before - 1):
            before -= 1
        while after < latest and not leaping[after] and tail(after):
            after += 1
        leaps.append((before, after))
    return leaps


LONGEST_FRAMES = 5
FAR_MM, FAR_DEG, SPIKE_STEPS = 100.0, 90.0, 4.0
"""A spike lasts at most LONGEST_FRAMES. Its poses differ from those before and after it by more than FAR_MM
or FAR_DEG, or in a coarse recording by more than SPIKE_STEPS times the 95th percentile of steps; the poses
before and after it agree within half of that plus as many large steps as there are frames between them."""


def spikes(numbers: Array) -> Bools:
    """Return which poses of a receiver (N, 7), mm and unit quaternions, are spikes, shape (N,)."""
    spiked = np.zeros(len(numbers), bool)
    if len(numbers) < 3:
        return spiked
    every = np.arange(len(numbers))
    steps = turned_and_apart(numbers[:-1], numbers[1:])
    large = np.percentile(steps, 95, axis=1)[:, None]
    far = np.maximum([[FAR_MM], [FAR_DEG]], SPIKE_STEPS * large)
    if not (steps > far).any():
        return spiked
    for length in range(1, min(LONGEST_FRAMES, len(numbers) - 2) + 1):
        before = every[: -length - 1]
        ends = numbers[before], numbers[before + length + 1]
        near = turned_and_apart(*ends) < far / 2 + (length + 1) * large
        agree = before[near.all(0)]
        away = np.ones(len(agree), bool)
        for inside in range(1, length + 1):
            for end in (agree, agree + length + 1):
                away &= (turned_and_apart(numbers[end], numbers[agree + inside]) > far).any(0)
        spiked[agree[away, None] + np.arange(1, length + 1)] = True
    return spiked


def turned_and_apart(first: Array, second: Array) -> Array:
    """Return the distances in mm and the angles in deg, (2, M), between two sets of poses (M, 7)."""
    cosine = np.abs(np.einsum("ij,ij->i", first[:, 3:], second[:, 3:])).clip(0.0, 1.0)
    moved_mm = np.linalg.norm(first[:, :3] - second[:, :3], axis=-1)
    return np.stack([moved_mm, 2 * np.degrees(np.arccos(cosine))])
