"""Statistics of a long sample are NumPy's, whatever the parts that it came in and whatever fits in memory."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kinematics.long_sample import LongSample
from kinematics.rotations import Array

NUMBERS = st.floats(-1e9, 1e9, allow_subnormal=True)
SAMPLES = arrays(float, st.integers(1, 60), elements=NUMBERS | st.sampled_from([0.0, -0.0, 1.5, 1e-320]))


def sample(values: Array, piece: int, *cuts: int) -> LongSample:
    found = LongSample(piece)
    for part in np.split(values, sorted(cut % (len(values) + 1) for cut in cuts)):
        found.add(part)
    return found


@given(SAMPLES, st.lists(st.integers(0, 60), max_size=5), st.floats(0, 100))
def test_what_fits_in_memory_has_numpys_very_numbers(values: Array, cuts: list[int], percent: float) -> None:
    found = sample(values, 1000, *cuts)
    assert len(found) == len(values)
    assert found.mean() == values.mean()
    assert found.sd() == values.std()
    assert found.extremes() == (values.min(), values.max())
    assert found.median() == np.median(values)
    assert found.percentile(percent) == np.percentile(values, percent)


@given(SAMPLES, st.integers(1, 30), st.lists(st.integers(0, 60), max_size=5), st.floats(0, 100))
def test_what_does_not_fit_has_the_same_order_statistics(
    values: Array, piece: int, cuts: list[int], percent: float
) -> None:
    """They are found by counting: exactly, ties, zeros of either sign and the smallest numbers included."""
    found = sample(values, piece, *cuts)
    assert found.median() == np.median(values)
    assert found.percentile(percent) == np.percentile(values, percent)
    assert found.extremes() == (values.min(), values.max())
    assert found.mean() == pytest.approx(values.mean(), rel=1e-9, abs=1e-5)
    assert found.sd() == pytest.approx(values.std(), rel=1e-9, abs=1e-5)


@given(SAMPLES, st.integers(1, 30), st.lists(st.integers(0, 60), max_size=5))
def test_parts_do_not_matter(values: Array, piece: int, cuts: list[int]) -> None:
    """Sums are of pieces of one size, so that not even a rounding differs."""
    whole, cut = sample(values, piece), sample(values, piece, *cuts)
    assert (cut.mean(), cut.sd(), cut.circular_mean_rad()) == (
        whole.mean(),
        whole.sd(),
        whole.circular_mean_rad(),
    )
    np.testing.assert_array_equal(np.concatenate(list(cut.pieces(7))), values)


def test_gaps_are_left_out() -> None:
    found = LongSample()
    found.add_known(np.array([np.nan, 2.0, np.inf, 4.0]))
    assert (len(found), found.mean()) == (2, 3.0)


def test_the_circular_mean_wraps() -> None:
    assert abs(sample(np.array([np.pi - 0.1, -np.pi + 0.1]), 1).circular_mean_rad()) == pytest.approx(np.pi)


def test_nothing_has_no_mean() -> None:
    with pytest.raises(ValueError, match="without numbers"):
        LongSample().mean()
