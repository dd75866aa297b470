"""A BVH file holds the motion: read back by a reader that shares nothing with the writer."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand
from export_samples.minimal_bvh import Bvh, read_bvh
from export_samples.moving_fingers import moving_fingers, random_fingers
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stages.export.axes import UNITS_PER_MM, Target
from stages.export.bvh import AT_REST, euler_zyx_deg, write
from stages.export.motion import SkeletonMotion, rest_pose, stiffened

CM = Target("cm", "y")
NEAR_MM = 1e-4
"""A tenth of a micrometre; asked for is 10."""


def positions_mm(bvh: Bvh, motion: SkeletonMotion, unit: str = "cm") -> np.ndarray:
    """Positions (T, J, 3) that the file has for the motion's joints, tips among them."""
    names = [node.name for node in bvh.nodes]
    series = [
        bvh.series(joint.name) if joint.name in names else bvh.end(motion.names[joint.parent])
        for joint in motion.joints
    ]
    return np.stack(series, 1) / UNITS_PER_MM[unit]


def written(motion: SkeletonMotion, folder: Path, target: Target = CM) -> Bvh:
    write(motion, target, folder / "motion.bvh")
    return read_bvh(folder / "motion.bvh")


@pytest.mark.parametrize("model", [REPLAYED, FITTED])
@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_every_joint_is_where_the_motion_has_it(
    known: KnownHand, tmp_path: Path, model: str, unit: str
) -> None:
    motion = known.motion(model)
    motion = motion.take(motion.whole)
    bvh = written(motion, tmp_path, Target(unit, "y"))
    np.testing.assert_allclose(positions_mm(bvh, motion, unit), motion.position_mm, atol=NEAR_MM)
    assert bvh.frame_time_s == pytest.approx(1 / 240, abs=1e-9)


def test_bones_turn_as_the_motion_has_it(known: KnownHand, tmp_path: Path) -> None:
    """A bone of the file stands as at rest, turned by what the motion's bone turned since rest."""
    motion = known.motion(FITTED)
    bvh = written(motion, tmp_path)
    rest = Rotation.from_quat(np.roll(rest_pose(motion)[1], -1, -1))
    names = [node.name for node in bvh.nodes]
    for index, joint in enumerate(motion.joints):
        if joint.name in names and not joint.tip:
            file = bvh.rotation[names.index(joint.name)] * rest[index]
            ours = Rotation.from_quat(np.roll(motion.quaternion[:, index], -1, -1))
            assert (file.inv() * ours).magnitude().max() < 1e-8


def test_the_hierarchy_is_the_skeleton_at_rest(known: KnownHand, tmp_path: Path) -> None:
    motion = known.motion(FITTED)
    bvh = written(motion, tmp_path)
    place = np.zeros((len(bvh.nodes), 3))
    for index, node in enumerate(bvh.nodes[1:], 1):
        place[index] = place[node.parent] + node.offset
    rest = rest_pose(motion)[0]
    for index, node in enumerate(bvh.nodes):
        if node.name and not node.name.endswith(AT_REST):
            np.testing.assert_allclose(10 * place[index], rest[motion.index(node.name)], atol=1e-5)


def test_stiff_bones_need_rotations_only(known: KnownHand, tmp_path: Path) -> None:
    motion = stiffened(known.motion(FITTED))
    bvh = written(motion, tmp_path)
    assert [len(node.channels) for node in bvh.nodes if node.name] == [6] + [3] * 24
    assert sum(not node.name for node in bvh.nodes) == 5, "the skin's ends are end sites"
    np.testing.assert_allclose(positions_mm(bvh, motion), motion.position_mm, atol=NEAR_MM)


def test_joints_that_move_have_positions_and_it_is_said(tmp_path: Path) -> None:
    still, moving = moving_fingers(20), moving_fingers(20, slip_mm=0.5)
    assert write(still, CM, tmp_path / "still.bvh") == ()
    (said,) = write(moving, CM, tmp_path / "moving.bvh")
    assert said.startswith("a skeleton of rotations alone: 5 joints move against the bone before")
    named = [node for node in read_bvh(tmp_path / "moving.bvh").nodes if node.name]
    assert [len(node.channels) for node in named] == [6] + [3, 6] * 5


