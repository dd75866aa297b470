"""Errors of the tracker: distortion of the magnetic field, white noise, and faults."""

from __future__ import annotations

import numpy as np

from shukotsu.arrays import Array, Bools
from shukotsu.hand import rotations
from shukotsu.simulate.forward import PoseArrays
from shukotsu.simulate.realism import generator
from shukotsu.simulate.task_motion import RATE_HZ

NOISE_MM, NOISE_DEG = 0.10, 0.06
"""White noise at scale 1: sd per axis of position, and of the rotation vector."""

LOST_SHARE, LOST_S = 0.02, 0.2
"""Share of a receiver's frames that are lost at scale 1, and the mean duration of a burst."""

FLIPPED_SHARE, FLIPPED_S = 0.003, 0.15
"""Share of frames reported in the wrong hemisphere (all signs of the position changed), and mean duration of
a burst.
"""

SPIKE_SHARE, SPIKE_MM, SPIKE_DEG = 0.002, 30.0, 15.0
"""Share of single poses that are spikes, and the sd per axis of their error."""

FIELD_STRAIN = 2e-3
"""Sd of the field distortion: each component of position error per mm along each axis."""

FIELD_TURN_DEG_PER_MM = 0.3 / 50.0
"""Sd of each component of rotation error per mm along each axis: 0.3 deg at 50 mm, as published for such
trackers.
"""

FIELD_CENTRE_MM = np.array([220.0, 90.0, -110.0])


def turn_poses(quaternion: Array, rotation_vector_rad: Array) -> Array:
    """Rotate poses by small rotation vectors in their own frames.

    Parameters
    ----------
    quaternion : array, shape (..., 4)
        Unit quaternions (w, x, y, z).
    rotation_vector_rad : array, shape (..., 3)
        Axis times angle.

    Returns
    -------
    array, shape (..., 4)
        The rotated poses.

    """
    angle = np.linalg.norm(rotation_vector_rad, axis=-1)
    return rotations.multiply(quaternion, rotations.about_axis(rotations.unit(rotation_vector_rad), angle))


def distort(position_mm: Array, quaternion: Array, seed: int, scale: float) -> PoseArrays:
    """Distort poses by the room's field: smooth, static and similar for neighbouring receivers.

    Parameters
    ----------
    position_mm, quaternion : array, shape (T, S, 3) and (T, S, 4)
        Receivers in the transmitter frame.
    seed : int
        Seed of the room.
    scale : float
        Scale of the distortion.

    Returns
    -------
    tuple of array
        Distorted positions, mm, and quaternions.

    """
    rng = generator(seed, "field")
    strain = scale * FIELD_STRAIN * rng.standard_normal((3, 3))
    turn_per_mm = scale * np.radians(FIELD_TURN_DEG_PER_MM) * rng.standard_normal((3, 3))
    from_centre_mm = position_mm - FIELD_CENTRE_MM
    turn = from_centre_mm @ turn_per_mm.T
    # the distortion rotates the transmitter's frame, not the receiver's
    angle = np.linalg.norm(turn, axis=-1)
    seen = rotations.multiply(rotations.about_axis(rotations.unit(turn), angle), quaternion)
    return position_mm + from_centre_mm @ strain.T, seen


def noisy(position_mm: Array, quaternion: Array, scale: float, rng: np.random.Generator) -> PoseArrays:
    """Add the tracker's white noise to poses.

    Parameters
    ----------
    position_mm, quaternion : array, shape (T, S, 3) and (T, S, 4)
        Receivers in the transmitter frame.
    scale : float
        Scale of NOISE_MM and NOISE_DEG.
    rng : Generator
        Random generator.

    Returns
    -------
    tuple of array
        Noisy positions, mm, and quaternions.

    """
    noise_mm = scale * NOISE_MM * rng.standard_normal(position_mm.shape)
    turn = scale * np.radians(NOISE_DEG) * rng.standard_normal(position_mm.shape)
    return position_mm + noise_mm, turn_poses(quaternion, turn)


def faulty(position_mm: Array, quaternion: Array, scale: float, rng: np.random.Generator) -> PoseArrays:
    """Add faults to poses: lost poses (NaN), quaternion sign changes, wrong hemispheres, and spikes.

    Parameters
    ----------
    position_mm, quaternion : array, shape (T, S, 3) and (T, S, 4)
        Receivers in the transmitter frame.
    scale : float
        Scale of the shares of faulty frames.
    rng : Generator
        Random generator.

    Returns
    -------
    tuple of array
        Positions, mm, and quaternions.

    """
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


def bursts(rng: np.random.Generator, shape: tuple[int, int], share: float, mean_s: float) -> Bools:
    """Draw bursts of frames of random length for each receiver.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random generator.
    shape : tuple of int
        Numbers of frames T and receivers S.
    share : float
        Approximate share of the frames that are in a burst.
    mean_s : float
        Mean duration of a burst.

    Returns
    -------
    array of bool, shape (T, S)
        Whether a frame is in a burst.

    """
    n_frames, n_receivers = shape
    on = np.zeros(shape, bool)
    for receiver in range(n_receivers):
        n_bursts = rng.poisson(share * n_frames / (mean_s * RATE_HZ))
        for start in rng.integers(0, n_frames, n_bursts):
            on[start : start + 1 + int(rng.exponential(mean_s * RATE_HZ)), receiver] = True
    return on
