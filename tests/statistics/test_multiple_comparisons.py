"""Holm's correction."""

from __future__ import annotations

import pytest

from shukotsu.statistics.paired_statistics import holm


def test_holm_by_hand() -> None:
    """0.01 x 4, 0.02 x 3, 0.03 x 2 raised to the one before, 0.9; no test stays none and does not count."""
    corrected = holm([0.02, None, 0.9, 0.01, 0.03])
    assert corrected == [
        pytest.approx(0.06),
        None,
        pytest.approx(0.9),
        pytest.approx(0.04),
        pytest.approx(0.06),
    ]
    assert holm([0.4, 0.5]) == [pytest.approx(0.8), pytest.approx(0.8)]
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == []
