"""The average hand as the simulator moves hands: the estimators' own table turned into joints.

The simulator draws people around other tables, for they are to test the estimators (`anatomy`). A picture
is to show the hand that the estimators expect, moved as the simulator moves.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from anatomy import average_hand as average
from anatomy import drawn_hands as drawn
from skeleton import rotations
from skeleton.rotations import Array, unit
from stages.simulate.forward import bone_poses
from stages.simulate.random_hand import ABDUCTION, BONES, DIGITS, FLEXION, JOINTS, PARENT, WRIST, Hand


@cache
def average_joints() -> Hand:
    """The average right hand of scale 1, without couplings that differ between people."""
    frames, centres_mm = np.tile(np.eye(3), (len(BONES), 1, 1)), np.zeros((len(BONES), 3))
    lengths_mm, axes = np.zeros(len(BONES)), np.zeros((len(JOINTS), 3, 3))
    axes[WRIST] = unit(np.array(drawn.WRIST_AXES))
    for digit, own in average.DIGITS.items():
        joints = np.array([j for j, joint in enumerate(JOINTS) if joint.startswith(f"{digit}_")])
        frames[joints + 1], centres_mm[joints + 1] = own.frames(), own.joints_mm()
        lengths_mm[joints + 1] = own.lengths_mm
        axes[joints] = np.stack([own.flexion_axes, own.frames()[..., 2], own.frames()[..., 0]], 1)
    order = np.tile([FLEXION, ABDUCTION], (len(JOINTS), 1))
    thumb = JOINTS.index("thumb_cmc")
    axes[thumb, ABDUCTION], order[thumb] = average.DIGITS["thumb"].second_axis, (ABDUCTION, FLEXION)
    to_parent = np.swapaxes(frames[PARENT], -1, -2)
    pads_mm = np.zeros((len(DIGITS), 3))
    soft_tip_mm = np.array([digit.soft_tip_mm for digit in average.DIGITS.values()])
    last = [BONES.index(f"{digit}_distal") for digit in DIGITS]
    pads_mm[:, 0] = 0.7 * lengths_mm[last] + 0.3 * soft_tip_mm
    pads_mm[:, 2] = [-drawn.PAD_DEPTH_MM[digit] for digit in DIGITS]
    return Hand(
        side="right",
        origin_mm=np.einsum("jab,jb->ja", to_parent, centres_mm[1:] - centres_mm[PARENT]),
        rest=rotations.from_matrix(to_parent @ frames[1:]),
        axes=np.einsum("jab,jib->jia", to_parent, axes),
        order=order,
        skew_mm=np.zeros((len(JOINTS), 3)),
        relaxed_rad=np.zeros(len(JOINTS)),
        glide_mm=np.zeros((len(JOINTS), 2, 3)),
        length_mm=lengths_mm,
        soft_tip_mm=soft_tip_mm,
        pad_mm=pads_mm,
        coupling=np.zeros((len(JOINTS), 4)),
        scale=1.0,
    )


def posed(postures_deg: Array) -> tuple[Array, Array]:
    """Bones of the average hand in postures (T, J, 2): origins (T, B, 3) in mm, orientations (T, B, 4).

    In the forearm's frame, its origin the wrist centre: x distal, y towards the thumb, z dorsal.
    """
    angles = np.concatenate([np.radians(postures_deg), np.zeros((*postures_deg.shape[:2], 1))], -1)
    still = np.tile([1.0, 0.0, 0.0, 0.0], (len(angles), 1))
    return bone_poses(average_joints(), angles, np.zeros((len(angles), 3)), still)
