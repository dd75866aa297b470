"""A hand that moves, as arrays; and the same hand at joint angles that somebody names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError, guess
from shukotsu.skeleton.joint_angles import joint_rotation
from shukotsu.skeleton.rotations import Array, conjugate, multiply, rotate

Angles = float | Sequence[float] | Array
"""Of a joint, in degrees: flexion; or flexion, deviation, axial rotation (3,); or these over time (T, 3)."""


@dataclass(frozen=True)
class PosedHand:
    """J joints with their bones over T frames; joint 0 is the root, and parents come before children.

    hand : right or left. joints : J names; `<digit>_tip` ends a digit's bones, `<digit>_skin_tip` its skin.
    digits : of each joint, empty for the root. parents : (J,), -1 for the root. frame : (T,) as recorded.
    time_s : (T,) device time, NaN where there is none. position_mm : (T, J, 3) and quaternion : (T, J, 4)
    unit (w, x, y, z) of the bones that start there, in the transmitter's frame, x distal and z dorsal, NaN in
    gaps; a thumb's metacarpal faces its nail's side. offset_mm : (J, 3) each joint in its parent's bone.
    rest : (J, 4) each bone against its parent where its joint angles are zero (docs/joint-angles.md); of a
    joint without angles its mean. axes : (J, 4) how the axes of its angles stand in its bone.
    """

    hand: str
    joints: tuple[str, ...]
    digits: tuple[str, ...]
    parents: npt.NDArray[np.int64]
    frame: npt.NDArray[np.int64]
    time_s: Array
    position_mm: Array
    quaternion: Array
    offset_mm: Array
    rest: Array
    axes: Array

    def index(self, joint: str) -> int:
        """Place of a joint in the second dimension; InputError where there is none of that name."""
        if joint not in self.joints:
            raise InputError(f"the hand has no joint {joint!r}; {guess(joint, self.joints)}")
        return self.joints.index(joint)

    def in_hand_mm(self) -> Array:
        """Positions (T, J, 3) in the frame of the hand's own bone: x distal, z dorsal, the root at zero."""
        moved = self.position_mm - self.position_mm[:, :1]
        return rotate(conjugate(self.quaternion[:, :1]), moved)


def bend(posed: PosedHand, angles_deg: Mapping[str, Angles]) -> PosedHand:
    """The same hand at joint angles (docs/joint-angles.md), in the frame of the hand's own bone.

    angles_deg : by joint: flexion alone, or flexion, deviation and axial rotation, or these over time (T, 3);
    a joint that is not named has all angles zero. Bones keep their lengths, and each digit starts where
    it starts in the recording on average. Frames are counted from 0; time_s is NaN.
    Raises InputError where a joint is not of the hand or two series differ in length.
    """
    turns = {posed.index(joint): _series(joint, given) for joint, given in angles_deg.items()}
    counts = {len(turn) for turn in turns.values()} - {1}
    if len(counts) > 1:
        raise InputError(
            f"angles over {' and '.join(map(str, sorted(counts)))} frames; expected as many in all"
        )
    count = max(counts, default=1)
    position = np.zeros((count, len(posed.joints), 3))
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (count, len(posed.joints), 1))
    for index, parent in enumerate(posed.parents):
        if parent < 0:
            continue
        turn = posed.rest[index]
        if index in turns:
            turn = joint_rotation(turns[index], posed.hand, turn, posed.axes[index])
        quaternion[:, index] = multiply(quaternion[:, parent], turn)
        position[:, index] = position[:, parent] + rotate(quaternion[:, parent], posed.offset_mm[index])
    frame, time_s = np.arange(count), np.full(count, np.nan)
    return replace(posed, frame=frame, time_s=time_s, position_mm=position, quaternion=quaternion)


def _series(joint: str, given: Angles) -> Array:
    """Angles (T, 3) of what a caller gives."""
    angles = np.asarray(given, float)
    if angles.ndim == 0:
        return np.array([[float(angles), 0.0, 0.0]])
    if angles.ndim > 2 or angles.shape[-1] != 3:
        raise InputError(
            f"{joint}: angles of shape {angles.shape}; expected flexion alone, three angles, or (frames, 3)"
        )
    return angles.reshape(-1, 3)
