"""Where each receiver sits on its bone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from anatomy import drawn_hands as drawn
from skeleton import rotations
from skeleton.rotations import Array
from stages.simulate.random_hand import BONES, Hand
from stages.simulate.randomness import generator
from stages.simulate.realism import Realism


@dataclass(frozen=True)
class Mounts:
    """Receivers as they sit on the skin at rest, in their bones' frames.

    segments : S names; bone : (S,) index into BONES; position_mm : (S, 3) receiver origin; quaternion :
    (S, 4) receiver to bone.
    """

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
    subject: str, side: str, seed: int, hand: Hand, segments: tuple[str, ...], realism: Realism
) -> Mounts:
    """Put the receivers at mid-bone, above the joint line; unless planes are exact, a little off."""
    rng = generator(seed, "mounts", subject, side)
    misplaced = drawn.MOUNT_SD_MM * np.clip(rng.standard_normal((len(BONES), 3)), -2.5, 2.5)
    direction = rotations.unit(rng.standard_normal((len(BONES), 3)))
    angle = np.radians(rng.uniform(*drawn.MOUNT_TURN_DEG, len(BONES)))
    misturned = rotations.about_axis(direction, angle)
    position = np.array([_nominal_mm(bone, hand) for bone in BONES])
    if realism.exact_planes:
        misturned = np.tile([1.0, 0.0, 0.0, 0.0], (len(BONES), 1))
    else:
        position = position + misplaced
    bone = np.array([BONES.index(segment) for segment in segments])
    return Mounts(segments, bone, position[bone], misturned[bone])


def _nominal_mm(bone: str, hand: Hand) -> tuple[float, float, float]:
    if bone == "hand":
        return drawn.HAND_MOUNT_MM
    if bone == "forearm":
        return drawn.FOREARM_MOUNT_MM
    height = drawn.HEIGHT_MM[drawn.BONE_KINDS.index(bone.split("_")[1])] * hand.scale
    return (0.5 * float(hand.length_mm[BONES.index(bone)]), 0.0, height)
