"""Rigid fits of marker clusters: poses come back, gaps stay gaps, lines are refused."""

import numpy as np
import pytest

from schemas.errors import InputError
from skeleton.rotations import matrix, unit
from stages.capture.formats.clusters import ClusterPoses, cluster_poses

SHAPE = np.array([[0.0, 0, 0], [60, 0, 0], [20, 40, 0], [30, 15, 25], [-10, 25, -30]])
"""In its own frame already: first the origin, second on x, third in the plane of x and y."""


def moving(rng: np.random.Generator, frames: int, markers: int = 5) -> tuple[np.ndarray, ...]:
    """Rotations, positions and the markers in the laboratory frame."""
    rotation = matrix(unit(rng.normal(size=(frames, 4))))
    position = rng.normal(scale=300, size=(frames, 3))
    seen = SHAPE[:markers] @ np.swapaxes(rotation, 1, 2) + position[:, None]
    return rotation, position, seen


@pytest.mark.parametrize(("frames", "markers"), [(1, 3), (30, 4), (30, 5)])
def test_exact_markers_give_back_pose_and_shape(frames: int, markers: int) -> None:
    rotation, position, seen = moving(np.random.default_rng(frames), frames, markers)
    check_poses(seen, rotation, position, 1e-6)


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


def test_noise_is_told_by_the_residual_and_averaged_in_the_shape() -> None:
    """Of 15 coordinates a frame 6 go into the pose, so 9/15 of the noise's variance is left."""
    rng = np.random.default_rng(3)
    _, _, seen = moving(rng, 4000)
    found = cluster_poses(seen + rng.normal(scale=0.5, size=seen.shape), "hand")
    assert np.sqrt(np.mean(found.misfit_mm**2)) == pytest.approx(0.5 * np.sqrt(3 * 9 / 15), rel=0.03)
    np.testing.assert_allclose(found.shape_mm, SHAPE, atol=0.06)


def test_frames_with_swapped_markers_do_not_spoil_the_shape() -> None:
    rng = np.random.default_rng(4)
    _, _, seen = moving(rng, 400)
    seen += rng.normal(scale=0.1, size=seen.shape)
    seen[:40] = seen[:40, [1, 0, 2, 3, 4]]
    found = cluster_poses(seen, "hand")
    np.testing.assert_allclose(found.shape_mm, SHAPE, atol=0.1)
    assert found.misfit_mm[:40].min() > 5 > 1 > found.misfit_mm[40:].max()


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ([[0, 0, 0], [30, 0, 0], [60, 1, 0]], "hand: its markers are on a line"),
        ([[5, 5, 5]] * 3, "hand: its markers are on a line"),
        ([[0, 0, 0], [30, 0, 0], [60, 1, 0], [30, 40, 0]], "hand: its first three markers are on a line"),
    ],
)
def test_a_line_is_refused(shape: list[list[float]], message: str) -> None:
    rotation, position, _ = moving(np.random.default_rng(5), 10)
    seen = np.array(shape, float) @ np.swapaxes(rotation, 1, 2) + position[:, None]
    with pytest.raises(InputError, match=message):
        cluster_poses(seen, "hand")


def test_markers_that_are_never_seen_together_are_refused() -> None:
    _, _, seen = moving(np.random.default_rng(6), 10, 4)
    apart = seen.copy()
    apart[:, 3] = np.nan
    apart[9] = np.nan
    apart[9, 3] = seen[9, 3]
    with pytest.raises(InputError, match="hand: marker 4 of it is never seen with three others of known"):
        cluster_poses(apart, "hand")
    seen[:, 2:] = np.nan
    with pytest.raises(InputError, match="hand: no frame has three of its markers"):
        cluster_poses(seen, "hand")
