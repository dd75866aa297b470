"""Power against studies that are drawn and judged one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shukotsu.statistics.power import power, spread_of_means
from shukotsu.statistics.verdicts import SHOWN, between_family, within_family


@pytest.mark.parametrize("n_groups", [1, 2])
def test_power_is_the_share_of_drawn_studies_that_show_it(n_groups: int) -> None:
    rng, n, spread, difference, studies = np.random.default_rng(1), 10, 1.5, 2.0, 400
    shown = 0
    for _ in range(studies):
        groups = [spread * rng.normal(size=(n, 1)) for _ in range(n_groups)]
        groups[0] += difference
        found = within_family(*groups) if n_groups == 1 else between_family(*groups)
        shown += found.verdict == [SHOWN]
    expected = power(n_groups, spread, difference, n)
    assert shown / studies == pytest.approx(expected, abs=4 * math.sqrt(expected * (1 - expected) / studies))


def test_more_subjects_or_sessions_show_more_and_more_questions_less() -> None:
    once, thrice = (spread_of_means(2.0, 1.5, 1, n) for n in (1, 3))
    assert once == pytest.approx(2.0)
    assert thrice == pytest.approx(math.sqrt(4 - 2.25 + 0.75))
    by_n = [power(2, once, 3.0, n) for n in (5, 8, 12, 20)]
    assert by_n == sorted(by_n)
    assert power(2, thrice, 3.0, 8) > power(2, once, 3.0, 8) > power(2, once, 3.0, 8, among=5)
    assert power(2, once, -3.0, 8) == power(2, once, 3.0, 8)
