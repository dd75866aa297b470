"""Weights of frames: angles count alike, and what fits nothing counts for nothing."""

import numpy as np
import pytest

from stages.solve_joints.weights import flattening, robust_scale, tukey


def test_flattening_makes_every_angle_count_alike() -> None:
    """Nine tenths of the frames at one end: the weighted mean lies in the middle; the extremes weigh most."""
    angle = np.concatenate([np.full(9000, 0.0), np.linspace(0, 1, 1000)])
    weights = flattening(angle)
    assert weights.mean() == pytest.approx(1)
    assert np.average(angle, weights=weights) > 0.25 > 2 * np.average(angle)
    assert weights[-1] == weights.max() > 2 * weights[0]


def test_tukey_leaves_out_what_is_far_off() -> None:
    rng = np.random.default_rng(0)
    residual = rng.normal(size=(1000, 3))
    residual[:20] += 40.0
    scale = robust_scale(residual)
    weights = tukey(residual, scale)
    assert scale == pytest.approx(1, rel=0.1)
    assert np.all(weights[:20] == 0)
    assert weights[20:].min() > 0.2