def test_positions_and_offsets_never_meet(known: KnownHand, tmp_path: Path) -> None:
    """Programs that add positions to the OFFSET and those that put them in its place read the same."""
    motion = known.motion(REPLAYED)
    bvh = written(motion.take(motion.whole), tmp_path)
    for node in bvh.nodes:
        assert not ("Xposition" in node.channels and node.offset.any()), node.name
    column = 0
    for node in bvh.nodes:
        if node.name.endswith(AT_REST):
            assert not bvh.numbers[:, column : column + 3].any(), "it never turns"
        column += len(node.channels)


@settings(max_examples=12)
@given(st.integers(1, 40), st.integers(0, 2**31), st.sampled_from([0.0, 0.7]))
def test_any_motion_comes_back(
    tmp_path_factory: pytest.TempPathFactory, n: int, seed: int, slip: float
) -> None:
    motion = random_fingers(n, seed, slip)
    motion = motion if slip else stiffened(motion)
    bvh = written(motion, tmp_path_factory.mktemp("any"))
    np.testing.assert_allclose(positions_mm(bvh, motion), motion.position_mm, atol=NEAR_MM)


def test_one_frame_has_a_frame_time(tmp_path: Path) -> None:
    motion = replace(moving_fingers(1), rate_hz=np.nan)
    bvh = written(motion, tmp_path)
    assert len(bvh.numbers) == 1
    assert bvh.frame_time_s == pytest.approx(1 / 60)
    np.testing.assert_allclose(positions_mm(bvh, motion), motion.position_mm, atol=NEAR_MM)


def test_angles_run_on_and_never_jump(tmp_path: Path) -> None:
    """Also of a bone that bends beyond a right angle and a root that spins beyond half a turn."""
    motion = moving_fingers(600)
    bvh = written(motion, tmp_path)
    assert np.abs(np.diff(bvh.numbers[:, 3:], axis=0)).max() < 40
    assert np.abs(bvh.numbers[:, 3:]).max() > 180


@given(st.floats(-np.pi, np.pi), st.floats(-np.pi, np.pi), st.sampled_from([90.0, -90.0]))
def test_at_a_right_angle_the_rotation_comes_back(z: float, x: float, y_deg: float) -> None:
    rotation = Rotation.from_euler("ZYX", [[z, np.radians(y_deg), x]])
    found = euler_zyx_deg(np.roll(rotation.as_quat(), 1, -1)[:, None])[:, 0]
    assert (rotation.inv() * Rotation.from_euler("ZYX", found, degrees=True)).magnitude().max() < 1e-7


def test_numbers_have_their_decimals(tmp_path: Path) -> None:
    write(moving_fingers(3), CM, tmp_path / "a.bvh")
    text = (tmp_path / "a.bvh").read_text("ascii")
    assert all(len(word.partition(".")[2]) >= 6 for word in re.findall(r"-?\d+\.\d+", text))
    assert "Frame Time: 0.0100000000\n" in text
    assert "e-" not in text.partition("MOTION")[2]


def test_uneven_times_are_told(tmp_path: Path) -> None:
    motion = moving_fingers(50)
    time_s = motion.time_s.copy()
    time_s[30:] += 0.02
    (said,) = write(replace(motion, time_s=time_s), CM, tmp_path / "a.bvh")
    assert "up to 20.0 ms off the even Frame Time" in said


def test_names_without_ascii_are_written(tmp_path: Path) -> None:
    motion = moving_fingers(3)
    joints = (*motion.joints[:4], replace(motion.joints[4], name="小指 1"), motion.joints[5])
    bvh = written(replace(motion, joints=joints), tmp_path)
    assert "_u5c0f_u6307_u00201" in [node.name for node in bvh.nodes]
