"""Receivers on the bones, and the skin motion under them; sizes are those of `hand.drawn_hands`.

The law of skin motion differs from that of every estimator, so that no estimator is tested against its own
assumption.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.hand import rotations
from shukotsu.hand.drawn_hands import drawn
from shukotsu.simulate.forward import PoseArrays, bone_poses
from shukotsu.simulate.random_hand import BONES, FLEXION, JOINTS, PARENT, RandomHand
from shukotsu.simulate.realism import Realism, generator
from shukotsu.simulate.task_motion import RATE_HZ, TaskMotion
from shukotsu.simulate.tracker_errors import turn_poses
from shukotsu.tables.poses import RecordingName

FIRST_WORN = 2
"""Index of the first bone of a digit in BONES, after forearm and hand."""

_RECEIVER_HALF_MM = float(np.mean(drawn.RECEIVER_HALF_MM))


@dataclass(frozen=True)
class Mounts:
    """Positions and orientations of S receivers on the skin of the relaxed hand.

    Attributes
    ----------
    segments : tuple of str
        Bones that carry receivers.
    bone : array of int, shape (S,)
        Indices of these bones in BONES.
    position_mm : array, shape (S, 3)
        Receiver origins in the bone frames, mm.
    quaternion : array, shape (S, 4)
        Unit quaternions (w, x, y, z), receiver to bone frame.

    """

    segments: tuple[str, ...]
    bone: Integers
    position_mm: Array
    quaternion: Array

    def poses(self, bone_position_mm: Array, bone_quaternion: Array) -> PoseArrays:
        """Compute the poses of receivers that are fixed to bones.

        Parameters
        ----------
        bone_position_mm : array, shape (T, B, 3)
            Bones in the transmitter frame.
        bone_quaternion : array, shape (T, B, 4)
            Bone to transmitter frame.

        Returns
        -------
        position_mm : array, shape (T, S, 3)
            Receivers in the transmitter frame.
        quaternion : array, shape (T, S, 4)
            Receiver to transmitter frame.

        """
        quaternion = bone_quaternion[:, self.bone]
        position = bone_position_mm[:, self.bone] + rotations.rotate(quaternion, self.position_mm)
        return position, rotations.multiply(quaternion, self.quaternion)


def mounts_of(
    name: RecordingName, seed: int, hand: RandomHand, segments: tuple[str, ...], realism: Realism
) -> Mounts:
    """Draw the receiver placement: mid-bone or on the nail, misplaced at random and partly by habit.

    Parameters
    ----------
    name : RecordingName
        The recording; receivers are placed anew in every session, and stay between its recordings.
    seed : int
        Seed of the simulation.
    hand : RandomHand
        The hand.
    segments : tuple of str
        Bones that carry receivers.
    realism : Realism
        Scale of the misplacement.

    Returns
    -------
    Mounts
        Placement of the S receivers.

    """
    nominal = np.array([_nominal_mm(bone, hand) for bone in BONES])
    rng = generator(seed, "mounts", name.subject, hand.side, session=name.session)
    habit_share = max(0.0, float(generator(seed, "habit", name.subject).uniform(*drawn.HABIT_SHARE)))
    offset_mm, turn = _off(rng, habit_share)
    receiver_half = generator(seed, "receivers", name.subject).uniform(*drawn.RECEIVER_HALF_MM)
    offset_mm[FIRST_WORN:, 2] += receiver_half - _RECEIVER_HALF_MM
    position = nominal + realism.mounts * offset_mm
    for b in range(FIRST_WORN, len(BONES)):
        least, most = drawn.NAIL_RANGE if _on_nail(BONES[b]) else drawn.MOUNT_RANGE
        position[b, 0] = np.clip(position[b, 0], least * hand.length_mm[b], most * hand.length_mm[b])
    turn = realism.mounts * turn
    bone = np.array([BONES.index(segment) for segment in segments])
    quaternion = rotations.about_axis(rotations.unit(turn), np.linalg.norm(turn, axis=-1))
    return Mounts(segments, bone, position[bone], quaternion[bone])


def _off(rng: np.random.Generator, habit: float) -> tuple[Array, Array]:
    """Draw misplacements of receivers on all bones: offsets, mm, and rotation vectors, rad, (B, 3) each."""
    nails = [_on_nail(bone) for bone in BONES]
    alike = np.sqrt(habit) * rng.standard_normal((2, 1, 3))
    of_each = np.clip(rng.standard_t(4, (2, len(BONES), 3)) / np.sqrt(2.0), -4.0, 4.0) * np.sqrt(1.0 - habit)
    of_each[0, nails] *= drawn.NAIL_OWN
    of_each[1, nails] *= drawn.NAIL_OWN_TURN
    offset_mm, turn = (alike + of_each) * np.array([drawn.MOUNT_SD_MM, drawn.MOUNT_SD_DEG])[:, None]
    turn[nails, 1] += drawn.NAIL_TILT_DEG
    back = BONES.index("hand")
    offset_mm[back] = np.clip(rng.standard_normal(3), -2.5, 2.5) * drawn.HAND_MOUNT_SD_MM
    offset_mm[back, 2] += drawn.HAND_RISE_MM
    return offset_mm, np.radians(turn)


def _nominal_mm(bone: str, hand: RandomHand) -> tuple[float, float, float]:
    """Return the nominal position (3,) of a bone's receiver in the bone frame, mm."""
    if bone == "hand":
        return drawn.HAND_MOUNT_MM
    if bone == "forearm":
        return drawn.FOREARM_MOUNT_MM
    digit = bone.split("_")[0]
    of_digit = [b for b, name in enumerate(BONES) if name.startswith(f"{digit}_")]
    b = BONES.index(bone)
    height = drawn.BONE_HEIGHT_MM[digit][of_digit.index(b)] * hand.scale + _RECEIVER_HALF_MM
    if _on_nail(bone):
        return (drawn.NAIL_SHARE * float(hand.length_mm[b]), 0.0, height + drawn.NAIL_MM)
    return (drawn.MOUNT_SHARE * float(hand.length_mm[b]), 0.0, height + drawn.SKIN_MM)


