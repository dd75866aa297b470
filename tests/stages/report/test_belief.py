"""Whether to believe a joint: by its status, its stated error, and how far apart its receivers have it."""

from __future__ import annotations

from typing import Any

import pytest

from schemas.catalogue import DISTAL_RECEIVER
from schemas.layout import read_layout
from stages.report.belief import (
    BELIEVED,
    CARE,
    LARGE_GAP_MM,
    NOT,
    belief,
    is_whole_bone,
    length_belief,
    reason,
)

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


BONE: dict[str, Any] = {"bone": "index_proximal", "starts_at": "index_mcp", "ends_at": "index_pip"}
BONE |= {"length_mm": 40.0, "sd_mm": 0.6}
CAREFUL, WEAK = ROW | {"sd_mm": 2.5}, ROW | {"status": "weak"}


@pytest.mark.parametrize(
    ("change", "ends", "expected"),
    [
        ({}, (ROW, ROW), BELIEVED),
        ({}, (ROW, CAREFUL), CARE),
        ({}, (WEAK, CAREFUL), NOT),
        ({"sd_mm": 2.1}, (ROW, ROW), CARE),
        ({"sd_mm": None}, (ROW, ROW), CARE),
        ({"sd_mm": None, "length_mm": None}, (ROW, ROW), NOT),
        ({"ends_at": "fingertip"}, (ROW, WEAK), BELIEVED),
        ({"ends_at": DISTAL_RECEIVER}, (ROW, ROW), CARE),
        ({"starts_at": "wrist"}, (ROW, ROW), CARE),
    ],
)
def test_a_length_is_as_good_as_its_ends(
    change: dict[str, Any], ends: tuple[dict[str, Any], dict[str, Any]], expected: str
) -> None:
    """And no better than its own error; from the wrist or to a receiver it is not the bone's."""
    bone = BONE | change
    joints = dict(zip(("index_mcp", "index_pip"), ends, strict=True))
    is_whole = is_whole_bone(bone, read_layout("liberty16"))
    assert length_belief(bone, joints, is_whole=is_whole) == expected
