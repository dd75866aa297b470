"""What to do next: findings first, else what lowers the mean error most, by the numbers of the tables."""

from __future__ import annotations

from dataclasses import replace

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


def test_hands_that_are_left_out_say_nothing_of_what_to_do(fitted: StudyResults) -> None:
    accepted = {"subject": "S01", "session": "", "hand": "left", "stage": "plan", "severity": "suspect"}
    accepted["kind"] = "units"
    left = replace(fitted, gains=_gain(fitted, "ring.touch", 0.2, "left"), problems=[accepted])
    assert next_step(left).startswith("Next: nothing is worth recording or measuring again; ")
