"""Benchmarks: the rate of false positives, the comparison of a hand with its truth, and priors."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from benchmarks import sources, two_drawings
from benchmarks.null_studies import any_shown
from benchmarks.two_drawings import OTHER, OWN, errors_table, one_hand
from shukotsu.hand import drawn_hands
from shukotsu.scores.paired_statistics import group_difference, sign_flip_p

STUDIES = 600


@pytest.mark.slow
@pytest.mark.parametrize(("n", "m", "ratio"), [(6, 14, 1.0), (6, 14, 3.0), (6, 12, 3.0), (14, 6, 3.0)])
def test_few_null_studies_show_a_difference(n: int, m: int, ratio: float) -> None:
    """The rate of false positives is compatible with at most 7 %, tested at the 1 % level over 600
    studies.
    """
    rng = np.random.default_rng(7)
    shown = np.zeros(2)
    for _ in range(STUDIES):
        first, other = ratio * rng.normal(size=(n, 8)), rng.normal(size=(m, 8))
        shown[0] += any_shown([group_difference(*pair).p for pair in zip(first.T, other.T, strict=True)])
        shown[1] += any_shown([sign_flip_p(d) for d in rng.normal(size=(8, 8)).T])
    assert (shown <= binom.ppf(0.99, STUDIES, 0.07)).all()


@pytest.mark.slow
@pytest.mark.parametrize("drawing", [OWN, OTHER])
def test_a_fitted_hand_is_compared_with_its_truth(drawing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(two_drawings, "DURATION_S", 8.0)  # a third of the time
    joints, lengths = one_hand(drawing, 3)
    assert len(joints) == 15
    assert {length.bone.split("_")[1] for length in lengths} == {"metacarpal", "proximal", "middle"}
    assert 0.3 < np.median([joint.child_mm for joint in joints]) < 2.0
    (row,) = errors_table({drawing: joints}, {drawing: lengths}).rows
    assert row[11] == pytest.approx(100 * sum(joint.believed for joint in joints) / 15)
    assert row[11] > 40


@pytest.mark.parametrize("source", drawn_hands.SOURCES)
def test_a_prior_without_a_source_does_not_use_its_lengths(
    source: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Doubling a source's lengths changes the prior made with it, but not the prior made without it."""
    other = next(name for name in drawn_hands.SOURCES if name != source)
    before = [sources.prior_without(name)["index"].lengths_mm for name in (source, other)]
    index = drawn_hands.SOURCES[source]["index"]
    longer = {**drawn_hands.SOURCES[source], "index": replace(index, lengths_mm=2.0 * index.lengths_mm)}
    monkeypatch.setitem(drawn_hands.SOURCES, source, longer)
    after = [sources.prior_without(name)["index"].lengths_mm for name in (source, other)]
    np.testing.assert_array_equal(after[0], before[0])
    assert (after[1] > 1.1 * before[1]).all()
