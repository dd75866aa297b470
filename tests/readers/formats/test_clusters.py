"""Rigid fits of marker clusters: poses come back, gaps stay gaps, lines are refused."""

import numpy as np

from shukotsu.hand.rotations import matrix, unit
from shukotsu.readers.formats.c3d import ClusterPoses, cluster_poses

SHAPE = np.array([[0.0, 0, 0], [60, 0, 0], [20, 40, 0], [30, 15, 25], [-10, 25, -30]])
"""In its own frame already: first the origin, second on x, third in the plane of x and y."""


def moving(rng: np.random.Generator, frames: int, markers: int = 5) -> tuple[np.ndarray, ...]:
    """Rotations, positions and the markers in the laboratory frame."""
    rotation = matrix(unit(rng.normal(size=(frames, 4))))
    position = rng.normal(scale=300, size=(frames, 3))
    seen = SHAPE[:markers] @ np.swapaxes(rotation, 1, 2) + position[:, None]
    return rotation, position, seen


def test_markers_may_be_missing_and_never_all_be_seen_at_once() -> None:
    """Each frame lacks one of five markers; the pose is still that of the first marker, seen or not."""
    rotation, position, seen = moving(np.random.default_rng(1), 40)
    seen[np.arange(40), np.arange(40) % 5] = np.nan
    assert np.isnan(check_poses(seen, rotation, position, 1e-4).residual_mm).sum() == 40


def check_poses(
    seen: np.ndarray, rotation: np.ndarray, position: np.ndarray, close_mm: float
) -> ClusterPoses:
    found = cluster_poses(seen, "hand")
    np.testing.assert_allclose(found.shape_mm, SHAPE[: seen.shape[1]], atol=close_mm)
    np.testing.assert_allclose(found.rotation, rotation, atol=close_mm / 100)
    np.testing.assert_allclose(found.position_mm, position, atol=close_mm)
    assert found.misfit_mm.max() < close_mm
    return found


def test_two_markers_or_three_on_a_line_are_no_pose() -> None:
    line = np.array([[0.0, 0, 0], [30, 0, 0], [60, 0, 0], [30, 40, 0]])
    rotation, position, _ = moving(np.random.default_rng(2), 3)
    seen = line[[0, 3, 1, 2]] @ np.swapaxes(rotation, 1, 2) + position[:, None]
    seen[1, 2:] = np.nan
    seen[2, 1] = np.nan
    found = cluster_poses(seen, "hand")
    assert np.isfinite(found.rotation).all((1, 2)).tolist() == [True, False, False]
    assert np.isfinite(found.misfit_mm).tolist() == [True, False, False]
