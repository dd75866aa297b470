"""Memory does not grow with the length of the recording."""

from pathlib import Path

import pytest
from long_recordings import estimate_words, hand_of_length, peak_mb, tips_words

from stages.estimate_metacarpals.__main__ import main as estimate_metacarpals
from stages.evaluate_tips.__main__ import main as evaluate_tips


@pytest.mark.slow
def test_twenty_minutes_take_little_more_memory_than_one(tmp_path: Path) -> None:
    hands = [hand_of_length(tmp_path / f"{minutes}", minutes) for minutes in (1, 20)]
    peaks = []
    for hand in hands:
        assert estimate_metacarpals(list(map(str, estimate_words(hand)))) == 0
        assert evaluate_tips(list(map(str, tips_words(hand)))) == 0
        poses, out = hand.path("poses"), hand.folder / "scores.parquet"
        read = ["--poses", poses, "--calibration", poses, "--skeletons", hand.folder]
        made = ["--out", out, "--out-joints", hand.folder / "joint_errors.parquet"]
        peaks.append(peak_mb("evaluate_skeletons", *read, "--layout", "liberty16", *made))
    assert peaks[1] < peaks[0] + 60