def _on_nail(bone: str) -> bool:
    """Return whether the bone's receiver sits on the nail."""
    return bone.endswith("_distal")


@dataclass(frozen=True)
class Skin:
    """Skin of a hand: which joints move each of S receivers, and how loose the skin is there.

    Attributes
    ----------
    bone : array of int, shape (S,)
        Bone of the receiver.
    joint : array of int, shape (S, 2)
        Joints at the proximal and the distal end of the bone.
    present : array of bool, shape (S, 2)
        Whether there is such a joint.
    looseness : array, shape (S,)
        Skin motion relative to a typical receiver, including `scale`.
    scale : float
        Scale of skin motion.
    thumb_place_lag, thumb_turn_lag : float
        Shares of the CMC motion by which the thumb metacarpal's receiver lags in position and rotation.

    """

    bone: Integers
    joint: Integers
    present: Bools
    looseness: Array
    scale: float
    thumb_place_lag: float
    thumb_turn_lag: float


def skin_of(subject: str, side: str, seed: int, segments: tuple[str, ...], scale: float) -> Skin:
    """Draw the skin of a hand, which all its recordings share.

    Parameters
    ----------
    subject, side : str
        Subject, and right or left.
    seed : int
        Seed of the simulation.
    segments : tuple of str
        Bones that carry receivers.
    scale : float
        Scale of skin motion.

    Returns
    -------
    Skin
        Skin under the S receivers.

    """
    rng = generator(seed, "skin", subject, side)
    place_lag = rng.uniform(*drawn.THUMB_PLACE_LAG)
    turn_lag = place_lag + rng.uniform(*drawn.THUMB_TURN_FURTHER)
    lags = (min(0.9, scale * lag) for lag in (place_lag, turn_lag))
    bone = np.array([BONES.index(segment) for segment in segments])
    # several joints are at the distal end of the hand, far from its receiver: only the wrist moves its skin
    after = [np.flatnonzero(carrying == PARENT) for carrying in bone]
    joint = np.array(
        [(b - 1, ends[0] if len(ends) == 1 else -1) for b, ends in zip(bone, after, strict=True)]
    )
    looseness = np.array([drawn.LITTLE if name.startswith("little") else 1.0 for name in segments])
    looseness *= [drawn.NAIL if name.endswith("_distal") else 1.0 for name in segments]
    looseness[[name == "thumb_metacarpal" for name in segments]] = drawn.THENAR
    looseness *= scale
    return Skin(bone, np.maximum(joint, 0), joint >= 0, looseness, scale, *lags)


def on_skin(
    hand: RandomHand, mounts: Mounts, motion: TaskMotion, relaxed_rad: Array, bones: PoseArrays, skin: Skin
) -> PoseArrays:
    """Compute receiver poses before skin motion; the thumb metacarpal's receiver lags behind the CMC joint.

    Parameters
    ----------
    hand : RandomHand
        The hand.
    mounts : Mounts
        Placement of the receivers.
    motion : TaskMotion
        Joint angles and arm over T frames.
    relaxed_rad : array, shape (J, 3)
        Angles of the relaxed hand, at which there is no lag.
    bones : PoseArrays
        The B bones.
    skin : Skin
        Shares of the lag.

    Returns
    -------
    position_mm : array, shape (T, S, 3)
        Receivers in the transmitter frame, mm.
    quaternion : array, shape (T, S, 4)
        Unit quaternions (w, x, y, z), receiver to transmitter frame.

    """
    position, quaternion = mounts.poses(*bones)
    if "thumb_metacarpal" in mounts.segments:
        receiver, cmc = mounts.segments.index("thumb_metacarpal"), JOINTS.index("thumb_cmc")

        def lagging_poses(lag: float) -> PoseArrays:
            """Return receiver poses if the thumb's CMC motion is reduced by this share."""
            angles_rad = motion.angles_rad.copy()
            angles_rad[:, cmc] -= lag * (angles_rad[:, cmc] - relaxed_rad[cmc])
            return mounts.poses(*bone_poses(hand, angles_rad, motion.wrist_mm, motion.forearm))

        position[:, receiver] = lagging_poses(skin.thumb_place_lag)[0][:, receiver]
        quaternion[:, receiver] = lagging_poses(skin.thumb_turn_lag)[1][:, receiver]
    return position, quaternion


