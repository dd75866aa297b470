"""Eq. 1-7: accuracy on known joints, agreement of both solvers, invariance, and accumulation over blocks."""

from dataclasses import replace

import numpy as np
import pytest
from chains import Chain, gap_rms_mm, moments_of, random_chain
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from shukotsu.hand.rotations import Array, from_matrix, matrix
from shukotsu.paper.joint_solution import JointSolution, SolvedJoint, is_solvable, solve_closed, solve_stacked
from shukotsu.paper.moments import BATCH_FRAMES, JointMoments
from shukotsu.tables.poses import Poses

SEEDS = st.integers(0, 2**32 - 1)


def stacked(poses: Poses, joint: int, values: int) -> SolvedJoint:
    q, t = poses.quaternion, poses.position_mm
    return solve_stacked(q[:, joint], t[:, joint], q[:, joint + 1], t[:, joint + 1], values)


def off_axis(point: Array, true: Array, axis: Array) -> float:
    """Return the distance of a point from the line through `true` along `axis`, in mm."""
    return float(np.linalg.norm(np.cross(point - true, axis)))


@given(SEEDS, st.integers(2, 6))
@settings(max_examples=30)
def test_exact_hinges_are_solved_to_rounding(seed: int, n_segments: int) -> None:
    """In random noise-free chains every centre lies on its true axis to 1e-9 mm and axes agree to 1e-6
    deg.
    """
    chain = random_chain(seed, n_segments)
    moments = moments_of(chain)
    for j in range(n_segments - 1):
        solution = solve_closed(moments, j, 5)
        assert off_axis(solution.p_mm, chain.p_mm[j], chain.axis_parent[j]) < 1e-9
        assert off_axis(solution.q_mm, chain.q_mm[j], chain.axis_child[j]) < 1e-9
        sine = np.linalg.norm(np.cross(solution.null_child, chain.axis_child[j]))
        assert np.degrees(np.arcsin(sine)) < 1e-6
        sign = np.sign(solution.null_child @ chain.axis_child[j])
        np.testing.assert_allclose(solution.null_parent, sign * chain.axis_parent[j], atol=1e-8)
        assert solution.gap_rms_mm < 1e-5


@pytest.mark.parametrize("values", [5, 6])
@pytest.mark.parametrize(
    ("range_rad", "off_axis_rad", "noise_mm"),
    [(0.6, 0.2, 0.0), (0.6, 0.05, 0.1), (0.03, 0.01, 0.3), (1.5, 1.0, 0.1), (0.6, 0.0, 0.1)],
)
def test_closed_form_equals_the_stacked_svd(
    values: int, range_rad: float, off_axis_rad: float, noise_mm: float
) -> None:
    """Both solvers give the same centre to 1e-9 mm, the same axis and the same singular values."""
    for seed in range(5):
        chain = random_chain(
            seed, 3, 500, range_rad=range_rad, off_axis_rad=off_axis_rad, noise_mm=noise_mm, in_plane=False
        )
        moments = moments_of(chain, block=10 * BATCH_FRAMES)
        for j in range(2):
            closed, stack = solve_closed(moments, j, values), stacked(chain.poses, j, values)
            np.testing.assert_allclose(closed.p_mm, stack.p_mm, atol=1e-9, rtol=0)
            np.testing.assert_allclose(closed.q_mm, stack.q_mm, atol=1e-9, rtol=0)
            sign = np.sign(closed.null_child @ stack.null_child)
            np.testing.assert_allclose(closed.null_child, sign * stack.null_child, atol=1e-9)
            np.testing.assert_allclose(closed.null_parent, sign * stack.null_parent, atol=1e-9)
            np.testing.assert_allclose(closed.singular_values, stack.singular_values, atol=1e-7)
            assert closed.gap_rms_mm == pytest.approx(
                gap_rms_mm(chain.poses, j, closed.p_mm, closed.q_mm), abs=1e-5
            )


def test_closed_form_equals_the_published_equations() -> None:
    """Solving (I - M M^T) p = u - M w and q = M^T p - w literally gives the same joint."""
    chain = random_chain(7, 2, 400, off_axis_rad=0.4, noise_mm=0.1, in_plane=False)
    q, t = chain.poses.quaternion, chain.poses.position_mm
    a, b, between = matrix(q[:, 0]), matrix(q[:, 1]), t[:, 1] - t[:, 0]
    M = np.mean(a.transpose(0, 2, 1) @ b, 0)
    u = np.einsum("tji,tj->i", a, between) / len(between)
    w = np.einsum("tji,tj->i", b, between) / len(between)
    p = np.linalg.solve(np.eye(3) - M @ M.T, u - M @ w)
    solution = solve_closed(moments_of(chain), 0, 6)
    np.testing.assert_allclose(solution.p_mm, p, atol=1e-9)
    np.testing.assert_allclose(solution.q_mm, M.T @ p - w, atol=1e-9)
    s = np.linalg.svd(M, compute_uv=False)
    expected = np.sqrt(np.concatenate([1 + s, 1 - s[::-1]]))
    np.testing.assert_allclose(solution.singular_values, expected, atol=1e-12)


