"""Null studies: as many false positives as there should be, and the inverted test by search."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.null_studies import run, smooth
from shukotsu.statistics.curve_statistics import curves_between, curves_within
from shukotsu.statistics.group_statistics import permutation_p
from shukotsu.statistics.paired_statistics import sign_flip_p

STUDIES = 2000


def test_every_table_has_its_rows() -> None:
    tables = list(run(2))
    assert [len(table.rows) for table in tables] == [8, 21, 3, 5, 4]
    for table in tables:
        shares = [cell for row in table.rows for cell in row[2:] if isinstance(cell, float)]
        assert all(0.0 <= share <= 100.0 for share in shares)


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
