"""Distort poses as a magnetic tracker does: a bent field, a steel plate, noise and lost frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.other_hands.person import Array, unit


@dataclass(frozen=True)
class Field:
    """A smooth function of place: long waves (K, 3), and (K, 6) what each adds, mm and radians."""

    waves: Array
    phases: Array
    adds: Array

    def at(self, place_mm: Array) -> Array:
        """Return (..., 6) what a receiver at a place (..., 3) is off by."""
        return np.asarray(np.sin(place_mm @ self.waves.T + self.phases) @ self.adds)


def draw_field(rng: np.random.Generator) -> Field:
    """Draw a room: about 3 mm a metre for each component, 0.3 deg for 50 mm."""
    directions = unit(rng.normal(size=(6, 3)))
    per_mm = 2 * np.pi / rng.uniform(500, 1100, (6, 1))
    slopes = rng.normal(0, [3e-3] * 3 + [np.deg2rad(0.3) / 50] * 3, (6, 6))
    return Field(directions * per_mm, rng.uniform(0, 2 * np.pi, 6), slopes / per_mm)


def table_stands(seed: int) -> Rotation:
    """Draw the table's rotation to the transmitter: turned anyhow, which may be screwed on upside down."""
    rng = np.random.default_rng([seed, 35])
    turns_deg = [rng.uniform(-180, 180), rng.choice([0.0, 180.0])]
    return Rotation.from_euler("zx", turns_deg, degrees=True)


def measure(place_mm: Array, turning: Rotation, off: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return positions (T, S, 3) and quaternions (T, S, 4) as the tracker says them; `off` is the field's."""
    shape = place_mm.shape[:2]
    noise_mm, noise_deg = rng.uniform(0.05, 0.15), rng.uniform(0.03, 0.10)
    grows = np.clip((np.linalg.norm(place_mm, axis=-1, keepdims=True) / 330) ** 2, 0.3, 4)
    position_mm = place_mm + off[..., :3] + grows * rng.normal(0, noise_mm, (*shape, 3))
    tilt = off[..., 3:] + grows * rng.normal(0, np.deg2rad(noise_deg), (*shape, 3))
    seen = Rotation.from_rotvec(tilt.reshape(-1, 3)) * turning
    return position_mm, quaternions(seen, shape)


def quaternions(turning: Rotation, shape: tuple[int, ...]) -> Array:
    """Return (..., 4) w, x, y, z that run on without changing sign from frame to frame."""
    quaternion = turning.as_quat(scalar_first=True).reshape(*shape, 4)
    steps = np.sign(np.einsum("tsi,tsi->ts", quaternion[1:], quaternion[:-1]))
    quaternion[1:] *= np.cumprod(steps, axis=0)[..., None]
    return np.asarray(quaternion)


def lost_frames(shape: tuple[int, int], rate_hz: float, rng: np.random.Generator) -> npt.NDArray[np.bool_]:
    """Return (T, S) where nothing was received: short gaps, now and then of all receivers at once."""
    lost = np.zeros(shape, bool)
    for _ in range(rng.integers(4, 12)):
        first = int(rng.integers(0, shape[0]))
        last = first + 1 + int(rng.exponential(0.08) * rate_hz)
        which = slice(None) if rng.random() < 0.2 else int(rng.integers(0, shape[1]))
        lost[first:last, which] = True
    return lost
