"""A BVH file holds the motion: read back by a reader that shares nothing with the writer."""

from __future__ import annotations

import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand
from export_samples.made_motion import made_motion
from export_samples.minimal_bvh import Bvh, read_bvh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from kinematics.rotations import angle, conjugate, multiply
from schemas.errors import InputError
from stages.export.axes import UNITS_PER_MM
from stages.export.bvh import AT_REST, euler_zyx_deg, write
from stages.export.formats import Target
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
    assert [len(node.channels) for node in bvh.nodes if node.name] == [6] + [3] * 19
    assert sum(not node.name for node in bvh.nodes) == 5, "tips are end sites"
    np.testing.assert_allclose(positions_mm(bvh, motion), motion.position_mm, atol=NEAR_MM)


def test_joints_that_move_have_positions_and_it_is_said(tmp_path: Path) -> None:
    still, moving = made_motion(20), made_motion(20, slip_mm=0.5)
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


def test_left_is_left(known: KnownHand, tmp_path: Path) -> None:
    """At rest and in motion the thumb is on the left of a right hand, seen from its back."""
    motion = known.motion(FITTED)
    bvh = written(motion, tmp_path)
    side = -1 if known.recording.hand.hand == "right" else 1
    thumb = next(node for node in bvh.nodes if node.name == f"thumb_cmc{AT_REST}")
    assert np.sign(thumb.offset[0]) == side
    seen = bvh.rotation[0].inv().apply(bvh.series("thumb_cmc") - bvh.series("wrist"))
    assert (np.sign(seen[:, 0]) == side).all()


@given(st.integers(1, 40), st.integers(0, 2**31), st.sampled_from([0.0, 0.7]))
def test_any_motion_comes_back(
    tmp_path_factory: pytest.TempPathFactory, n: int, seed: int, slip: float
) -> None:
    motion = made_motion(n, seed=seed % 1000, slip_mm=slip)
    turns = Rotation.random(n * 6, random_state=seed).as_quat().reshape(n, 6, 4)
    motion = replace(motion, quaternion=np.roll(turns, 1, -1))
    motion = motion if slip else stiffened(motion)
    bvh = written(motion, tmp_path_factory.mktemp("any"))
    np.testing.assert_allclose(positions_mm(bvh, motion), motion.position_mm, atol=NEAR_MM)


def test_one_frame_has_a_frame_time(tmp_path: Path) -> None:
    motion = replace(made_motion(1), rate_hz=np.nan)
    bvh = written(motion, tmp_path)
    assert len(bvh.numbers) == 1
    assert bvh.frame_time_s == pytest.approx(1 / 60)
    np.testing.assert_allclose(positions_mm(bvh, motion), motion.position_mm, atol=NEAR_MM)


def test_angles_run_on_and_never_jump(tmp_path: Path) -> None:
    """Also of a bone that bends beyond a right angle and a root that spins beyond half a turn."""
    motion = made_motion(600)
    bvh = written(motion, tmp_path)
    assert np.abs(np.diff(bvh.numbers[:, 3:], axis=0)).max() < 40
    assert np.abs(bvh.numbers[:, 3:]).max() > 180


@given(st.floats(-np.pi, np.pi), st.floats(-np.pi, np.pi), st.sampled_from([90.0, -90.0]))
def test_at_a_right_angle_the_rotation_comes_back(z: float, x: float, y_deg: float) -> None:
    rotation = Rotation.from_euler("ZYX", [[z, np.radians(y_deg), x]])
    found = euler_zyx_deg(np.roll(rotation.as_quat(), 1, -1)[:, None])[:, 0]
    assert (rotation.inv() * Rotation.from_euler("ZYX", found, degrees=True)).magnitude().max() < 1e-7


@given(
    arrays(float, (30, 3), elements=st.floats(-0.3, 0.3)),
    arrays(float, 3, elements=st.floats(-np.pi, np.pi)),
)
def test_euler_angles_are_the_rotation_and_the_nearer_of_two(steps: np.ndarray, start: np.ndarray) -> None:
    rotation = Rotation.from_euler("ZYX", start + np.cumsum(steps, 0))
    found = euler_zyx_deg(np.roll(rotation.as_quat(), 1, -1)[:, None])[:, 0]
    again = Rotation.from_euler("ZYX", found, degrees=True)
    assert (rotation.inv() * again).magnitude().max() < 1e-7
    here = np.radians(found)
    other = here * [1, -1, 1] + np.pi

    def apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi).sum(-1)

    assert (apart(here[1:], here[:-1]) <= apart(other[1:], here[:-1]) + 1e-6).all()
    assert (np.abs(np.diff(found, axis=0)) <= 180 + 1e-6).all()


def test_numbers_have_their_decimals(tmp_path: Path) -> None:
    write(made_motion(3), CM, tmp_path / "a.bvh")
    text = (tmp_path / "a.bvh").read_text("ascii")
    assert all(len(word.partition(".")[2]) >= 6 for word in re.findall(r"-?\d+\.\d+", text))
    assert "Frame Time: 0.0100000000\n" in text
    assert "e-" not in text.partition("MOTION")[2]


def test_a_pose_that_is_missing_is_refused_and_no_file_left(tmp_path: Path) -> None:
    motion = made_motion(5)
    position = motion.position_mm.copy()
    position[2, 3, 1] = np.nan
    for bad in (replace(motion, position_mm=position), motion.take(slice(0, 0))):
        with pytest.raises(InputError, match="BVH holds no frame without a pose"):
            write(bad, CM, tmp_path / "a.bvh")
    with pytest.raises(InputError, match="say it with --rate-hz"):
        write(replace(motion, rate_hz=np.nan), CM, tmp_path / "a.bvh")
    assert not list(tmp_path.iterdir())


def test_uneven_times_are_told(tmp_path: Path) -> None:
    motion = made_motion(50)
    time_s = motion.time_s.copy()
    time_s[30:] += 0.02
    (said,) = write(replace(motion, time_s=time_s), CM, tmp_path / "a.bvh")
    assert "up to 20.0 ms off the even Frame Time" in said


def test_names_without_ascii_are_written(tmp_path: Path) -> None:
    motion = made_motion(3)
    joints = (*motion.joints[:4], replace(motion.joints[4], name="小指 1"), motion.joints[5])
    bvh = written(replace(motion, joints=joints), tmp_path)
    assert "_u5c0f_u6307_u00201" in [node.name for node in bvh.nodes]


@pytest.mark.slow
def test_a_hundred_thousand_frames_take_seconds(tmp_path: Path) -> None:
    motion = made_motion(100_000, slip_mm=0.5)
    started = time.perf_counter()
    write(motion, CM, tmp_path / "a.bvh")
    assert time.perf_counter() - started < 30
    with (tmp_path / "a.bvh").open("rb") as stream:
        assert sum(1 for _ in stream) > 100_000


def test_the_motion_is_left_as_it_was(tmp_path: Path) -> None:
    motion = made_motion(10, slip_mm=0.5)
    place, turn = motion.position_mm.copy(), motion.quaternion.copy()
    write(motion, CM, tmp_path / "a.bvh")
    np.testing.assert_array_equal(motion.position_mm, place)
    assert angle(multiply(conjugate(motion.quaternion), turn)).max() < 1e-12
