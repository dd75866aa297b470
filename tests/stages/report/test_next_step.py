"""What to do next: findings first, else what lowers the mean error most, by the numbers of the tables."""

from __future__ import annotations

from dataclasses import replace

from shukotsu.schemas.advice import ENOUGH, MOVE
from shukotsu.schemas.findings import STAGE
from shukotsu.stages.report.next_step import next_step
from shukotsu.stages.report.study_results import Row, StudyResults


def _gain(results: StudyResults, quantity: str, after_mm: float, hand: str = "") -> list[Row]:
    """The study's gains with one quantity better, on one hand or on both."""
    return [
        row | {"mean_sd_after_mm": after_mm}
        if row["quantity"] == quantity and hand in ("", row["hand"])
        else row
        for row in results.gains
    ]


def test_what_was_found_comes_first(fitted: StudyResults) -> None:
    finding = {"subject": "S01", "session": "", "hand": "right", "stage": STAGE, "severity": "refused"}
    text = next_step(replace(fitted, problems=[finding]))
    assert text.startswith("Next: settle what was found in the recordings of subject S01's right hand ")
    assert "below" not in text


def test_the_measurement_that_gains_most_over_all_hands(fitted: StudyResults) -> None:
    """One that is best on a single hand stands behind one that is good on both."""
    both = replace(fitted, gains=_gain(fitted, "ring.touch", 0.9))
    one = replace(both, gains=_gain(both, "index_distal", 0.7, "left"))
    assert next_step(one) == (
        "Next: touch a known point with the tip of the ring finger, to 0.4 mm (2 of 2 hands). Of all that "
        "could be done that gains most: the mean error of the joints would fall from 1.26 to 0.90 mm."
    )


def test_motion_that_gains_more_than_any_measurement(fitted: StudyResults) -> None:
    """Joints that gain least of it are not named, and the number is of those that are."""
    moved = {"index_mcp": 0.5, "ring_mcp": 0.5, "thumb_ip": 4.4}
    advice = [
        row | {"sd_now_mm": 4.5, "sd_moved_mm": moved[row["joint"]], "kind": MOVE}
        if row["joint"] in moved
        else row | {"sd_now_mm": 4.5, "kind": ENOUGH}
        for row in fitted.advice
    ]
    after = 4.5 - 8.0 / len({row["joint"] for row in advice})
    assert next_step(replace(fitted, advice=advice)) == (
        "Next: let MCP of index and ring move more when calibrating (2 of 2 hands). Of all that could be "
        f"done that gains most: the mean error of the joints would fall from 4.50 to {after:.2f} mm."
    )


def test_hands_that_are_left_out_say_nothing_of_what_to_do(fitted: StudyResults) -> None:
    accepted = {"subject": "S01", "session": "", "hand": "left", "stage": "plan", "severity": "suspect"}
    left = replace(fitted, gains=_gain(fitted, "ring.touch", 0.2, "left"), problems=[accepted])
    assert next_step(left).startswith("Next: nothing is worth recording or measuring again; ")
