"""Exports for other rigs: joint names, and motion of bones that a rig lacks."""

import numpy as np
import pytest
from simulated_hands import FITTED, REPLAYED, SimulatedHand

from shukotsu.export.exported_motion import local_motion, rest_pose
from shukotsu.export.rigging import RIGS, fold_joints, on_rig
from shukotsu.hand.rotations import rotate

COUNTS = {"webxr": 25, "vrm": 21, "unity": 21, "unreal": 25, "mixamo": 21}
LACKING = ["index_cmc", "middle_cmc", "ring_cmc", "little_cmc"]


@pytest.mark.parametrize("rig", list(RIGS))
def test_every_rig_keeps_every_joints_pose(hand: SimulatedHand, rig: str) -> None:
    motion = hand.motion(FITTED)
    there = on_rig(motion, rig)
    assert len(there.joints) == COUNTS[rig]
    assert len(set(there.names)) == COUNTS[rig]
    names = RIGS[rig].names(hand.recording.hand.hand)
    if RIGS[rig].skin_tips:
        names = {(f"{k[:-4]}_skin_tip" if k.endswith("_tip") else k): name for k, name in names.items()}
    kept = [joint for joint in motion.names[1:] if joint in names]
    before, after = [motion.index(joint) for joint in kept], [there.index(names[joint]) for joint in kept]
    np.testing.assert_array_equal(there.position_mm[:, after], motion.position_mm[:, before])
    np.testing.assert_array_equal(there.quaternion[:, after], motion.quaternion[:, before])
    assert all(joint.parent < index for index, joint in enumerate(there.joints))


def test_a_missing_metacarpal_is_folded_into_the_proximal_phalanx(hand: SimulatedHand) -> None:
    """The MCP joint then follows the wrist, with the same positions and rest pose, and has no axis of its
    own.
    """
    motion = hand.motion(REPLAYED)
    there = fold_joints(motion, LACKING)
    mcp = there.index("little_mcp")
    assert there.joints[mcp].parent == 0
    offset_mm, _ = local_motion(there)
    before = motion.index("little_mcp")
    world = motion.position_mm[:, 0] + rotate(motion.quaternion[:, 0], offset_mm[:, mcp])
    np.testing.assert_allclose(world, motion.position_mm[:, before], atol=1e-9)
    rest, rest_before = rest_pose(there), rest_pose(motion)
    np.testing.assert_allclose(rest[0][mcp], rest_before[0][before], atol=1e-9)
    np.testing.assert_allclose(rest[1][mcp], rest_before[1][before], atol=1e-9)
    assert there.joints[mcp].dof == 0
    assert np.isnan(there.axis[mcp]).all()
    np.testing.assert_array_equal(there.axis[mcp + 1], motion.axis[before + 1])
    assert there.notes[-1] == f"{', '.join(LACKING)} merged into the bones after them"


def test_joints_have_the_names_documented_by_each_rig() -> None:
    """A few names of each rig are taken from its documentation."""
    right, left = ({rig: set(RIGS[rig].names(hand).values()) for rig in RIGS} for hand in ("right", "left"))
    assert {
        "wrist",
        "thumb-phalanx-distal",
        "index-finger-phalanx-intermediate",
        "pinky-finger-tip",
    } <= right["webxr"]
    assert {"rightHand", "rightThumbMetacarpal", "rightLittleDistal"} <= right["vrm"]
    assert {"LeftHand", "LeftThumbProximal", "LeftThumbIntermediate", "LeftIndexProximal"} <= left["unity"]
    assert {"hand_l", "thumb_01_l", "index_metacarpal_l", "pinky_03_l"} <= left["unreal"]
    assert {"mixamorig:LeftHand", "mixamorig:LeftHandThumb4", "mixamorig:LeftHandPinky1"} <= left["mixamo"]
    assert "rightIndexMetacarpal" not in right["vrm"]
