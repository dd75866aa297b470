"""Verdicts on joints: they follow from the stated error and are lowered by doubts."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shukotsu.study import verdict
from shukotsu.study.verdict import BELIEVE, CARE, NO, VERDICTS, doubts_of, judged_joint, note_doubts

ROW: dict[str, Any] = {"status": "ok", "sd_mm": 1.2, "gap_rms_mm": 1.1, "range_deg": 40.0, "dof": 1}
ROW |= {"axis_sd_deg": 1.0, **verdict.UNJUDGED}
FINGER_MM = 2.0

sizes = st.floats(0.0, 60.0)
nullable = st.none() | sizes
kinds = st.sampled_from([verdict.BY_ANATOMY, verdict.UNSETTLED, verdict.ACROSS, verdict.BY_HAND])


@pytest.mark.parametrize(
    ("change", "expected", "reason"),
    [
        ({}, BELIEVE, ""),
        ({"gap_rms_mm": None, "range_deg": None, "axis_sd_deg": None}, BELIEVE, ""),
        ({"sd_mm": 2.0}, BELIEVE, ""),
        ({"sd_mm": 2.01}, CARE, "uncertain"),
        ({"sd_mm": 6.01}, NO, "uncertain"),
        ({"sd_mm": None}, CARE, "no-error-stated"),
        ({"sd_mm": float("nan")}, CARE, "no-error-stated"),
        ({"gap_rms_mm": 5.1}, CARE, "halves-disagree"),
        ({"gap_rms_mm": 10.1}, NO, "halves-disagree"),
        ({"range_deg": 6.0}, CARE, "moved-too-little"),
        ({"axis_sd_deg": 9.0}, BELIEVE, ""),
        ({"sd_mm": 9.0, "range_deg": 6.0}, NO, "moved-too-little"),
        (note_doubts({"placed-by-anatomy": {}}), CARE, "placed-by-anatomy"),
        (note_doubts({"far-from-expected": {"what": "palm width", "sd": 7.0}}), NO, "far-from-expected"),
        ({"status": "failed", "sd_mm": None}, NO, "not-solved"),
    ],
)
def test_the_verdict_follows_the_stated_error_and_doubts(
    change: dict[str, Any], expected: str, reason: str
) -> None:
    row = judged_joint(ROW | change, FINGER_MM)
    assert (row["verdict"], row["reason"]) == (expected, reason)
    status = {BELIEVE: "ok", CARE: "ok", NO: "failed" if reason == "not-solved" else "weak"}
    assert row["status"] == status[expected]


def test_doubts_are_listed_by_weight_with_their_numbers() -> None:
    row = judged_joint(ROW | {"sd_mm": 9.0, "range_deg": 6.25, "axis_sd_deg": 8.5}, FINGER_MM)
    assert [*json.loads(row["reason_values"]).items()] == [
        ("moved-too-little", {"range_deg": 6.25}),
        ("uncertain", {"sd_mm": 9.0, "radius_95_mm": 14.489, "wanted_mm": 2.0}),
        ("axis-uncertain", {"axis_sd_deg": 8.5}),
    ]


def test_joints_of_a_suspect_hand_are_not_believed_and_keep_other_doubts() -> None:
    suspect = {"suspect-recording": {"recordings": ["rom"]}}
    row = judged_joint(ROW | {"sd_mm": 2.5}, FINGER_MM, suspect)
    assert (row["verdict"], row["reason"], row["status"]) == (NO, "suspect-recording", "weak")
    assert [*doubts_of(row)] == ["suspect-recording", "uncertain"]


@given(sizes, sizes, nullable, nullable, st.floats(0.5, 20.0), st.lists(kinds, max_size=2))
def test_a_smaller_error_with_fewer_doubts_is_never_judged_worse(
    sd_mm: float, other_mm: float, gap_mm: float | None, range_deg: float | None, wanted_mm: float, more: Any
) -> None:
    small, large = sorted((sd_mm, other_mm))
    row = ROW | {"gap_rms_mm": gap_mm, "range_deg": range_deg}
    better, worse = (
        judged_joint(row | {"sd_mm": sd} | note_doubts({kind: {} for kind in doubts}), wanted_mm)["verdict"]
        for sd, doubts in ((small, []), (large, more))
    )
    assert VERDICTS.index(better) <= VERDICTS.index(worse)
