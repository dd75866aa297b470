"""Hinges without an anatomical plane, with receivers that turn on the skin."""

from dataclasses import replace

import numpy as np
import pytest
from chains import Chain, chain_layout, random_chain

from shukotsu.fit.fit import HandFit, fit_hand
from shukotsu.fit.hand_tables import joint_rows
from shukotsu.hand.rotations import Array, about_axis, multiply, unit
from shukotsu.study.layout import FINGER_MM
from shukotsu.study.verdict import NO, judged_joint
from shukotsu.tables.poses import Poses


def skin_turned(chain: Chain, sd_deg: float, seed: int) -> Poses:
    """Return the chain's poses with receivers that slowly turn on the skin about random axes."""
    rng = np.random.default_rng(seed)
    n_frames, n_segments = chain.poses.valid.shape
    white = rng.normal(size=(n_frames + 39, n_segments * 3))
    wander = np.stack([np.convolve(column, np.full(40, 40**-0.5), "valid") for column in white.T], -1)
    vectors = np.radians(sd_deg) * wander.reshape(n_frames, n_segments, 3)
    turns = about_axis(unit(vectors), np.linalg.norm(vectors, axis=-1))
    return replace(chain.poses, quaternion=multiply(chain.poses.quaternion, turns))


def along_axes(chain: Chain, fit: HandFit) -> tuple[Array, Array]:
    """Return the errors of the centres along their true axes and the stated sds along them, in mm."""
    errors, stated = [], []
    for index, joint in enumerate(chain.joints):
        axis, fitted = chain.axis_child[index], fit.joints[joint.name]
        errors.append((fitted.child_mm - chain.q_mm[index]) @ axis)
        stated.append(np.sqrt(axis @ fitted.covariance_mm2[3:, 3:] @ axis))
    return np.array(errors), np.array(stated)


@pytest.mark.parametrize("sd_deg", [0.0, 2.0])
def test_a_hinges_centre_is_reported_as_undetermined_along_its_axis(sd_deg: float) -> None:
    """Without an anatomical plane the stated sd along the axis is over 100 mm and covers the error, even when
    skin motion seems to determine the position.
    """
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
