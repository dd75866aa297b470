"""Anatomy: mid-bone receivers, mirrored hands, size from the hand's length, segments that nobody knows."""

import numpy as np
import pytest

from shukotsu.anatomy.average_hand import AVERAGE_LENGTH_MM
from shukotsu.schemas.layout import read_layout
from shukotsu.stages.solve_joints.hand_prior import MeasuredAxis, hand_prior
from shukotsu.stages.solve_joints.joint_prior import average_bones, joint_prior

LIBERTY = read_layout("liberty16")


def test_a_finger_joint_lies_between_two_mid_bone_receivers() -> None:
    prior = joint_prior(LIBERTY.joints["index_pip"], LIBERTY, average_bones("right"))
    np.testing.assert_allclose(prior.p_mm, [21.85, 0, -10.5], atol=1e-12)
    np.testing.assert_allclose(prior.q_mm, [-12.45, 0, -7.3], atol=1e-12)
    assert prior.axis_child is not None
    assert prior.axis_child[1] > 0.99


@pytest.mark.parametrize("joint", [j.name for j in LIBERTY.solvable if j.name != "wrist"])
def test_a_left_hand_is_the_mirror_image(joint: str) -> None:
    """Points lose the sign of y; axes, being pseudo-vectors, those of x and z."""
    right, left = (
        joint_prior(LIBERTY.joints[joint], LIBERTY, average_bones(hand)) for hand in ("right", "left")
    )
    point, axis = np.array([1, -1, 1]), np.array([-1, 1, -1])
    for name in ("p_mm", "q_mm", "p_fixed_mm", "sweep_mm"):
        np.testing.assert_allclose(getattr(left, name), point * getattr(right, name), atol=1e-12)
    for name in ("axis_parent", "axis_child"):
        np.testing.assert_allclose(getattr(left, name), axis * getattr(right, name), atol=1e-12)


def test_a_turned_receiver_is_told_by_its_axis() -> None:
    """An axis seen 6 deg aside turns the expected centre part of the way, and makes it surer."""
    joints = [LIBERTY.joints["index_pip"]]
    known = [joint_prior(joints[0], LIBERTY, average_bones("right"))]
    assert known[0].axis_child is not None
    assert known[0].axis_parent is not None
    yaw = np.radians(6)
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    axis = MeasuredAxis(known[0].axis_parent, turn @ known[0].axis_child, 0.02)
    before, after = (hand_prior(joints, known, [a], LIBERTY, None).block(0) for a in (None, axis))
    moved, whole = after[0][4] - before[0][4], (turn @ known[0].q_mm)[1]
    assert 0.2 < moved / whole < 0.8
    assert after[1][4, 4] < before[1][4, 4]


def test_hand_length_sets_the_size() -> None:
    joints = [LIBERTY.joints["index_pip"]]
    known = [joint_prior(joints[0], LIBERTY, average_bones("right"))]
    measured = hand_prior(joints, known, [None], LIBERTY, 1.2 * AVERAGE_LENGTH_MM)
    free = hand_prior(joints, known, [None], LIBERTY, None)
    assert measured.scale == pytest.approx(1.2)
    assert measured.scale_sd < free.scale_sd
    assert measured.block(0)[0][3] == pytest.approx(1.2 * free.block(0)[0][3])
