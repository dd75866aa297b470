"""Poses that jump away for some frames and come back: a tracker's error, not a motion."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]

LONGEST_FRAMES = 5
FAR_MM, FAR_DEG, LARGE_STEPS = 100.0, 90.0, 4.0
"""A spike is at most so long, and so far or so much turned away from the poses before and after it; in a
coarse recording so many times a large step, the 95th percentile. Those two agree to half of that and what
large steps come to between them."""


def spikes(numbers: Array) -> Bools:
    """Return which of a receiver's poses (N, 7), in mm and unit quaternions, are spikes, (N,)."""
    spiked = np.zeros(len(numbers), bool)
    if len(numbers) < 3:
        return spiked
    every = np.arange(len(numbers))
    steps = _apart(numbers, every[:-1], every[1:])
    large = np.percentile(steps, 95, axis=1)[:, None]
    far = np.maximum([[FAR_MM], [FAR_DEG]], LARGE_STEPS * large)
    if not (steps > far).any():
        return spiked
    for length in range(1, min(LONGEST_FRAMES, len(numbers) - 2) + 1):
        before = every[: -length - 1]
        near = _apart(numbers, before, before + length + 1) < far / 2 + (length + 1) * large
        agree = before[near.all(0)]
        away = np.ones(len(agree), bool)
        for inside in range(1, length + 1):
            for end in (agree, agree + length + 1):
                away &= (_apart(numbers, end, agree + inside) > far).any(0)
        spiked[agree[away, None] + np.arange(1, length + 1)] = True
    return spiked


def _apart(numbers: Array, one: Integers, other: Integers) -> Array:
    """Return the distances (2, M), in mm and deg, of poses of those rows from each other."""
    cosine = np.abs(np.einsum("ij,ij->i", numbers[one, 3:], numbers[other, 3:])).clip(0.0, 1.0)
    moved_mm = np.linalg.norm(numbers[one, :3] - numbers[other, :3], axis=-1)
    return np.stack([moved_mm, 2 * np.degrees(np.arccos(cosine))])
