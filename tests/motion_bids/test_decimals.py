"""Numbers as decimal text: nothing is lost, whatever the unit."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shukotsu.motion_bids.decimals import NotANumberError, numbers_of, text_of

finite = st.floats(allow_nan=False, allow_infinity=False)


@given(
    st.lists(finite | st.floats(-1e4, 1e4) | st.just(float("nan")), max_size=30), st.sampled_from([0, -1, -3])
)
def test_numbers_survive_as_text_in_any_unit(values: list[float], shift: int) -> None:
    array = np.array(values, float)
    text = text_of(array, shift)
    again = numbers_of(text, -shift)
    missing = np.isnan(array)
    np.testing.assert_array_equal(np.isnan(again), missing)
    assert again[~missing].tobytes() == array[~missing].tobytes()


@given(st.decimals(-10000, 10000, places=4))
def test_a_number_of_few_digits_keeps_them(value: Decimal) -> None:
    """212.4 mm is written 0.2124 m and not 0.21239999999999998."""
    (text,) = text_of(np.array([float(value)]), -3).to_pylist()
    assert Decimal(text) * 1000 == value


@pytest.mark.parametrize("text", ["inf", "nan", "1_0", "0x1", "", "1e", "1,5", "--1"])
def test_what_is_no_decimal_number(text: str) -> None:
    with pytest.raises(NotANumberError) as caught:
        numbers_of(pa.array(["1", None, "2e1", text]), 3)
    assert caught.value.index == 3