@given(SEEDS)
@settings(max_examples=15)
def test_nothing_depends_on_the_transmitter(seed: int) -> None:
    """Moving the transmitter frame, negating quaternions and reordering frames change no result."""
    rng = np.random.default_rng(seed)
    chain = random_chain(seed, 3, 160, off_axis_rad=0.1, noise_mm=0.2)
    turn, shift = Rotation.random(random_state=rng), rng.normal(size=3) * 500
    order = rng.permutation(160)
    q, t = chain.poses.quaternion[order], chain.poses.position_mm[order]
    turned = (turn * Rotation.from_quat(q.reshape(-1, 4), scalar_first=True)).as_quat(scalar_first=True)
    moved = replace(
        chain.poses,
        quaternion=turned.reshape(q.shape) * rng.choice([-1.0, 1.0], (160, 3, 1)),
        position_mm=turn.apply(t.reshape(-1, 3)).reshape(t.shape) + shift,
    )
    before, after = moments_of(chain), moments_of(chain, moved)
    for j in range(2):
        solution, other = solve_closed(before, j, 5), solve_closed(after, j, 5)
        for name in ("p_mm", "q_mm", "null_parent", "null_child", "mean_rotation", "singular_values"):
            np.testing.assert_allclose(getattr(other, name), getattr(solution, name), atol=1e-9, err_msg=name)
        assert other.gap_rms_mm == pytest.approx(solution.gap_rms_mm, abs=1e-9)


def test_a_joint_that_does_not_move_is_not_solvable() -> None:
    """A joint that does not move, or has at most one frame, is not solvable; a little motion is enough."""
    assert not is_solvable(moments_of(random_chain(1, 2, range_rad=0.0)), 0)
    assert not is_solvable(moments_of(random_chain(1, 2, n_frames=1)), 0)
    assert not is_solvable(JointMoments(1), 0)
    assert is_solvable(moments_of(random_chain(1, 2, range_rad=0.001)), 0)


def solved_with_noise(seed: int, off_axis_rad: float = 0.0) -> tuple[JointSolution, Chain]:
    chain = random_chain(3, 2, 400, range_rad=0.5, off_axis_rad=off_axis_rad)
    noise_mm = np.random.default_rng(seed).normal(size=chain.poses.position_mm.shape) * 0.5
    noisy = replace(chain.poses, position_mm=chain.poses.position_mm + noise_mm)
    return solve_closed(moments_of(chain, noisy), 0, 6 if off_axis_rad else 5), chain


@pytest.mark.slow
@pytest.mark.parametrize("off_axis_rad", [0.0, 0.4])
def test_covariance_equals_the_scatter_over_repeated_noise(off_axis_rad: float) -> None:
    """With white noise the covariance predicts the variance of 200 repetitions to 35 % in each direction."""
    solutions = [solved_with_noise(seed, off_axis_rad)[0] for seed in range(200)]
    scatter = np.cov(np.array([np.concatenate([f.p_mm, f.q_mm]) for f in solutions]).T)
    stated = np.mean([f.covariance_mm2 for f in solutions], 0)
    sizes, directions = np.linalg.eigh(stated)
    for size, direction in zip(sizes[1:], directions.T[1:], strict=True):
        assert direction @ scatter @ direction == pytest.approx(size, rel=0.35)


def test_block_size_and_invalid_frames_do_not_change_a_solution() -> None:
    """Blocks of any size give the same result, that of the valid frames alone."""
    chain = random_chain(11, 3, 403, off_axis_rad=0.1, noise_mm=0.1)
    poses = chain.poses
    poses.valid[:37, 1] = False
    poses.valid[200:210, 2] = False
    poses.position_mm[~poses.valid] = np.nan
    poses.quaternion[~poses.valid] = np.nan
    whole, parts = moments_of(chain), moments_of(chain, block=3 * BATCH_FRAMES)
    assert whole.count.tolist() == [366, 356]
    for j in range(2):
        solution, other = solve_closed(whole, j, 5), solve_closed(parts, j, 5)
        np.testing.assert_allclose(other.p_mm, solution.p_mm, atol=1e-10)
        assert other.n_effective == pytest.approx(solution.n_effective, rel=1e-9)
        keep = poses.valid[:, j] & poses.valid[:, j + 1]
        expected = stacked(poses.take(np.flatnonzero(keep)), j, 5)
        np.testing.assert_allclose(solution.p_mm, expected.p_mm, atol=1e-9)


def test_moments_equal_those_of_the_rotation_matrices() -> None:
    """Means, covariances and batch means equal those of R and d computed frame by frame, also far from the
    first pose.
    """
    chain = random_chain(8, 2, 500, range_rad=2.0, off_axis_rad=0.5, noise_mm=0.2, in_plane=False)
    moments = moments_of(chain)
    q, t = chain.poses.quaternion, chain.poses.position_mm
    a, b = matrix(q[:, 0]), matrix(q[:, 1])
    between = a.transpose(0, 2, 1) @ b
    first = between[0]
    D = first.T @ between - np.eye(3)
    d = np.einsum("ji,tkj,tk->ti", first, a, t[:, 1] - t[:, 0])
    d -= d[0]
    np.testing.assert_allclose(moments.mean(0), [*D.mean(0).ravel(), *d.mean(0)], atol=1e-12)
    off, off_d = D - D.mean(0), d - d.mean(0)
    C_DD, C_Dd, C_dd = moments.spread(0)
    np.testing.assert_allclose(C_DD, np.einsum("tri,trj->ij", off, off) / 500, atol=1e-12)
    np.testing.assert_allclose(C_Dd, np.einsum("tri,tr->i", off, off_d) / 500, atol=1e-11)
    assert C_dd == pytest.approx(np.sum(off_d**2) / 500, rel=1e-12)
    means = np.eye(3) + D.reshape(250, 2, 3, 3).mean(1)
    turns = moments.batch_turns(0).T
    assert turns[:, 0].min() < 0.4  # some need the formula for large rotations
    np.testing.assert_allclose(turns, from_matrix(means), atol=1e-12)
