"""Memory does not grow with the length of the recording."""

from pathlib import Path

import pytest
from long_recordings import estimate_words, hand_of_length, peak_mb


@pytest.mark.slow
def test_twenty_minutes_take_little_more_memory_than_one(tmp_path: Path) -> None:
    """288,000 frames of 16 receivers are 300 MB as numbers, five metacarpals of them 90 MB."""
    hands = [hand_of_length(tmp_path / f"{minutes}", minutes) for minutes in (1, 20)]
    short, long = (peak_mb("estimate_metacarpals", *estimate_words(hand)) for hand in hands)
    assert long < short + 60
