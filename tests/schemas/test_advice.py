"""Sentences of advice: of every kind, whole, without numbers that its table has beside them."""

import pytest

from schemas.advice import ADVICE, GAP, MOVE, advice_text

VALUES = {
    "wanted_deg": 40.0,
    "gap_mm": 12.34,
    "sd_mm": 353.6,
    "enough_mm": 3.4,
    "parent": "hand",
    "child": "lid",
    "finding": "Found.",
}


@pytest.mark.parametrize(
    ("joint", "said"),
    [
        ("little_dip", "move the little finger's fingertip joint alone through 40 deg"),
        ("thumb_cmc", "move the thumb's base alone through 40 deg"),
        ("elbow", "move it alone through 40 deg"),
    ],
)
def test_what_to_move_has_the_words_that_people_use(joint: str, said: str) -> None:
    assert advice_text(joint, MOVE, VALUES) == said


def test_a_sentence_has_its_values_and_goes_through_a_language() -> None:
    assert "by 12.3 mm at best" in advice_text("elbow", GAP, VALUES)
    assert advice_text("elbow", GAP, VALUES, lambda text, **_: text) == ADVICE[GAP]


@pytest.mark.parametrize("kind", ADVICE)
def test_every_kind_has_a_whole_sentence(kind: str) -> None:
    said = advice_text("index_mcp", kind, VALUES)
    assert said
    assert "{" not in said
