"""BVH export: continuous angles, names, and joint positions as other programs read them."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_fingers import moving_fingers
from program_files import printed_by
from scipy.spatial.transform import Rotation
from simulated_hands import FITTED, REPLAYED, SimulatedHand

from shukotsu.export.bvh import AT_REST, TURN_AXES, write
from shukotsu.export.registry import ExportSettings, prepare, write_format
from shukotsu.hand.rotations import turn_angles


@given(st.integers(0, 2**32 - 1))
def test_angles_reproduce_the_rotations_and_are_continuous(seed: int) -> None:
    """Random motions in small steps have angles that equal the rotations and change by less than 60 deg per
    frame except where the second angle is near a right angle.
    """
    rng = np.random.default_rng(seed)
    steps = Rotation.from_rotvec(rng.normal(size=(200, 3)) * 0.02)
    turns = [Rotation.random(random_state=rng)]
    for step in steps:
        turns.append(turns[-1] * step)
    turn = Rotation.concatenate(turns)
    angles = np.degrees(turn_angles(turn.as_quat(scalar_first=True), TURN_AXES))
    back = Rotation.from_euler("ZYX", angles, degrees=True)
    assert np.degrees((turn.inv() * back).magnitude()).max() < 1e-9
    steep = np.abs(np.cos(np.radians(angles[:, 1]))) < 0.2
    calm = ~(steep[1:] | steep[:-1])
    assert not calm.any() or np.abs(np.diff(angles, axis=0))[calm].max() < 60
    assert np.abs(angles[0, 1]) <= 90


def test_a_file_has_ascii_names_and_continuous_angles(tmp_path: Path) -> None:
    """A bone bends beyond a right angle and the root turns beyond half a turn."""
    motion = moving_fingers(600)
    joints = (*motion.joints[:4], replace(motion.joints[4], name="小指 1"), motion.joints[5])
    write(replace(motion, joints=joints), tmp_path / "motion.bvh")
    hierarchy, _, frames = (tmp_path / "motion.bvh").read_text("ascii").partition("MOTION\n")
    assert "JOINT _u5c0f_u6307_u00201\n" in hierarchy
    numbers = np.loadtxt(frames.splitlines()[2:])
    np.testing.assert_allclose(numbers[:, :3], motion.position_mm[:, 0] / 10, atol=1e-6)
    assert np.abs(np.diff(numbers[:, 3:], axis=0)).max() < 40
    assert np.abs(numbers[:, 3:]).max() > 180


READERS = Path(__file__).resolve().parents[1] / "export_tools"
NEAR_M = 1e-5
ExportTool = Callable[[str], Path]


def read_with(program: str, export_tool: ExportTool, file: Path) -> Any:
    """Return the series of joints and of bone ends that a program reads from a file, by name."""
    if program == "blender":
        python = export_tool("blender/bin/python")
        content = json.loads(printed_by(python, READERS / "read_with_blender.py", file, "0"))
        return {kind: next(iter(content[kind].values())) for kind in ("joints", "ends")}
    modules = export_tool("node_modules/three").parents[1]
    out = file.with_suffix(".json")
    printed_by("node", READERS / "read_with_three.mjs", modules, file, out)
    return json.loads(out.read_text("utf-8"))


@pytest.mark.tools
@pytest.mark.parametrize("model", [REPLAYED, FITTED])
@pytest.mark.parametrize("program", ["three", "blender"])
@pytest.mark.parametrize("stiff", [True, False])
def test_other_programs_read_every_joint_at_its_position(
    hand: SimulatedHand, tmp_path: Path, export_tool: ExportTool, program: str, stiff: bool, model: str
) -> None:
    settings = ExportSettings(stiff=stiff, gaps="cut", rig="webxr")
    motion = hand.motion(model)
    write_format(motion, settings, "bvh", tmp_path / "motion.bvh")
    expected = prepare(motion, settings, holds_gaps=False, up="y")
    content = read_with(program, export_tool, tmp_path / "motion.bvh")
    tips = {expected.names[joint.parent]: joint.name for joint in expected.joints if joint.tip}
    series = content["joints"] | {
        tips[name]: end for name, end in content["ends"].items() if name in tips and end
    }
    assert {name for name in series if not name.endswith(AT_REST)} == set(expected.names)
    for index, name in enumerate(expected.names):
        off_m = np.abs(np.array(series[name]) / 100 - expected.position_mm[:, index] / 1000)
        assert off_m.shape == (len(expected.frame), 3)
        assert off_m.max() < NEAR_M, name
