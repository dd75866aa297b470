"""What a verdict looks like and says: every kind of doubt has its sentence, the joint's numbers in it."""

from __future__ import annotations

from typing import Any

import pytest

from shukotsu.schemas import verdict
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.verdict import LIMITS, UNJUDGED, noted
from shukotsu.sentences.translation import FOREIGN
from shukotsu.stages.report.belief import BELIEVED, CARE, NOT, belief, reasons_of, wanted_text
from shukotsu.stages.report.wording import speaking

VALUES: dict[str, dict[str, Any]] = {
    verdict.FAR: {"what": "palm width", "sd": 6.4},
    verdict.TOO_CLOSE: {"joints": ["middle_mcp", "ring_mcp"], "mm": 4.5},
    verdict.HALVES: {"gap_mm": 7.3},
    verdict.UNCERTAIN: {"sd_mm": 3.0, "radius_95_mm": 4.8, "wanted_mm": 2.0},
    verdict.ONE_WAY: {"sd_mm": 3.0, "radius_95_mm": 4.8, "wanted_mm": 2.0, "worst_mm": 2.9},
    verdict.MOVED_LITTLE: {"range_deg": 6.2},
    verdict.NO_POSE: {"segments": ["index_distal"]},
    verdict.ONE_RECEIVER: {"segments": ["index_middle", "index_distal"]},
    verdict.ACROSS: {"segment": "ring_metacarpal", "receiver": "hand"},
    verdict.AXIS_IN_PLANE: {"axis_plane_deg": 4.0, "slide_mm": 59.0},
    verdict.BY_HAND: {"correction_mm": 3.0},
    verdict.FROM_DOUBTFUL: {"joints": ["ring_mcp", "little_mcp"]},
    verdict.AXIS: {"axis_sd_deg": 8.0},
}
OF_BONES = {verdict.NO_LENGTH, verdict.END_IN_DOUBT, verdict.NOT_THE_BONE}


@pytest.mark.parametrize(("word", "shown"), [("believe", BELIEVED), ("care", CARE), ("no", NOT)])
def test_a_verdict_is_shown_as_it_stands(word: str, shown: str) -> None:
    """Whatever the numbers beside it: the table has judged."""
    assert belief({"verdict": word, "sd_mm": 99.0, "status": "weak"}) == shown


@pytest.mark.parametrize("kind", [kind for kind in LIMITS if kind not in OF_BONES | {verdict.NOT_SOLVED}])
@pytest.mark.parametrize("language", ["en", "ja"])
def test_every_kind_has_its_sentence(kind: str, language: str) -> None:
    row = {**UNJUDGED, **noted({kind: VALUES.get(kind, {})}), "message": ""}
    with speaking(language):
        (sentence,) = reasons_of(row)
    assert "{" not in sentence
    assert FOREIGN not in sentence
    assert sentence.isascii() == (language == "en")


def test_a_joint_that_failed_says_why_once() -> None:
    row = {**UNJUDGED, **noted({verdict.NOT_SOLVED: {}}), "message": "no frames."}
    assert reasons_of(row) == ["has no place: no frames"]


def test_what_is_asked_of_each_layout() -> None:
    arm, hand = read_layout("arm"), read_layout("liberty16")
    assert wanted_text([hand, hand]) == "2"
    assert wanted_text([arm, hand], 3.0) == "6 or 30"
