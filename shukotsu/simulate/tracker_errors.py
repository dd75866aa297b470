"""Add the tracker's errors: a distorted field, white noise, and faults."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shukotsu.hand import rotations
from shukotsu.hand.rotations import Array
from shukotsu.simulate.realism import generator
from shukotsu.simulate.task_motion import RATE_HZ

NOISE_MM, NOISE_DEG = 0.10, 0.06
"""White noise of the tracker at scale 1: sd per axis of position and of rotation vector."""

LOST_SHARE, LOST_S = 0.02, 0.2
"""Share of a receiver's frames that are lost at scale 1, in bursts of this length on the average."""

FLIPPED_SHARE, FLIPPED_S = 0.003, 0.15
"""The same of frames in which positions come from the wrong side of the transmitter, with all signs
changed."""

SPIKE_SHARE, SPIKE_MM, SPIKE_DEG = 0.002, 30.0, 15.0
"""Share of single poses that are wrong altogether, and the sd of that per axis."""

FIELD_STRAIN = 2e-3
"""Sd of the field's distortion: of each component of position, in mm per mm of each component of place."""

FIELD_TURN_DEG_PER_MM = 0.3 / 50.0
"""The same of each component of rotation: 0.3 deg at 50 mm, as published of such trackers."""

FIELD_CENTRE_MM = np.array([220.0, 90.0, -110.0])


def turn_poses(quaternion: Array, rotation_vector_rad: Array) -> Array:
    """Poses (..., 4) turned by small rotation vectors (..., 3) given in their own frames."""
    angle = np.linalg.norm(rotation_vector_rad, axis=-1)
    return rotations.multiply(quaternion, rotations.about_axis(rotations.unit(rotation_vector_rad), angle))


def distort(position_mm: Array, quaternion: Array, seed: int, scale: float) -> tuple[Array, Array]:
    """See the poses through the room's field: smooth, static, nearly the same for neighbouring receivers."""
    rng = generator(seed, "field")
    strain = scale * FIELD_STRAIN * rng.standard_normal((3, 3))
    turn_per_mm = scale * np.radians(FIELD_TURN_DEG_PER_MM) * rng.standard_normal((3, 3))
    from_centre_mm = position_mm - FIELD_CENTRE_MM
    turn = from_centre_mm @ turn_per_mm.T
    # the field turns the transmitter's frame, not the receiver's
    angle = np.linalg.norm(turn, axis=-1)
    seen = rotations.multiply(rotations.about_axis(rotations.unit(turn), angle), quaternion)
    return position_mm + from_centre_mm @ strain.T, seen


def noisy(
    position_mm: Array, quaternion: Array, scale: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Add the tracker's white noise."""
    noise_mm = scale * NOISE_MM * rng.standard_normal(position_mm.shape)
    turn = scale * np.radians(NOISE_DEG) * rng.standard_normal(position_mm.shape)
    return position_mm + noise_mm, turn_poses(quaternion, turn)


def faulty(
    position_mm: Array, quaternion: Array, scale: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Let the tracker lose poses (NaN), change quaternions' signs, name the wrong hemisphere, and jump."""
    shape = position_mm.shape[:2]
    position, turn = position_mm.copy(), quaternion.copy()
    spikes = rng.random(shape) < scale * SPIKE_SHARE
    position[spikes] += SPIKE_MM * rng.standard_normal((spikes.sum(), 3))
    turn[spikes] = turn_poses(turn[spikes], np.radians(SPIKE_DEG) * rng.standard_normal((spikes.sum(), 3)))
    turn[bursts(rng, shape, 0.5, LOST_S)] *= -1.0
    position[bursts(rng, shape, scale * FLIPPED_SHARE, FLIPPED_S)] *= -1.0
    lost = bursts(rng, shape, scale * LOST_SHARE, LOST_S)
    position[lost], turn[lost] = np.nan, np.nan
    return position, turn


def bursts(
    rng: np.random.Generator, shape: tuple[int, int], share: float, mean_s: float
) -> npt.NDArray[np.bool_]:
    """Frames of each receiver (T, S): about that share, in bursts of random length."""
    n_frames, n_receivers = shape
    on = np.zeros(shape, bool)
    for receiver in range(n_receivers):
        n_bursts = rng.poisson(share * n_frames / (mean_s * RATE_HZ))
        for start in rng.integers(0, n_frames, n_bursts):
            on[start : start + 1 + int(rng.exponential(mean_s * RATE_HZ)), receiver] = True
    return on
