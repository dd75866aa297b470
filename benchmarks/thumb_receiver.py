"""Simulated hands whose thumb metacarpal's receiver sits on the nail's side of the thumb."""

from dataclasses import replace

import numpy as np

from shukotsu.skeleton.rotations import Array, about_axis, conjugate, multiply, rotate
from shukotsu.stages.simulate.random_hand import FLEXION, JOINTS
from shukotsu.stages.simulate.simulation import Simulated

OWN = "thumb_metacarpal"
X = np.array([1.0, 0.0, 0.0])


def nail_turn(made: Simulated) -> Array:
    """Quaternion (4,) about the metacarpal's long axis that puts its y nearest the MCP's flexion axis."""
    _, y, z = made.truth.hand.axes[JOINTS.index("thumb_mcp"), FLEXION]
    return about_axis(X, float(np.arctan2(z, y)))


def facing_the_nail(made: Simulated) -> Simulated:
    """The recording and its truth with that receiver carried about the bone, everything else as it was."""
    mounts, turn = made.truth.mounts, nail_turn(made)
    own = mounts.segments.index(OWN)
    bone_to_receiver = conjugate(mounts.quaternion[own])
    moved_mm = rotate(bone_to_receiver, rotate(turn, mounts.position_mm[own]) - mounts.position_mm[own])
    turned = multiply(bone_to_receiver, multiply(turn, mounts.quaternion[own]))
    position, quaternion = made.position_mm.copy(), made.quaternion.copy()
    position[:, own] += rotate(quaternion[:, own], moved_mm)
    quaternion[:, own] = multiply(quaternion[:, own], turned)
    mcp, cmc = (made.truth.joints[name] for name in ("thumb_mcp", "thumb_cmc"))
    back = conjugate(turned)
    joints = {
        **made.truth.joints,
        "thumb_cmc": replace(
            cmc, child_mm=rotate(back, cmc.child_mm - moved_mm), axis_child=rotate(back, cmc.axis_child)
        ),
        "thumb_mcp": replace(
            mcp, parent_mm=rotate(back, mcp.parent_mm - moved_mm), axis_parent=rotate(back, mcp.axis_parent)
        ),
    }
    truth = replace(made.truth, joints=joints)
    return replace(made, position_mm=position, quaternion=quaternion, truth=truth)
