"""Settings of a stream, as a capture keeps them: read back, or refused by a sentence."""

from typing import Any

import pytest

from shukotsu.errors import InputError
from shukotsu.tracker.families import StreamSettings, settings_from_json

SETTINGS = StreamSettings("liberty", "binary", "cm", 240.0, (1, 2), {1: (2, 4)}, {1: (0.0, 0.0, 1.0)})


def test_what_was_kept_comes_back() -> None:
    assert settings_from_json(SETTINGS.to_json(), "a.arrows") == SETTINGS


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"family": "fastrak"}, "fastrak left in 0.2: record with the tracker's own program"),
        ({"mode": "ascii"}, "ascii left in 0.2: record in binary; version 0.1 decodes an older capture"),
        *((change, "the tracker's settings in it") for change in (
            {"stations": [1, 10**400]}, {"stations": [-1]}, {"stations": None}, {"items": {"999": [2]}},
            {"items": []}, {"hemisphere": {"1": [float("nan"), 0, 1]}}, {"hemisphere": {"1": [1]}},
            {"rate_hz": 1e308}, {"rate_hz": 10**400}, {"family": [[[[]]]]}, {"mode": "other"}, {"options": 7},
        )),
    ],
)  # fmt: skip
def test_damaged_settings_and_those_of_what_left_are_refused(change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=rf"^a\.arrows: {sentence}"):
        settings_from_json(SETTINGS.to_json() | change, "a.arrows")
