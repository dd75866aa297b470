"""Memory does not grow with the length of the recording."""

from pathlib import Path

import pytest
from long_recordings import estimate_words, hand_of_length, peak_mb, tips_words

from stages.estimate_metacarpals.__main__ import main as estimate_metacarpals


@pytest.mark.slow
def test_twenty_minutes_take_little_more_memory_than_one(tmp_path: Path) -> None:
    hands = [hand_of_length(tmp_path / f"{minutes}", minutes) for minutes in (1, 20)]
    for hand in hands:
        assert estimate_metacarpals(list(map(str, estimate_words(hand)))) == 0
    short, long = (peak_mb("evaluate_tips", *tips_words(hand)) for hand in hands)
    assert long < short + 60
