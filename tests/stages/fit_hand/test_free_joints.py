"""Joints without anatomy: hinges whose skin turns."""

from dataclasses import replace

import numpy as np
import pytest
from chains import Chain, chain_layout, random_chain

from schemas.layout import FINGER_MM
from schemas.poses import Poses
from schemas.verdict import NO, judged_joint
from skeleton.rotations import Array, about_axis, multiply, rotate, unit
from stages.fit_hand.fit import HandFit, fit_hand
from stages.fit_hand.hand_tables import joint_rows


def skin_turned(chain: Chain, sd_deg: float, seed: int) -> Poses:
    """The chain's recording with receivers that slowly turn on the skin, about any axis."""
    rng = np.random.default_rng(seed)
    n_frames, n_segments = chain.poses.valid.shape
    white = rng.normal(size=(n_frames + 39, n_segments * 3))
    wander = np.stack([np.convolve(column, np.full(40, 40**-0.5), "valid") for column in white.T], -1)
    vectors = np.radians(sd_deg) * wander.reshape(n_frames, n_segments, 3)
    turns = about_axis(unit(vectors), np.linalg.norm(vectors, axis=-1))
    return replace(chain.poses, quaternion=multiply(chain.poses.quaternion, turns))


def along_axes(chain: Chain, fit: HandFit) -> tuple[Array, Array]:
    """Errors of the centres along their true axes, and the stated sds of them."""
    errors, stated = [], []
    for index, joint in enumerate(chain.joints):
        axis, found = chain.axis_child[index], fit.joints[joint.name]
        errors.append((found.child_mm - chain.q_mm[index]) @ axis)
        stated.append(np.sqrt(axis @ found.covariance_mm2[3:, 3:] @ axis))
    return np.array(errors), np.array(stated)


@pytest.mark.parametrize("sd_deg", [0.0, 2.0])
def test_nothing_says_where_on_its_axis_a_hinge_is(sd_deg: float) -> None:
    """Without a plane the stated sd along the axis is within reach, not what skin's turning seems to show."""
    chain = random_chain(5, 4, 300, noise_mm=0.2)
    layout = chain_layout(chain)
    joints = {
        name: replace(joint, plane=replace(joint.plane, frame="none"))
        for name, joint in layout.joints.items()
    }
    fit = fit_hand([skin_turned(chain, sd_deg, 1)], replace(layout, joints=joints), "right")
    errors, stated = along_axes(chain, fit)
    assert stated.min() > 100
    assert (np.abs(errors) < 2 * stated).all()
    rows = [judged_joint(row, FINGER_MM) for row in joint_rows(fit)]
    assert {(row["verdict"], row["reason"]) for row in rows} == {(NO, "uncertain-in-one-direction")}


@pytest.mark.slow
def test_a_plane_says_it_as_well_as_receivers_sit() -> None:
    """Receivers a little beside the bone and turned on it: the farther the joint, the larger the stated sd,
    and the sd covers the truth.
    """
    far: dict[float, list[float]] = {}
    ratio: list[float] = []
    for reach_mm in (20.0, 150.0):
        for seed in range(6):
            chain = random_chain(seed, 4, 300, noise_mm=0.2)
            rng = np.random.default_rng(seed)
            q_mm = np.tile([-reach_mm, 0.0, 0.0], (3, 1))
            off = q_mm - chain.q_mm
            beside = rng.normal(size=(3, 3)) * [0.0, 1.6, 0.0] + reach_mm * np.radians(3.5) * (
                rng.normal(size=(3, 3)) * [0.0, 1.0, 0.0]
            )
            moved = receivers_moved(chain, off + beside)
            fit = fit_hand([moved.poses], chain_layout(moved), "right")
            errors, stated = along_axes(moved, fit)
            ratio += list(errors / stated)
            far.setdefault(reach_mm, []).append(float(np.median(stated)))
    assert np.median(far[20.0]) < 4
    assert np.median(far[150.0]) > 2.5 * np.median(far[20.0])
    assert 0.5 < np.std(ratio) < 1.5


def receivers_moved(chain: Chain, by_mm: Array) -> Chain:
    """Every child's receiver moved so that its joint's centre is by_mm (J, 3) elsewhere in its frame."""
    position, p_mm = chain.poses.position_mm.copy(), chain.p_mm.copy()
    for joint, move in enumerate(by_mm):
        position[:, joint + 1] -= rotate(chain.poses.quaternion[:, joint + 1], move)
    for joint in range(1, len(by_mm)):
        p_mm[joint] += by_mm[joint - 1]
    return replace(
        chain, poses=replace(chain.poses, position_mm=position), p_mm=p_mm, q_mm=chain.q_mm + by_mm
    )
