"""Principal components of joint angles, against NumPy's SVD and made-up synergies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import subspace_angles

from shukotsu.anatomy.recorded_movement import AngleSeries
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.measure_movement.coordination import (
    MOST_FRAMES,
    Postures,
    coordination_rows,
    principal_components,
)

WIDTHS_DEG = np.array([40.0, 20.0, 10.0, 6.0])


def moved(seed: int, n_frames: int = 4000, n_angles: int = 30, noise_deg: float = 1.0) -> tuple[Array, Array]:
    """Angles (T, A) of four synergies and noise, and the synergies (4, A)."""
    g = np.random.default_rng(seed)
    synergies = np.linalg.qr(g.standard_normal((n_angles, 4)))[0].T
    course = WIDTHS_DEG * np.sin(
        np.arange(n_frames)[:, None] * [0.011, 0.023, 0.037, 0.053] + g.uniform(0, 6, 4)
    )
    angles = 20 + course @ synergies + noise_deg * g.standard_normal((n_frames, n_angles))
    return angles, synergies


def series_of(angles: Array, sd_deg: float | None) -> list[AngleSeries]:
    errors = None if sd_deg is None else np.full((len(angles), 4, 1), sd_deg)
    return [AngleSeries(f"j{k}", "flexion", own, errors, "ok", "") for k, own in enumerate(angles.T)]


def rows_of(series: list[AngleSeries]) -> tuple[list[dict[str, object]], list[dict[str, object]]]:
    postures = Postures()
    for own in series:
        postures.add(own)
    return coordination_rows(postures)


def test_without_errors_they_are_those_of_the_singular_value_decomposition() -> None:
    angles, _ = moved(0, n_angles=12)
    found = principal_components(angles, np.zeros(12), np.zeros(12))
    _, size, rows = np.linalg.svd(angles - angles.mean(0), full_matrices=False)
    np.testing.assert_allclose(found.variance, size**2 / (len(angles) - 1), rtol=1e-9)
    np.testing.assert_allclose(found.share, size**2 / (size**2).sum(), rtol=1e-9)
    np.testing.assert_allclose(np.abs((found.loadings * rows).sum(1)), 1.0, atol=1e-9)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10**6), scale=st.floats(0.1, 10.0), noise_deg=st.floats(0.2, 1.5))
def test_as_many_synergies_as_there_are_at_any_scale(seed: int, scale: float, noise_deg: float) -> None:
    """Noise as stated makes none; the shares are those of the synergies alone, in any order of the angles."""
    angles, synergies = moved(seed, noise_deg=noise_deg)
    order = np.random.default_rng(seed).permutation(angles.shape[1])
    sds = np.full(len(order), scale * noise_deg)
    found = principal_components(scale * angles[:, order] + 7.0, sds, sds)
    assert np.flatnonzero(~np.isnan(found.share)).tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(found.share[:4], WIDTHS_DEG**2 / (WIDTHS_DEG**2).sum(), atol=0.03)
    assert found.n_enough == 2
    apart = np.degrees(subspace_angles(found.loadings[:4].T, synergies[:, order].T))
    assert apart.max() < 2.0 * noise_deg


def test_rows_leave_out_angles_that_are_hardly_known_and_frames_with_gaps() -> None:
    angles, _ = moved(3, n_angles=10)
    angles[:2500, 4] = np.nan
    angles[100:200, 7] = np.nan
    components, loadings = rows_of(series_of(angles, 1.0))
    assert {(row["n_angles"], row["n_frames"], row["status"]) for row in components} == {(9, 3900, "weak")}
    assert components[0]["message"] == "known in too few frames: j4 flexion"
    assert [row["counted"] for row in components] == [True] * 4 + [False] * 5
    shares = [row["share_percent"] for row in components[:4]]
    np.testing.assert_allclose(np.cumsum(shares), [row["cumulative_percent"] for row in components[:4]])
    assert components[3]["cumulative_percent"] == pytest.approx(100)
    assert {row["joint"] for row in loadings} == {f"j{k}" for k in range(10) if k != 4}
    assert sum(row["loading"] ** 2 for row in loadings if row["component"] == 1) == pytest.approx(1)


def test_what_a_model_does_not_state_is_said_and_long_recordings_are_thinned() -> None:
    angles, _ = moved(5, n_frames=2 * MOST_FRAMES + 1, n_angles=5)
    (first, *_), _ = rows_of(series_of(angles, None))
    assert (first["noise_deg2"], first["status"], first["counted"]) == (None, "weak", True)
    assert MOST_FRAMES / 2 < first["n_frames"] <= MOST_FRAMES
    still = rows_of(series_of(np.random.default_rng(0).normal(0, 1, (500, 5)), 1.0))
    assert (sum(row["counted"] for row in still[0]), still[1]) == (0, [])
    assert rows_of([]) == ([], [])
    (few,), none = rows_of(series_of(angles[:8], 1.0))
    assert (few["status"], few["message"], none) == (
        "failed",
        "8 frames have all 5 angles; expected 10 or more",
        [],
    )
