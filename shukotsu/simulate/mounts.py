"""Place each receiver on its bone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.hand import drawn_hands as drawn
from shukotsu.hand import rotations
from shukotsu.hand.rotations import Array
from shukotsu.simulate.random_hand import BONES, Hand
from shukotsu.simulate.realism import Realism, generator

FIRST_WORN = 2
"""First of the bones of digits, which come after forearm and hand."""

_RECEIVER_HALF_MM = float(np.mean(drawn.RECEIVER_HALF_MM))


@dataclass(frozen=True)
class Mounts:
    """S receivers on the skin of the relaxed hand: origin and rotation in the frames of bones of BONES."""

    segments: tuple[str, ...]
    bone: npt.NDArray[np.int64]
    position_mm: Array
    quaternion: Array

    def poses(self, bone_position_mm: Array, bone_quaternion: Array) -> tuple[Array, Array]:
        """Poses (T, S, 3) and (T, S, 4) of receivers that ride exactly on bones (T, B, 3), (T, B, 4)."""
        quaternion = bone_quaternion[:, self.bone]
        position = bone_position_mm[:, self.bone] + rotations.rotate(quaternion, self.position_mm)
        return position, rotations.multiply(quaternion, self.quaternion)


def mounts_of(
    subject: str,
    side: str,
    seed: int,
    hand: Hand,
    segments: tuple[str, ...],
    realism: Realism,
    session: str = "",
) -> Mounts:
    """Put receivers on bones' middles and nails, as far off as the realism says, in part by habit."""
    nominal = np.array([_nominal_mm(bone, hand) for bone in BONES])
    rng = generator(seed, "mounts", subject, side, *[session] * bool(session))
    habit_share = max(0.0, float(generator(seed, "habit", subject).uniform(*drawn.HABIT_SHARE)))
    offset_mm, turn = _off(rng, habit_share)
    receiver_half = generator(seed, "receivers", subject).uniform(*drawn.RECEIVER_HALF_MM)
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
    """Draw how far receivers are from where they should be: mm and rotation vectors in rad, (B, 3) each."""
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


def _nominal_mm(bone: str, hand: Hand) -> tuple[float, float, float]:
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
    return bone.endswith("_distal")
