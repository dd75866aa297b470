"""Poses that jump away for some frames and come back: a tracker's error, not a motion."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]

LONGEST_FRAMES = 5
FAR_MM, FAR_DEG, USUAL_STEPS = 100.0, 90.0, 10.0
"""A spike is at most so long, and so far or so much turned away from the poses before and after it, which
agree to half of that; in a coarse recording so many times the usual step from frame to frame."""


def spikes(numbers: Array) -> Bools:
    """Say of a receiver's poses numbers (N, 7), in mm and unit quaternions, which are spikes, (N,)."""
    found = np.zeros(len(numbers), bool)
    if len(numbers) < 3:
        return found
    every = np.arange(len(numbers))
    steps_mm, steps_deg = _apart(numbers, every[:-1], every[1:])
    far_mm = max(FAR_MM, USUAL_STEPS * float(np.median(steps_mm)))
    far_deg = max(FAR_DEG, USUAL_STEPS * float(np.median(steps_deg)))
    if not ((steps_mm > far_mm) | (steps_deg > far_deg)).any():
        return found
    for length in range(1, min(LONGEST_FRAMES, len(numbers) - 2) + 1):
        before = every[: -length - 1]
        moved_mm, turned_deg = _apart(numbers, before, before + length + 1)
        agree = before[(moved_mm < far_mm / 2) & (turned_deg < far_deg / 2)]
        away = np.ones(len(agree), bool)
        for inside in range(1, length + 1):
            for end in (agree, agree + length + 1):
                moved_mm, turned_deg = _apart(numbers, end, agree + inside)
                away &= (moved_mm > far_mm) | (turned_deg > far_deg)
        found[agree[away, None] + np.arange(1, length + 1)] = True
    return found


def _apart(numbers: Array, one: Integers, other: Integers) -> tuple[Array, Array]:
    """Distances in mm and angles in deg between poses of those rows."""
    cosine = np.abs(np.einsum("ij,ij->i", numbers[one, 3:], numbers[other, 3:])).clip(0.0, 1.0)
    moved_mm = np.linalg.norm(numbers[one, :3] - numbers[other, :3], axis=-1)
    return moved_mm, 2 * np.degrees(np.arccos(cosine))
