"""Independent samples of a correlated series, against the sum written out."""

import numpy as np
import pytest

from shukotsu.hand.effective_samples import effective_samples


@pytest.mark.parametrize("waves", [0.5, 1.5, 20.0])
def test_effective_samples_are_those_of_the_sum_written_out(waves: float) -> None:
    """Slow and quick series, whose autocovariance crosses zero late and early."""
    rng = np.random.default_rng(2)
    series = np.cos(np.linspace(0, 2 * np.pi * waves, 401))[:, None] + 0.1 * rng.normal(size=(401, 2))
    centred = series - series.mean(0)
    lags = [np.sum(centred[: 401 - lag] * centred[lag:]) / 401 for lag in range(401)]
    crossing = next(lag for lag, value in enumerate(lags) if value <= 0)
    assert (crossing > 401 // 8) == (waves < 2)
    expected = 2.0 / ((2 * sum(lags[:crossing]) - lags[0]) / 401)
    assert effective_samples(series, 2.0, 10**9) == pytest.approx(expected, rel=1e-10)
