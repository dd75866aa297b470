"""Null studies: as many false positives as there should be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from benchmarks.null_studies import any_shown, numbers
from shukotsu.scores.paired_statistics import group_difference, sign_flip_p

STUDIES = 600


@pytest.mark.slow
@pytest.mark.parametrize(("n", "m", "ratio"), [(6, 14, 1.0), (6, 14, 3.0), (6, 12, 3.0), (14, 6, 3.0)])
def test_few_studies_in_which_nothing_differs_show_something(n: int, m: int, ratio: float) -> None:
    """At most 7 %: of 600 studies at that share 58 or more show something once in a hundred times."""
    rng = np.random.default_rng(7)
    shown = np.zeros(2)
    for _ in range(STUDIES):
        first, other = ratio * numbers("normal", rng, (n, 8)), numbers("normal", rng, (m, 8))
        shown[0] += any_shown([group_difference(*pair).p for pair in zip(first.T, other.T, strict=True)])
        shown[1] += any_shown([sign_flip_p(d) for d in numbers("normal", rng, (8, 8)).T])
    assert (shown <= binom.ppf(0.99, STUDIES, 0.07)).all()
