"""The error that no frame shows: as large as what sliding skin does, and what makes it grow."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from chains import chain_layout, moments_of, random_chain

from shukotsu.hand.average_hand import UNKNOWN_SLIDE_SD_MM
from shukotsu.hand.rotations import rotate
from shukotsu.paper.closed import solve_closed
from shukotsu.paper.place import NEIGHBOUR_RANGE_DEG, unseen_covariance
from shukotsu.paper.plane import Projection, centre_sd_mm
from shukotsu.study.layout import read_layout

HAND = read_layout("liberty16")


def test_skin_in_step_with_a_hinge_moves_its_solved_centre_by_what_is_stated() -> None:
    """Both receivers slide at random, 2 mm per rad each way, over 300 trials."""
    chain = random_chain(5, 2, 200, range_rad=0.15)
    poses, joint = chain.poses, replace(chain.joints[0], plane=replace(chain.joints[0].plane, frame="none"))
    free = solve_closed(moments_of(chain), 0, 5)
    along = np.stack([poses.quaternion[:, 0], poses.quaternion[:, 1]], 1)
    rng, off = np.random.default_rng(0), []
    angle_rad = _hinge_angle(chain)
    for _ in range(300):
        slide = rng.normal(0, UNKNOWN_SLIDE_SD_MM, (2, 3))
        moved = poses.position_mm + rotate(along, angle_rad[:, None, None] * slide)
        solution = solve_closed(moments_of(chain, replace(poses, position_mm=moved)), 0, 5)
        across = solution.q_mm - free.q_mm
        off.append(across - across @ free.null_child * free.null_child)
    placed = Projection(free.p_mm, free.q_mm, 0.0, None, np.zeros((6, 6)))
    axes = free.null_parent, free.null_child
    stated = unseen_covariance(
        joint, chain_layout(chain), placed, axes, free.mean_rotation, 0.0, NEIGHBOUR_RANGE_DEG
    )
    assert np.cov(np.array(off).T).trace() == pytest.approx(stated[3:, 3:].trace() / 2, rel=0.25)


def _hinge_angle(chain: Any) -> np.ndarray:
    """Angle (T,) of the chain's hinge, about zero, from its quaternions."""
    parent, child = chain.poses.quaternion[:, 0], chain.poses.quaternion[:, 1]
    axis = rotate(parent, chain.axis_parent[0])
    across = np.cross(chain.axis_child[0], [0.3, 0.5, 0.8])
    seen = rotate(parent * [1, -1, -1, -1], rotate(child, across))
    first = np.cross(chain.axis_parent[0], seen[0])
    assert np.allclose(rotate(child, chain.axis_child[0]), axis)
    angle = np.unwrap(np.arctan2(seen @ first, (seen - _along(seen, chain.axis_parent[0])) @ seen[0]))
    return np.asarray(angle - angle.mean())


def _along(vectors: np.ndarray, axis: np.ndarray) -> np.ndarray:
    return (vectors @ axis)[:, None] * axis


def stated_sd_mm(joint: str, **changes: Any) -> float:
    """1-sigma error, mm, of a joint whose centre lies 20 mm from either receiver, square to its plane."""
    half_mm, axis = np.array([-20.0, 0.0, -7.0]), np.array([0.0, 1.0, 0.0])
    options: dict[str, Any] = {"gap_rms_mm": 0.8, "range_deg": 60.0, "axis_plane_deg": 90.0} | changes
    angle_deg = options.pop("axis_plane_deg")
    placed = Projection(-half_mm, half_mm, 0.0, angle_deg, np.zeros((6, 6)))
    return centre_sd_mm(
        unseen_covariance(HAND.joints[joint], HAND, placed, (axis, axis), np.eye(3), **options)
    )


def test_what_makes_it_grow() -> None:
    usual = stated_sd_mm("index_pip")
    assert 3.0 < usual < 6.0
    assert stated_sd_mm("index_pip", gap_rms_mm=2.0) > 1.4 * usual
    assert stated_sd_mm("index_pip", range_deg=10.0) > 1.8 * usual
    assert stated_sd_mm("index_pip", axis_plane_deg=20.0) > 1.5 * usual
    assert stated_sd_mm("ring_mcp") > stated_sd_mm("index_mcp") + 1.0


def test_no_plane_leaves_the_axis_to_the_frames() -> None:
    """Without a plane nothing is added along the axis."""
    half_mm, axis = np.array([-20.0, 0.0, -7.0]), np.array([0.0, 1.0, 0.0])
    placed = Projection(-half_mm, half_mm, 0.0, None, np.zeros((6, 6)))
    covariance = unseen_covariance(HAND.joints["index_pip"], HAND, placed, (axis, axis), np.eye(3), 0.8, 60.0)
    assert covariance[4, 4] == pytest.approx(0.0, abs=1e-12)
    assert covariance[3, 3] > 1.0
