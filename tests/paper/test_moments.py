"""Moments in one pass: the same as of whole matrices, however the frames come, gaps left out."""

from dataclasses import replace

import numpy as np
import pytest
from chains import moments_of, random_chain

from shukotsu.hand.rotations import from_matrix, matrix
from shukotsu.paper.closed import solve_closed
from shukotsu.paper.moments import BATCH_FRAMES
from shukotsu.paper.stacked import solve_stacked


def test_streaming_and_gaps() -> None:
    """Blocks of any size give the same result; frames that are not valid count for nothing."""
    chain = random_chain(11, 3, 403, off_axis_rad=0.1, noise_mm=0.1)
    poses = chain.poses
    poses.valid[:37, 1] = False
    poses.valid[200:210, 2] = False
    poses.position_mm[~poses.valid] = np.nan
    poses.quaternion[~poses.valid] = np.nan
    whole, parts = moments_of(chain), moments_of(chain, block=3 * BATCH_FRAMES)
    assert whole.count.tolist() == [366, 356]
    for j in range(2):
        one, other = solve_closed(whole, j, 5), solve_closed(parts, j, 5)
        np.testing.assert_allclose(other.p_mm, one.p_mm, atol=1e-10)
        assert other.n_effective == pytest.approx(one.n_effective, rel=1e-9)
        keep = poses.valid[:, j] & poses.valid[:, j + 1]
        kept = replace(poses, quaternion=poses.quaternion[keep], position_mm=poses.position_mm[keep])
        q, t = kept.quaternion, kept.position_mm
        expected = solve_stacked(q[:, j], t[:, j], q[:, j + 1], t[:, j + 1], 5)
        np.testing.assert_allclose(one.p_mm, expected.p_mm, atol=1e-9)


def test_moments_are_those_of_the_matrices() -> None:
    """Means, covariances and batch means against R and d written out, far from the first pose too."""
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
