"""Null studies: as many false positives as there should be, and the inverted test by search."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.null_studies import inverted_interval, run, smooth
from subject_statistics.curve_statistics import curves_between, curves_within
from subject_statistics.group_statistics import permutation_p
from subject_statistics.paired_statistics import sign_flip_p

STUDIES = 2000


def test_every_table_has_its_rows() -> None:
    tables = list(run(2))
    assert [len(table.rows) for table in tables] == [8, 21, 3, 5, 4]
    for table in tables:
        shares = [cell for row in table.rows for cell in row[2:] if isinstance(cell, float)]
        assert all(0.0 <= share <= 100.0 for share in shares)


def test_the_inverted_test_is_what_a_search_finds() -> None:
    """A shift just inside its ends is not refused by the permutation test of means, one just outside is."""
    rng = np.random.default_rng(1)
    values, others = rng.normal(size=5), rng.normal(size=6)
    low, high = inverted_interval(values, others)
    for shift, inside in ((low - 1e-6, False), (low + 1e-6, True), (high - 1e-6, True), (high + 1e-6, False)):
        assert (_p_of_means(values - shift, others) > 0.05) == inside


def _p_of_means(values: np.ndarray, others: np.ndarray) -> float:
    from scipy import stats

    def difference(first: np.ndarray, second: np.ndarray, axis: int) -> np.ndarray:
        return np.asarray(first.mean(axis=axis) - second.mean(axis=axis))

    found = stats.permutation_test((values, others), difference, vectorized=True, n_resamples=np.inf)
    return float(found.pvalue)


@pytest.mark.slow
@pytest.mark.parametrize("design", ["within", "between", "curves within", "curves between"])
def test_one_null_study_in_twenty_shows_something(design: str) -> None:
    """5 +- 1 % over 2000 studies of 12 subjects."""
    rng = np.random.default_rng(7)
    shown = 0
    for _ in range(STUDIES):
        if design == "within":
            shown += sign_flip_p(rng.normal(size=12)) <= 0.05
        elif design == "between":
            shown += permutation_p(rng.normal(size=6), rng.normal(size=6)) <= 0.05
        else:
            curves = smooth(rng, (12, 51))
            test = (
                curves_within(curves) if design == "curves within" else curves_between(curves[:6], curves[6:])
            )
            assert test is not None
            shown += bool(test.significant.any())
    assert 4.0 <= 100.0 * shown / STUDIES <= 6.0