def displace(position_mm: Array, quaternion: Array, slide_mm: Array, turn_rad: Array) -> PoseArrays:
    """Displace receivers in their own frames.

    Parameters
    ----------
    position_mm, quaternion : array, shape (T, S, 3) and (T, S, 4)
        Receivers in the transmitter frame.
    slide_mm, turn_rad : array, shape (T, S, 3)
        Translations, mm, and rotation vectors, rad.

    Returns
    -------
    tuple of array
        Displaced positions, mm, and quaternions.

    """
    return position_mm + rotations.rotate(quaternion, slide_mm), turn_poses(quaternion, turn_rad)


def lag_signal(signal: Array, lag_s: float) -> Array:
    """Compute the exponential moving average, by FFT, of signals that were 0 before their start.

    Parameters
    ----------
    signal : array, shape (T, N)
        Signals at RATE_HZ.
    lag_s : float
        Time constant.

    Returns
    -------
    array, shape (T, N)
        Averages.

    """
    keep = np.exp(-1.0 / (lag_s * RATE_HZ))
    n = len(signal)
    kernel = (1.0 - keep) * keep ** np.arange(min(n, int(20 * lag_s * RATE_HZ)))
    size = 1 << (n + len(kernel)).bit_length()
    spectrum = np.fft.rfft(signal, size, axis=0) * np.fft.rfft(kernel, size)[:, None]
    return np.asarray(np.fft.irfft(spectrum, size, axis=0)[:n])


def wander(rng: np.random.Generator, n_frames: int, n_receivers: int) -> Array:
    """Draw stationary first-order autoregressive signals of sd 1, for position and for rotation.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random generator.
    n_frames, n_receivers : int
        Numbers of frames T and receivers S.

    Returns
    -------
    array, shape (2, T, S, 3)
        Signals, in units of their sd.

    """
    settle = int(8 * drawn.WANDER_S * RATE_HZ)
    keep = np.exp(-1.0 / (drawn.WANDER_S * RATE_HZ))
    white = rng.standard_normal((settle + n_frames, n_receivers * 6))
    smooth = lag_signal(white, drawn.WANDER_S)[settle:] * np.sqrt((1.0 + keep) / (1.0 - keep))
    return np.moveaxis(smooth.reshape(n_frames, n_receivers, 2, 3), 2, 0)


def saturating(
    angles_rad: Array, skin: Skin, of_hand: np.random.Generator, of_recording: np.random.Generator
) -> tuple[Array, Array]:
    """Compute skin motion that saturates with flexion and is partly delayed, plus a slow drift.

    Parameters
    ----------
    angles_rad : array, shape (T, J, 3)
        Joint angles relative to the relaxed hand.
    skin : Skin
        Skin of the hand.
    of_hand : Generator
        Random generator of what all recordings of the hand share.
    of_recording : Generator
        Random generator of the drift in this recording.

    Returns
    -------
    slide_mm : array, shape (T, S, 3)
        Translation in the receiver frames, mm.
    turn_rad : array, shape (T, S, 3)
        Rotation vectors in the receiver frames, rad.

    """
    loose = (skin.looseness[:, None] * skin.present)[..., None]
    slide = of_hand.standard_normal((len(skin.bone), 2, 3)) * drawn.SLIDE_SD_MM * loose
    tilt = of_hand.standard_normal((len(skin.bone), 2, 3)) * drawn.TILT_SD * loose
    tilt[[_on_nail(BONES[bone]) for bone in skin.bone], 0, 1] += skin.scale * drawn.DISTAL_TILT
    direct = drawn.SATURATION_RAD * np.tanh(angles_rad[..., FLEXION] / drawn.SATURATION_RAD)
    start, late = direct[:1], drawn.LAG_SHARE
    drive = start + (1 - late) * (direct - start) + late * lag_signal(direct - start, drawn.LAG_S)
    drive = drive[:, skin.joint]  # (T, S, 2)
    off = wander(of_recording, len(drive), len(skin.bone)) * skin.looseness[:, None]
    return (
        np.einsum("tsa,sax->tsx", drive, slide) + drawn.WANDER_MM * off[0],
        np.einsum("tsa,sax->tsx", drive, tilt) + np.radians(drawn.WANDER_DEG) * off[1],
    )
