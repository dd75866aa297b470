"""What stands between bone and number: skin that moves, a distorted field, a noisy tracker.

The skin's laws (saturation, lag, wander, a thumb metacarpal that under-reads) are chosen outside what any
estimator of this project assumes, so that nothing is judged by its own assumptions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from anatomy.drawn_hands import (
    DISTAL_TILT,
    LAG_S,
    LAG_SHARE,
    LITTLE,
    NAIL,
    SATURATION_RAD,
    SLIDE_SD_MM,
    THENAR,
    TILT_SD,
    UNDER_READING,
    WANDER_DEG,
    WANDER_MM,
    WANDER_S,
)
from skeleton import rotations
from skeleton.rotations import Array
from stages.simulate.mounts import Mounts
from stages.simulate.random_hand import BONES, FLEXION, JOINTS, PARENT
from stages.simulate.randomness import generator
from stages.simulate.task_motion import RATE_HZ

NOISE_MM, NOISE_DEG = 0.10, 0.06
"""White noise of the tracker at scale 1: sd per axis of position and of rotation vector."""

_FIELD = 2e-3  # strain of the field, per component
_FIELD_TURN_RAD_PER_MM = float(np.radians(0.3)) / 50.0
_FIELD_CENTRE_MM = np.array([220.0, 90.0, -110.0])


@dataclass(frozen=True)
class Skin:
    """How each receiver of a hand moves on its bone.

    slide_mm, tilt : (S, 2, 3) per rad of the bone's own (proximal) joint and of the joint after it;
    joint : (S, 2) those joints; looseness : (S,) 1 for a typical receiver; under_reading : share of the
    thumb metacarpal's rotation in the CMC joint that its receiver does not follow.
    """

    slide_mm: Array
    tilt: Array
    joint: npt.NDArray[np.int64]
    looseness: Array
    under_reading: float


def skin_of(subject: str, side: str, seed: int, segments: tuple[str, ...], scale: float) -> Skin:
    """Draw a hand's skin; the same in each of the hand's recordings."""
    rng = generator(seed, "skin", subject, side)
    slide = rng.standard_normal((len(BONES), 2, 3)) * SLIDE_SD_MM
    tilt = rng.standard_normal((len(BONES), 2, 3)) * TILT_SD
    under_reading = min(0.9, scale * rng.uniform(*UNDER_READING))
    distal = np.array([bone.endswith("_distal") for bone in BONES])
    looseness = scale * np.array([_looseness(bone) for bone in BONES])
    slide *= looseness[:, None, None]
    tilt *= looseness[:, None, None]
    tilt[distal, 0, 1] += scale * DISTAL_TILT
    joint = np.array([_adjacent_joints(bone) for bone in range(len(BONES))])
    absent = joint < 0
    slide[absent], tilt[absent] = 0.0, 0.0
    bone = np.array([BONES.index(segment) for segment in segments])
    return Skin(slide[bone], tilt[bone], np.maximum(joint, 0)[bone], looseness[bone], under_reading)


def _looseness(bone: str) -> float:
    loose = LITTLE if bone.startswith("little") else 1.0
    if bone == "thumb_metacarpal":
        return THENAR
    return loose * (NAIL if bone.endswith("_distal") else 1.0)


def _adjacent_joints(bone: int) -> tuple[int, int]:
    """The joint that moves the bone and the one that it carries; -1 for none.

    The palm carries many joints at its far end, none under its receiver: only the wrist moves its skin.
    """
    after = [j for j, parent in enumerate(PARENT) if parent == bone]
    return bone - 1, after[0] if len(after) == 1 else -1


def displaced(
    position_mm: Array, quaternion: Array, angles_rad: Array, skin: Skin, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Let receivers (T, S, 3), (T, S, 4) slide and tilt on their bones with the joint angles (T, J, 3)."""
    drive = _drive(angles_rad[..., FLEXION])[:, skin.joint]  # (T, S, 2)
    n_frames, n_receivers = position_mm.shape[:2]
    wander = _wander(rng, n_frames, n_receivers * 6).reshape(n_frames, n_receivers, 2, 3)
    wander *= skin.looseness[:, None, None]
    slide = np.einsum("tsa,sax->tsx", drive, skin.slide_mm) + WANDER_MM * wander[:, :, 0]
    turn = np.einsum("tsa,sax->tsx", drive, skin.tilt) + np.radians(WANDER_DEG) * wander[:, :, 1]
    return position_mm + rotations.rotate(quaternion, slide), turned(quaternion, turn)


