"""Projecting joint centres onto sagittal planes: accuracy, stated errors and doubts."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chains import chain_layout, moments_of, random_chain
from chains import gap_rms_mm as gap_by_hand
from hypothesis import given, settings
from hypothesis import strategies as st

from shukotsu.errors import InputError
from shukotsu.hand.average_hand import PRIOR
from shukotsu.hand.rotations import conjugate, multiply, rotate
from shukotsu.paper.joint_solution import JointSolution, solve_closed
from shukotsu.paper.part_solutions import solution_row
from shukotsu.paper.plane import Projection, centre_sd_mm, place_joint, project
from shukotsu.paper.unseen_error import NEIGHBOUR_RANGE_DEG, unseen_covariance
from shukotsu.study.layout import FINGER_MM, Joint, Plane, read_layout
from shukotsu.study.model import read_model
from shukotsu.study.verdict import doubts_of, judged_joint

SEEDS = st.integers(0, 2**32 - 1)
LAYOUT = chain_layout(random_chain(0, 2))
SAGITTAL = np.array([0.0, 1.0, 0.0])


def cut(solution: JointSolution, *, parent: bool = False, normal: np.ndarray = SAGITTAL) -> Projection | None:
    return project(solution, Plane("parent" if parent else "child", (0.0, 0.0, 0.0), (*normal,)))


@given(SEEDS)
@settings(max_examples=30)
def test_exact_hinges_are_projected_to_their_centres(seed: int) -> None:
    """Without noise and with the true planes, p and q are the true centres to 1e-6 mm."""
    chain = random_chain(seed, 4)
    moments = moments_of(chain)
    for j in range(3):
        projection = cut(solve_closed(moments, j, 5))
        assert projection is not None
        np.testing.assert_allclose(projection.p_mm, chain.p_mm[j], atol=1e-6)
        np.testing.assert_allclose(projection.q_mm, chain.q_mm[j], atol=1e-6)


@given(SEEDS)
@settings(max_examples=30)
def test_both_centres_slide_by_the_same_distance_along_the_axis(seed: int) -> None:
    """The child's centre q ends in its plane, and p and q move by the same multiple of their null vectors."""
    chain = random_chain(seed, 2, off_axis_rad=0.1, in_plane=False)
    solution = solve_closed(moments_of(chain), 0, 5)
    at = cut(solution)
    assert at is not None
    assert at.q_mm[1] == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(at.p_mm - solution.p_mm, at.slide_mm * solution.null_parent, atol=1e-9)
    np.testing.assert_allclose(at.q_mm - solution.q_mm, at.slide_mm * solution.null_child, atol=1e-9)


def solved_row(seed: int, **options: float) -> tuple[Joint, dict[str, object], object]:
    chain = random_chain(seed, 2, 300, in_plane=False, **options)
    solution = solve_closed(moments_of(chain), 0, 5)
    return chain.joints[0], solution_row(chain.joints[0], solution), chain


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("shift", [None, np.array([3.0, -2.0, 5.0])])
def test_the_gap_of_a_placed_centre_equals_the_frame_by_frame_gap(
    seed: int, shift: np.ndarray | None
) -> None:
    """The same applies after a manual correction, and the unconstrained gap is no larger."""
    joint, row, chain = solved_row(seed, off_axis_rad=0.1, noise_mm=0.2)
    placed = place_joint(joint, LAYOUT, row, read_model("paper-fig4-corrected"), shift)
    p = np.array([placed[f"parent_{axis}_mm"] for axis in "xyz"])
    q = np.array([placed[f"child_{axis}_mm"] for axis in "xyz"])
    assert placed["gap_rms_mm"] == pytest.approx(gap_by_hand(chain.poses, 0, p, q), rel=1e-6)
    assert placed["gap_rms_free_mm"] <= placed["gap_rms_mm"] + 1e-9
    if shift is not None:
        assert placed["correction_mm"] == pytest.approx(np.linalg.norm(shift))
        plain = place_joint(joint, LAYOUT, row, read_model("paper-fig4"), None)
        moved = q - [plain[f"child_{axis}_mm"] for axis in "xyz"]
        np.testing.assert_allclose(moved, shift, atol=1e-12)


def test_doubts_about_a_centre_are_named() -> None:
    """Little motion, an uncertain axis and an axis near the plane are named; a good joint has its error
    alone.
    """
    model = read_model("paper-fig4")
    joint, row, _ = solved_row(1)
    assert [*doubts_of(judged_joint(place_joint(joint, LAYOUT, row, model, None), FINGER_MM))] == [
        "uncertain"
    ]
    joint, row, _ = solved_row(1, range_rad=0.02, off_axis_rad=0.01)
    weak = judged_joint(place_joint(joint, LAYOUT, row, model, None), FINGER_MM)
    assert weak["status"] == "weak"
    assert {"moved-too-little", "axis-uncertain"} < {*doubts_of(weak)}
    joint, row, _ = solved_row(1)
    axis = np.array([row[f"null_child_{k}"] for k in "xyz"])
    slanted = Plane("child", (0.0, 0.0, 0.0), tuple(np.cross(axis, [1, 2, 3]) + 0.3 * axis))
    near = place_joint(replace(joint, plane=slanted), LAYOUT, row, model, None)
    assert "axis-near-plane" in doubts_of(near)


