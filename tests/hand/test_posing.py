"""Posing bones, against scipy's rotations on random skeletons."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from chains import as_poses
from scipy.spatial.transform import Rotation

from shukotsu.hand.posing import PosedRecording, Skeleton, digit_points, fitted_bones, receiver_bones
from shukotsu.hand.rotations import about_axis, conjugate, multiply, rotate
from shukotsu.study.layout import read_layout
from shukotsu.study.model import read_model
from shukotsu.tables.poses import Poses
from shukotsu.tables.typed_table import vector_columns, vector_of

N_FRAMES = 30
LAYOUT = read_layout("liberty16")
REPLAYED, FITTED = read_model("paper-fig4"), read_model("whole-hand")
X, Y, Z = np.eye(3)


def random_poses() -> Poses:
    """Return random poses of receivers, independent in every frame."""
    rng, shape = np.random.default_rng(1), (N_FRAMES, len(LAYOUT.measured))
    turn = Rotation.random(np.prod(shape), random_state=rng).as_quat(scalar_first=True)
    return as_poses(LAYOUT.measured, rng.normal(size=(*shape, 3)) * 100, turn.reshape(*shape, 4))


def random_skeleton() -> Skeleton:
    """Return a skeleton of the paper's Fig. 4 with random points in the receivers' frames."""
    rng = np.random.default_rng(2)
    joints: dict[str, dict[str, Any]] = {}
    for joint in LAYOUT.solvable:
        joints[joint.name] = {
            "parent_segment": joint.parent_receiver,
            "child_segment": joint.child,
            "dof": joint.dof,
            "status": "ok",
            "message": "",
            **vector_columns("parent_", rng.normal(size=3) * 20, "_mm"),
            **vector_columns("child_", rng.normal(size=3) * 20, "_mm"),
            **vector_columns("axis_child_", Y),
        }
    bones: dict[tuple[str, str], dict[str, Any]] = {}
    for digit in LAYOUT.digits.values():
        for index, segment in enumerate(digit.segments):
            vector = rng.normal(size=3) * 10 + 30 * X
            row = {"bone": segment, "length_mm": float(np.linalg.norm(vector)), "driven_by": ""}
            row |= dict.fromkeys(("x_mm", "y_mm", "z_mm"))
            if index > 0:
                row |= {"driven_by": segment} | vector_columns("", vector, "_mm")
            bones[digit.name, segment] = row
    return Skeleton(LAYOUT, REPLAYED, joints, bones)


def random_metacarpals() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    return {
        name: Rotation.random(N_FRAMES, random_state=rng).as_quat(scalar_first=True) for name in LAYOUT.digits
    }


def carried(poses: Poses, segment: str, point: Any) -> np.ndarray:
    index = poses.index(segment)
    turn = Rotation.from_quat(poses.quaternion[:, index], scalar_first=True)
    return np.asarray(turn.apply(np.array(point, float)) + poses.position_mm[:, index])


@pytest.fixture
def replayed() -> tuple[Skeleton, Poses, dict[str, np.ndarray], PosedRecording]:
    skeleton, poses, metacarpals = random_skeleton(), random_poses(), random_metacarpals()
    return skeleton, poses, metacarpals, receiver_bones(skeleton, poses, metacarpals)


def test_joints_move_rigidly_with_their_receivers(
    replayed: tuple[Skeleton, Poses, dict[str, np.ndarray], PosedRecording],
) -> None:
    """They are at the child's centres q; fingers start at the wrist, the thumb at the CMC joint's centre
    p.
    """
    skeleton, poses, _, bones = replayed
    for index, joint in enumerate(bones.joints):
        segment, point = joint.segment, np.zeros(3)
        if not joint.tip:
            name = "wrist" if joint.parent == 0 and joint.name != "thumb_cmc" else joint.name
            side = "parent" if name == "thumb_cmc" else "child"
            row = skeleton.joints[name]
            segment, point = row[f"{side}_segment"], vector_of(row, f"{side}_", "_mm")
        position_mm = carried(poses, segment, point)
        np.testing.assert_allclose(bones.position_mm[:, index], position_mm, atol=1e-9, err_msg=joint.name)
    assert len(bones.joints) == 25
    assert bones.parents[bones.index("ring_pip")] == bones.index("ring_mcp")


def test_bone_frames_have_x_along_the_bone_and_z_dorsal(
    replayed: tuple[Skeleton, Poses, dict[str, np.ndarray], PosedRecording],
) -> None:
    skeleton, poses, metacarpals, bones = replayed
    for index, joint in enumerate(bones.joints):
        if joint.tip or not joint.digit:
            continue
        row = skeleton.bones[joint.digit, joint.segment]
        if row["driven_by"]:
            vector = vector_of(row, "", "_mm")
            turn = Rotation.from_quat(poses.quaternion[:, poses.index(joint.segment)], scalar_first=True)
            x, z = (rotate(bones.quaternion[:, index], axis) for axis in (X, Z))
            np.testing.assert_allclose(x, turn.apply(vector / row["length_mm"]), atol=1e-12)
            assert (np.sum(z * turn.apply(LAYOUT.segments[joint.segment].dorsal), -1) > 0.5).all()
        else:
            np.testing.assert_array_equal(bones.quaternion[:, index], metacarpals[joint.digit])
        np.testing.assert_array_equal(bones.rest_offset_mm[index + 1], [row["length_mm"], 0, 0])
        if joint.dof == 1:
            world = rotate(poses.quaternion[:, poses.index(joint.segment)], Y)
            np.testing.assert_allclose(
                rotate(bones.quaternion[:, index], bones.axis[index]), world, atol=1e-12
            )


def test_a_digit_with_a_failed_joint_is_left_out_with_the_reason() -> None:
    skeleton = random_skeleton()
    skeleton.joints["ring_dip"] |= {"status": "failed", "message": "too few frames (3)"}
    bones = receiver_bones(skeleton, random_poses(), random_metacarpals())
    assert bones.left_out == {"ring": "ring_dip failed: too few frames (3)"}
    assert len(bones.joints) == 20
    assert bones.joints[bones.index("little_pip")].parent == bones.index("little_mcp")
    points = digit_points(LAYOUT.digits["ring"], LAYOUT, REPLAYED, skeleton.joints)
    assert [point.name for point in points] == ["wrist", "ring_mcp", "ring_pip", "ring_dip", "ring_tip"]
    assert [bool(point.segment) for point in points] == [True, True, True, False, True], (
        "the other points are known"
    )


def fitted_motion(amplitude_deg: float) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return random bone poses and tips: the middle finger's bones turn about fixed axes, the others do not
    move.
    """
    rng = np.random.default_rng(5)
    swing = np.radians(amplitude_deg) / 2 * np.sin(np.linspace(0, 9, N_FRAMES))
    poses: dict[str, np.ndarray] = {}
    start = Rotation.random(N_FRAMES, random_state=rng).as_quat(scalar_first=True)
    for segment in ("hand", *(s for digit in LAYOUT.digits.values() for s in digit.segments)):
        turn = start if not segment.startswith("middle") else multiply(start, about_axis(Y, swing))
        if segment == "middle_middle":
            turn = multiply(turn, about_axis(np.array([0.6, 0.8, 0.0]), swing))
        poses[segment] = np.concatenate([rng.normal(size=(N_FRAMES, 3)), turn], 1)
    tips = {name: rng.normal(size=(N_FRAMES, 3)) for name in LAYOUT.digits}
    return poses, tips