def under_read(angles_rad: Array, skin: Skin) -> Array:
    """Joint angles (T, J, 3) as the skin over the thumb's metacarpal follows them: the CMC turns less."""
    followed = angles_rad.copy()
    followed[:, JOINTS.index("thumb_cmc")] *= 1.0 - skin.under_reading
    return followed


def turned(quaternion: Array, rotation_vector_rad: Array) -> Array:
    """Poses (..., 4) turned by small rotation vectors (..., 3) given in their own frames."""
    angle = np.linalg.norm(rotation_vector_rad, axis=-1)
    return rotations.multiply(quaternion, rotations.about_axis(rotations.unit(rotation_vector_rad), angle))


def distorted(position_mm: Array, quaternion: Array, seed: int, scale: float) -> tuple[Array, Array]:
    """See the poses through the room's field: smooth, static, nearly the same for neighbouring receivers."""
    rng = generator(seed, "field")
    strain = scale * _FIELD * rng.standard_normal((3, 3))
    turn_per_mm = scale * _FIELD_TURN_RAD_PER_MM * rotations.unit(rng.standard_normal((3, 3)))
    place = position_mm - _FIELD_CENTRE_MM
    turn = place @ (turn_per_mm / np.sqrt(3.0)).T
    # the field turns the transmitter's frame, not the receiver's
    angle = np.linalg.norm(turn, axis=-1)
    seen = rotations.multiply(rotations.about_axis(rotations.unit(turn), angle), quaternion)
    return position_mm + place @ strain.T, seen


def noisy(
    position_mm: Array, quaternion: Array, scale: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Add the tracker's white noise."""
    place = scale * NOISE_MM * rng.standard_normal(position_mm.shape)
    turn = scale * np.radians(NOISE_DEG) * rng.standard_normal(position_mm.shape)
    return position_mm + place, turned(quaternion, turn)


def _drive(flexion_rad: Array) -> Array:
    """What moves the skin, (T, J): flexion, saturating, partly lagging behind."""
    direct = SATURATION_RAD * np.tanh(flexion_rad / SATURATION_RAD)
    start = direct[:1]
    return np.asarray(start + (1 - LAG_SHARE) * (direct - start) + LAG_SHARE * _lagged(direct - start, LAG_S))


def _lagged(signal: Array, lag_s: float) -> Array:
    """Give the exponential average over the past of a signal (T, N) that was 0 before, through the FFT."""
    keep = np.exp(-1.0 / (lag_s * RATE_HZ))
    n = len(signal)
    kernel = (1.0 - keep) * keep ** np.arange(min(n, int(20 * lag_s * RATE_HZ)))
    size = 1 << (n + len(kernel)).bit_length()
    spectrum = np.fft.rfft(signal, size, axis=0) * np.fft.rfft(kernel, size)[:, None]
    return np.asarray(np.fft.irfft(spectrum, size, axis=0)[:n])


def _wander(rng: np.random.Generator, n_frames: int, n_signals: int) -> Array:
    """Stationary first-order autoregressive signals (T, N) of sd 1."""
    settle = int(8 * WANDER_S * RATE_HZ)
    keep = np.exp(-1.0 / (WANDER_S * RATE_HZ))
    white = rng.standard_normal((settle + n_frames, n_signals))
    return np.asarray(_lagged(white, WANDER_S)[settle:] * np.sqrt((1.0 + keep) / (1.0 - keep)))


def seen_through_skin(
    mounts: Mounts,
    bones: tuple[Array, Array],
    thumb_skin: tuple[Array, Array],
    angles_rad: Array,
    skin: Skin,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Give the receivers' poses (T, S, 3), (T, S, 4) on a skin that moves.

    bones, thumb_skin : poses of all bones, and the same with the CMC turned as far as the skin follows
    (`under_read`), of which only the thumb's metacarpal is used.
    """
    position, quaternion = mounts.poses(*bones)
    if "thumb_metacarpal" in mounts.segments:
        own = mounts.segments.index("thumb_metacarpal")
        followed = mounts.poses(*thumb_skin)
        position[:, own], quaternion[:, own] = followed[0][:, own], followed[1][:, own]
    return displaced(position, quaternion, angles_rad, skin, rng)
