"""Whether to believe a joint: by its status, its stated error, and how far apart its receivers have it."""

from __future__ import annotations

from typing import Any

import pytest

from stages.report.belief import BELIEVED, CARE, LARGE_GAP_MM, NOT, belief, reason

ROW: dict[str, Any] = {"status": "ok", "sd_mm": 1.2, "gap_rms_mm": 1.1, "message": ""}


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({}, BELIEVED),
        ({"gap_rms_mm": None}, BELIEVED),
        ({"sd_mm": 2.5}, CARE),
        ({"sd_mm": None}, CARE),
        ({"gap_rms_mm": LARGE_GAP_MM + 0.1}, CARE),
        ({"status": "weak"}, NOT),
        ({"status": "failed", "sd_mm": None}, NOT),
    ],
)
def test_one_decision(change: dict[str, Any], expected: str) -> None:
    assert belief(ROW | change) == expected


def test_receivers_far_apart_are_the_reason() -> None:
    """An arm's skin: a small stated error does not make a centre known."""
    text = reason(ROW | {"gap_rms_mm": 7.3, "message": "moved little."})
    assert text.startswith("its receivers have it 7 mm apart, more than skin on a hand moves")
    assert text.endswith("; moved little")
    assert reason(ROW) == ""
