"""Command lines of many units, through one text and back."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.errors import InputError
from stages.units import pack, unpack

WORDS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)


@given(st.lists(st.lists(WORDS, min_size=1, max_size=6), max_size=6))
def test_round_trip(units: list[list[str]]) -> None:
    """Whatever the words: spaces, quotes, line ends of every kind, nothing at all."""
    assert unpack(pack(units)) == units


def test_a_path_that_many_units_read_is_written_once() -> None:
    path = "results/study/sub-01/right/opposition_12/poses.parquet"
    text = pack([["--poses", path, f"--out=models/{model}"] for model in range(40)])
    assert text.count(path) == 1


@given(st.lists(st.lists(WORDS, min_size=1, max_size=6), max_size=6))
def test_no_line_ends_a_here_document(units: list[list[str]]) -> None:
    """The workflow hands the text over as one, which a line UNITS would end."""
    assert "UNITS" not in pack(units).split("\n")


@pytest.mark.parametrize("text", ["", "--model rigid", '["a"]\n0 1', '["a"]\nx', "3\n0"])
def test_what_is_no_such_text_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="expected a JSON list of words"):
        unpack(text)