def test_a_fitted_hand_is_posed_as_in_its_tables() -> None:
    skeleton, motion = replace(random_skeleton(), model=FITTED), fitted_motion(40)
    bones = fitted_bones(skeleton, random_poses(), *motion)
    for index, joint in enumerate(bones.joints):
        if joint.tip:
            np.testing.assert_array_equal(bones.position_mm[:, index], motion[1][joint.digit])
            np.testing.assert_array_equal(bones.quaternion[:, index], bones.quaternion[:, joint.parent])
        else:
            both = np.concatenate([bones.position_mm[:, index], bones.quaternion[:, index]], 1)
            np.testing.assert_array_equal(both, motion[0][joint.segment])
    assert len(bones.joints) == 25
    assert not bones.left_out


def test_a_fitted_hinges_axis_is_that_of_its_motion() -> None:
    skeleton, poses = replace(random_skeleton(), model=FITTED), random_poses()
    motion = fitted_motion(40)
    bones = fitted_bones(skeleton, poses, *motion)
    index = bones.index("middle_pip")
    above, below = bones.quaternion[:, bones.parents[index]], bones.quaternion[:, index]
    turned = multiply(conjugate(above), below)
    np.testing.assert_allclose(rotate(turned, bones.axis[index]) - bones.axis[index], 0, atol=1e-9)
    np.testing.assert_allclose(np.abs(bones.axis[index]), [0.6, 0.8, 0], atol=1e-9)
    assert np.isnan(bones.axis[bones.index("index_pip")]).all(), "it does not move"
    still = fitted_motion(0.5)
    assert np.isnan(fitted_bones(skeleton, poses, *still).axis[index]).all()
