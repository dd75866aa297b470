"""A law of the skin that is bent, crossed and slipping.

A receiver slides and tilts by a quadratic in the flexion of both adjacent joints with their product, each
flexion seen through Bouc-Wen hysteresis (rate-independent, unlike a lag); coefficients have heavy tails, so
that some receivers of a hand are far worse than the others; beside it a slow wander whose steps have heavy
tails, and slips that stay. Sizes are those of the usual skin at one radian; beyond it this one grows on
where the usual one saturates.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from shukotsu.anatomy.drawn_hands import (
    BENT_SHARES,
    DISTAL_TILT,
    HYSTERESIS,
    LOOP_RAD,
    SLIDE_SD_MM,
    SLIP_MM,
    SLIPS,
    TAILED_WANDER_S,
    TILT_SD,
    WANDER_DEG,
    WANDER_MM,
)
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.simulate.moving_skin import Skin
from shukotsu.stages.simulate.random_hand import FLEXION
from shukotsu.stages.simulate.task_motion import RATE_HZ

_TAIL, _FARTHEST = 3.0, 5.0


def polynomial(
    angles_rad: Array, skin: Skin, of_hand: np.random.Generator, of_recording: np.random.Generator
) -> tuple[Array, Array]:
    """Slide and turn by linear, bent and crossed terms of both joints, and where nothing moves besides."""
    terms = _terms(hysteretic(angles_rad[..., FLEXION])[:, skin.joint], skin.present)
    n_frames, n_receivers = terms.shape[:2]
    linear, bent, crossed = BENT_SHARES
    share = np.array([linear, linear, bent, bent, crossed])[:, None, None]
    own = heavy(of_hand, (n_receivers, 5, 2, 3)) * share * np.array([SLIDE_SD_MM, TILT_SD])  # (S, 5, 2, 3)
    own *= skin.looseness[:, None, None, None]
    own[skin.distal, 2, 1, 1] += DISTAL_TILT * skin.scale
    slide, turn = np.einsum("tsk,skix->itsx", terms, own)
    off = _wander(of_recording, n_frames, n_receivers) * skin.looseness[:, None]
    slips = _slips(of_recording, n_frames, n_receivers) * skin.looseness[:, None]
    return slide + WANDER_MM * off[0] + slips, turn + np.radians(WANDER_DEG) * off[1]


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
    keep = float(np.exp(-1.0 / (TAILED_WANDER_S * RATE_HZ)))
    settle = int(5 * TAILED_WANDER_S * RATE_HZ)
    steps = heavy(rng, (2, settle + n_frames, n_receivers, 3)) * np.sqrt(1 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], steps, axis=1)[:, settle:])


def _slips(rng: np.random.Generator, n_frames: int, n_receivers: int) -> Array:
    """Steps (T, S, 3) in mm at random times, that stay."""
    at = rng.integers(0, n_frames, (SLIPS, n_receivers))
    size = SLIP_MM * heavy(rng, (SLIPS, n_receivers, 3))
    after = np.arange(n_frames)[None, :, None, None] >= at[:, None, :, None]
    return np.asarray((after * size[:, None]).sum(0))
