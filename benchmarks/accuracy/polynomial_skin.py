"""A second law of the skin, unlike the simulator's and unlike any estimator's: bent, crossed, slipping.

A receiver slides and tilts by a quadratic in the flexion of both adjacent joints with their product, each
flexion seen through Bouc-Wen hysteresis (rate-independent, unlike a lag); coefficients have heavy tails, so
that some receivers of a hand are far worse than the others; beside it a slow wander whose steps have heavy
tails, and slips that stay. Sizes are those of the simulator's skin at one radian; beyond it this one grows on
where the simulator's saturates.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from skeleton.rotations import Array, rotate
from stages.simulate.artefact import Skin, turned
from stages.simulate.random_hand import FLEXION
from stages.simulate.task_motion import RATE_HZ

SLIDE_MM, TILT_RAD = (1.0, 0.25, 0.4), (0.03, 0.04, 0.02)
"""Per term at one radian, along, lateral, dorsal; about x, y, z of the receiver's bone."""

LINEAR, BENT, CROSSED = 0.6, 0.55, 0.55
"""Shares of them in the linear, quadratic and product terms: together about 1 at one radian."""

DISTAL_TILT = -0.06
"""What a distal receiver under-reads of its own joint, rad per rad at one radian; all of it quadratic."""

HYSTERESIS, LOOP_RAD = 0.4, 0.33
WANDER_MM, WANDER_DEG, WANDER_S = 0.3, 0.4, 1.5
SLIPS, SLIP_MM = 3, 0.2
_TAIL, _FARTHEST = 3.0, 5.0


def slipped(
    position_mm: Array,
    quaternion: Array,
    angles_rad: Array,
    skin: Skin,
    distal: Array,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Let receivers (T, S, 3), (T, S, 4) move on their bones with the joint angles (T, J, 3).

    Of `skin` only is used which joints are next to each receiver and how loose its place is (which holds the
    scale of the artefact). distal : (S,) that scale for a receiver on a distal bone, else 0.
    """
    terms = _terms(hysteretic(angles_rad[..., FLEXION])[:, skin.joint], np.any(skin.slide_mm, axis=-1))
    n_frames, n_receivers = position_mm.shape[:2]
    share = np.array([LINEAR, LINEAR, BENT, BENT, CROSSED])[:, None, None]
    own = heavy(rng, (n_receivers, 5, 2, 3)) * share * np.array([SLIDE_MM, TILT_RAD])  # (S, 5, 2, 3)
    own *= skin.looseness[:, None, None, None]
    own[:, 2, 1, 1] += DISTAL_TILT * distal
    moved = np.einsum("tsk,skix->itsx", terms, own)
    wander = _wander(rng, n_frames, n_receivers) * skin.looseness[:, None]
    slide = moved[0] + WANDER_MM * wander[0] + _slips(rng, n_frames, n_receivers) * skin.looseness[:, None]
    turn = moved[1] + np.radians(WANDER_DEG) * wander[1]
    return position_mm + rotate(quaternion, slide), turned(quaternion, turn)


def hysteretic(flexion_rad: Array) -> Array:
    """Angles (T, ...) as seen through Bouc-Wen hysteresis, which is at rest in the first frame.

    dz = dx - (2 |dx| z + dx |z|) / (3 loop), whose z ends at +loop however fast a joint bends and goes to
    -loop when it straightens. Gives x + HYSTERESIS z.
    """
    z = np.zeros_like(flexion_rad)
    steps = np.diff(flexion_rad, axis=0)
    for frame, step in enumerate(steps):
        before = z[frame]
        pulled = (2 * np.abs(step) * before + step * np.abs(before)) / (3 * LOOP_RAD)
        z[frame + 1] = before + step - pulled
    return np.asarray(flexion_rad + HYSTERESIS * z)


def heavy(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Numbers of sd about 1 with Student's t tails (3 degrees of freedom), none beyond 5."""
    return np.asarray(np.clip(rng.standard_t(_TAIL, shape) / np.sqrt(_TAIL), -_FARTHEST, _FARTHEST))


def _terms(drive: Array, present: npt.NDArray[np.bool_]) -> Array:
    """Linear, bent and crossed terms (T, S, 5) of both adjacent joints (T, S, 2); zero for an absent one."""
    a, b = np.moveaxis(drive * present, -1, 0)
    return np.stack([a, b, a * np.abs(a), b * np.abs(b), a * b], -1)


def _wander(rng: np.random.Generator, n_frames: int, n_receivers: int) -> Array:
    """Autoregressive signals (2, T, S, 3) of sd about 1 with heavy-tailed steps."""
    keep = float(np.exp(-1.0 / (WANDER_S * RATE_HZ)))
    settle = int(5 * WANDER_S * RATE_HZ)
    steps = heavy(rng, (2, settle + n_frames, n_receivers, 3)) * np.sqrt(1 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], steps, axis=1)[:, settle:])


def _slips(rng: np.random.Generator, n_frames: int, n_receivers: int) -> Array:
    """Steps (T, S, 3) in mm at random times, that stay."""
    at = rng.integers(0, n_frames, (SLIPS, n_receivers))
    size = SLIP_MM * heavy(rng, (SLIPS, n_receivers, 3))
    after = np.arange(n_frames)[None, :, None, None] >= at[:, None, :, None]
    return np.asarray((after * size[:, None]).sum(0))
