"""OpenSim export: poses and inverse kinematics as computed by OpenSim."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from moving_fingers import blanked
from program_files import printed_by
from simulated_hands import FITTED, REPLAYED, SimulatedHand

from shukotsu.export.exported_motion import stiffen
from shukotsu.export.opensim import write
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import about_axis, angle, conjugate, continuous, multiply, rotate, unit

READER = Path(__file__).resolve().parents[1] / "export_tools" / "read_with_opensim.py"
NEAR_M = 1e-9
NEAR_RAD = 1e-8
HINGES = ("thumb_ip", "index_pip", "index_dip", "middle_dip", "ring_cmc", "little_cmc")


def with_hinges(motion: PosedRecording) -> PosedRecording:
    """Return the motion with HINGES of one degree of freedom; all other joints have two.

    The metacarpals of the index and middle fingers are fixed.
    """
    turn = motion.quaternion.copy()
    joints, axis = list(motion.joints), motion.axis.copy()
    for index, joint in enumerate(motion.joints[1:], 1):
        relative = multiply(conjugate(motion.quaternion[:, joint.parent]), motion.quaternion[:, index])
        if joint.name in HINGES:
            if joint.name.endswith("_cmc"):
                axis[index] = unit(np.array([-0.8, -0.1, -0.5]))
            assert np.isfinite(axis[index]).all()
            joints[index] = replace(joint, dof=1)
            bent_rad = 0.4 * np.sin(np.linspace(0, 3, len(turn)) + index)
            relative = multiply(relative[:1], about_axis(axis[index], bent_rad))
        elif joint.name in ("index_cmc", "middle_cmc"):
            relative = np.broadcast_to(relative[:1], relative.shape)
        elif not joint.tip:
            joints[index], axis[index] = replace(joint, dof=2), np.nan
        turn[:, index] = multiply(turn[:, joint.parent], relative)
    return stiffen(replace(motion, joints=tuple(joints), axis=axis, quaternion=continuous(turn)))


def read_with_opensim(export_tool: Callable[[str], Path], stem: Path, *options: str) -> dict[str, Any]:
    """Return what OpenSim reads; the test is skipped if OpenSim is not installed."""
    printed_by(export_tool("opensim/bin/python"), READER, stem, stem.with_suffix(".npz"), *options)
    with np.load(stem.with_suffix(".npz")) as arrays:
        return dict(arrays)


@pytest.mark.tools
@pytest.mark.parametrize("model", [REPLAYED, FITTED])
def test_opensim_reads_every_bone_at_the_motions_pose(
    hand: SimulatedHand, tmp_path: Path, export_tool: Callable[[str], Path], model: str
) -> None:
    motion = hand.ready(model)
    stem = tmp_path / "sub-母_hand"
    write(motion, stem.with_suffix(".osim"))
    seen = read_with_opensim(export_tool, stem)
    bones = [index for index, joint in enumerate(motion.joints) if not joint.tip]
    np.testing.assert_allclose(seen["mot_time_s"], motion.time_s - motion.time_s[0], atol=1e-9)
    np.testing.assert_allclose(seen["mot_place_m"], motion.position_mm[:, bones] / 1000, atol=NEAR_M)
    apart = angle(multiply(conjugate(motion.quaternion[:, bones]), seen["mot_turn"]))
    assert apart.max() < NEAR_RAD
    assert seen["mot_in_degrees"] == "yes"
    assert seen["trc_units"] == "mm"
    markers = seen["trc_markers"].tolist()
    for number, segment in enumerate(motion.receivers.segments):
        if segment in [motion.joints[bone].segment for bone in bones]:  # else no bone carries it
            measured = seen["trc_mm"][:, markers.index(f"{segment}_o")]
            np.testing.assert_allclose(measured, motion.receivers.position_mm[:, number], atol=1e-6)


def with_rigid_receivers(motion: PosedRecording) -> PosedRecording:
    """Return the motion with receivers fixed rigidly to their bones, the last one invalid in two frames."""
    there = motion.receivers
    position_mm, turn = there.position_mm.copy(), there.quaternion.copy()
    segments = [joint.segment for joint in motion.joints]
    for number, segment in enumerate(there.segments):
        if segment in segments:
            bone = segments.index(segment)
            stuck = about_axis(unit(np.array([1.0, number, 2.0])), 0.2)
            turn[:, number] = multiply(motion.quaternion[:, bone], stuck)
            position_mm[:, number] = motion.position_mm[:, bone] + rotate(
                motion.quaternion[:, bone], np.array([1.0, 8.0, -15.0])
            )
    last = there.segments.index("little_distal")
    motion = replace(motion, receivers=replace(there, position_mm=position_mm, quaternion=turn))
    return blanked(motion, receivers=np.s_[4:6, last])


@pytest.mark.tools
def test_opensims_inverse_kinematics_gives_the_same_angles(
    hand: SimulatedHand, tmp_path: Path, export_tool: Callable[[str], Path]
) -> None:
    """From exact receivers of a fitted hand angles agree to 0.1 deg, except in frames without the last
    receiver; one frame without any receiver is left out.
    """
    motion = with_hinges(hand.ready(FITTED))
    motion = blanked(with_rigid_receivers(motion.take(slice(0, 240, 12))), receivers=11)
    write(motion, tmp_path / "hand.osim")
    seen = read_with_opensim(export_tool, tmp_path / "hand", "--ik")
    assert seen["ik_ran"]
    marked = np.delete(np.arange(20), 11)
    assert len(seen["ik_rms_m"]) == len(marked)
    assert seen["ik_rms_m"].max() < 1e-5
    theirs = seen["ik_values"][:, [seen["ik_coordinates"].tolist().index(n) for n in seen["mot_coordinates"]]]
    turns = [i for i, name in enumerate(seen["mot_coordinates"]) if not re.search("_t[xyz]$", str(name))]
    valid = motion.receivers.valid[marked, motion.receivers.segments.index("little_distal")]
    apart = (theirs - seen["mot_values"][marked])[np.ix_(np.flatnonzero(valid), turns)]
    assert np.isfinite(theirs).all()
    assert np.abs(apart).max() < 0.1
