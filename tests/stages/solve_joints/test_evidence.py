"""A joint's frames as evidence: hinges leave their axis open, neighbours that move skin lower the trust."""

import numpy as np
import pytest

from shukotsu.schemas.layout import read_layout
from shukotsu.skeleton.rotations import about_axis, matrix, multiply
from shukotsu.stages.solve_joints.evidence import (
    JointEvidence,
    Neighbour,
    joint_evidence,
    weigh,
)
from shukotsu.stages.solve_joints.hand_posterior import Information
from shukotsu.stages.solve_joints.joint_prior import average_bones, joint_prior
from shukotsu.stages.solve_joints.posture_sample import SpreadFrames

LIBERTY = read_layout("liberty16")
ANGLE = np.radians(30) * np.sin(np.linspace(0, 12, 400))
LATERAL, DORSAL = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


def evidence(name: str, second_deg: float = 0.0) -> JointEvidence:
    """The joint of an average right hand, turning about its lateral axis and, less, about the dorsal one."""
    prior = joint_prior(LIBERTY.joints[name], LIBERTY, average_bones("right"))
    aside = np.radians(second_deg) * np.cos(np.linspace(0, 19, 400))
    quaternion = multiply(about_axis(LATERAL, ANGLE), about_axis(DORSAL, aside))
    position_mm = prior.p_fixed_mm + prior.p_mm - matrix(quaternion) @ prior.q_mm
    frames = SpreadFrames(quaternion, position_mm, np.zeros((400, 0, 4)), np.zeros(400, bool))
    return joint_evidence(LIBERTY.joints[name], prior, frames, LATERAL)


def told_by(own: JointEvidence, looseness: float = 1.0) -> Information:
    centre_mm = np.concatenate([own.prior.p_fixed_mm + own.prior.p_mm, own.prior.q_mm])
    return weigh(own, centre_mm, LIBERTY, looseness, 8.0)


def test_a_hinge_says_nothing_along_its_axis() -> None:
    """The same joint says something there once it turns about a second axis."""
    for second_deg, dof in ((2.0, 1), (12.0, 2)):
        own = evidence("index_mcp", second_deg)
        assert own.dof == dof
        along = np.concatenate([own.motion.axis_parent, own.motion.axis_child]) / np.sqrt(2)
        told = told_by(own).matrix
        assert np.all(np.linalg.eigvalsh(told) > -1e-9)
        if dof == 1:
            np.testing.assert_allclose(told @ along, 0, atol=1e-9)
        else:
            assert along @ told @ along > 0.01


@pytest.mark.parametrize("side", ["before", "after"])
def test_neighbours_that_move_in_step_lower_the_trust(side: str) -> None:
    """A neighbour whose skin moves with the joint hides a slide; one that stands still takes nothing."""
    alone = told_by(evidence("index_pip")).matrix
    for amount, gone in ((0.0, False), (1.0, True)):
        own = evidence("index_pip")
        own.neighbours[side] = Neighbour(amount * ANGLE[:, None] * LATERAL, amount * ANGLE)
        told = told_by(own).matrix
        assert np.all(np.linalg.eigvalsh(alone - told) > -1e-9)
        weakest = np.linalg.eigvalsh(told)[1] / np.linalg.eigvalsh(alone)[1]  # beside the open axis
        assert (weakest < 0.85) == gone


def test_the_thumbs_receiver_under_reads_its_metacarpal() -> None:
    """Seen from a receiver that follows 80 % of the CMC, the MCP comes out where it is; without that, not."""
    cmc = np.radians(25) * np.cos(np.linspace(0, 31, 400))
    turn = cmc[:, None] * LATERAL
    errors = []
    for neighbours in ({}, {"before": Neighbour(turn, cmc)}):
        own = evidence("thumb_mcp")
        lever = np.array([2 * own.prior.p_mm[0], 0, 0])
        moved_mm = own.frames.position_mm + 0.2 * np.cross(turn, lever)
        own.frames = SpreadFrames(own.frames.quaternion, moved_mm, own.frames.other, own.frames.lone)
        own.neighbours |= neighbours
        told_by(own)
        errors.append(own.scatter_mm)
    assert errors[1] == pytest.approx(0.3)  # the least there is
    assert errors[0] > 2 * errors[1]


def test_an_axis_is_trusted_by_its_motion() -> None:
    """A large motion tells the axis to some degrees; one that the neighbours' skin explains, nothing."""
    own = evidence("index_dip")
    axis = own.measured_axis()
    assert axis is not None
    assert axis.sd_rad < np.radians(5)
    np.testing.assert_allclose(axis.child, LATERAL, atol=1e-6)
    own.motion.spread_rad[0] = np.radians(0.5)
    assert own.measured_axis() is None
    own.motion.spread_rad[0] = np.radians(2)
    own.neighbours["before"] = Neighbour(np.zeros((400, 3)), 2.0 * ANGLE)
    assert own.measured_axis() is None