@pytest.mark.slow
def test_sd_predicts_the_scatter_of_placed_centres() -> None:
    """Over 200 repetitions with white noise the projected centre scatters by sd_mm, to 20 %."""
    chain = random_chain(3, 2, 400, range_rad=0.5)
    centres, stated = [], []
    for seed in range(200):
        noise = np.random.default_rng(seed).normal(size=chain.poses.position_mm.shape) * 0.5
        poses = replace(chain.poses, position_mm=chain.poses.position_mm + noise)
        at = cut(solve_closed(moments_of(chain, poses), 0, 5))
        assert at is not None
        centres.append(np.concatenate([at.p_mm, at.q_mm]))
        stated.append(centre_sd_mm(at.covariance_mm2))
    scatter = np.sqrt(max(np.var(centres, 0)[:3].sum(), np.var(centres, 0)[3:].sum()))
    assert np.mean(stated) == pytest.approx(scatter, rel=0.2)


def test_a_model_with_corrections_but_no_planes_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(
        "model: mine\ndescription: Mine.\nplanes: {cut: false, corrections: true}\n"
    )
    with pytest.raises(InputError, match=r"planes.corrections: is true, but planes.cut: false"):
        read_model("mine.yaml", tmp_path)


HAND = read_layout("liberty16")


@pytest.mark.slow
def test_skin_motion_in_phase_with_a_hinge_moves_its_centre_as_stated() -> None:
    """In 300 trials both receivers slide in proportion to the hinge's angle, by random amounts (sd 2
    mm/rad).
    """
    chain = random_chain(5, 2, 200, range_rad=0.15)
    poses, joint = chain.poses, replace(chain.joints[0], plane=replace(chain.joints[0].plane, frame="none"))
    free = solve_closed(moments_of(chain), 0, 5)
    along = np.stack([poses.quaternion[:, 0], poses.quaternion[:, 1]], 1)
    rng, off = np.random.default_rng(0), []
    angle_rad = _hinge_angle(chain)
    for _ in range(300):
        slide = rng.normal(0, PRIOR.UNKNOWN_SLIDE_SD_MM, (2, 3))
        moved = poses.position_mm + rotate(along, angle_rad[:, None, None] * slide)
        solution = solve_closed(moments_of(chain, replace(poses, position_mm=moved)), 0, 5)
        across = solution.q_mm - free.q_mm
        off.append(across - across @ free.null_child * free.null_child)
    placed = Projection(free.p_mm, free.q_mm, 0.0, None, np.zeros((6, 6)))
    tight = replace(free, gap_rms_free_mm=0.0, range_deg=NEIGHBOUR_RANGE_DEG)
    stated = unseen_covariance(joint, chain_layout(chain), placed, tight)
    assert np.cov(np.array(off).T).trace() == pytest.approx(stated[3:, 3:].trace() / 2, rel=0.25)


def _hinge_angle(chain: Any) -> np.ndarray:
    """Return the hinge's angle (T,) in rad with zero mean, from the quaternions."""
    turn = multiply(conjugate(chain.poses.quaternion[:, 0]), chain.poses.quaternion[:, 1])
    since_first = multiply(turn, conjugate(turn[0]))
    angle = np.unwrap(2 * np.arctan2(since_first[:, 1:] @ chain.axis_parent[0], since_first[:, 0]))
    return np.asarray(angle - angle.mean())


def unseen_mm2(joint: str, axis_plane_deg: float | None = 90.0, **changes: float) -> np.ndarray:
    """Return the covariance (6, 6) of a hinge 20 mm from both receivers; None for a joint without a plane."""
    half_mm, numbers = np.array([-20.0, 0.0, -7.0]), {"gap_rms_free_mm": 0.8, "range_deg": 60.0} | changes
    placed = Projection(-half_mm, half_mm, 0.0, axis_plane_deg, np.zeros((6, 6)))
    solved = solve_closed(moments_of(random_chain(0, 2)), 0, 5)
    hinge = replace(solved, null_child=SAGITTAL, mean_rotation=np.eye(3), **numbers)
    return unseen_covariance(HAND.joints[joint], HAND, placed, hinge)


def test_the_stated_error_grows_with_gap_small_range_and_oblique_axis() -> None:
    usual = centre_sd_mm(unseen_mm2("index_pip"))
    assert 3.0 < usual < 6.0
    assert centre_sd_mm(unseen_mm2("index_pip", gap_rms_free_mm=2.0)) > 1.4 * usual
    assert centre_sd_mm(unseen_mm2("index_pip", range_deg=10.0)) > 1.8 * usual
    assert centre_sd_mm(unseen_mm2("index_pip", 20.0)) > 1.5 * usual
    assert centre_sd_mm(unseen_mm2("ring_mcp")) > centre_sd_mm(unseen_mm2("index_mcp")) + 1.0


def test_without_a_plane_no_error_is_added_along_the_axis() -> None:
    covariance = unseen_mm2("index_pip", None)
    assert covariance[4, 4] == pytest.approx(0.0, abs=1e-12)
    assert covariance[3, 3] > 1.0
