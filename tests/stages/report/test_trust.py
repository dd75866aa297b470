"""Whether to believe a joint: the words follow from the table, and models are compared where both are."""

from __future__ import annotations

from dataclasses import replace

import pytest
from report_samples.read_page import read_page, table_called
from report_samples.rendered import subject_page

from shukotsu.schemas.layout import FINGER_MM
from shukotsu.schemas.study import Hand
from shukotsu.schemas.verdict import UNJUDGED, judged_joint
from shukotsu.stages.report.belief import BELIEVED, CARE, NOT
from shukotsu.stages.report.study_results import Row, StudyResults
from shukotsu.stages.report.trust import joint_anchor, verdicts

LEFT = Hand("S01", "left")


def _with(results: StudyResults, model: str, joint: str, **changes: object) -> StudyResults:
    """The results with one joint of S01's left hand changed."""

    def of(row: Row) -> Row:
        mine = (row["subject"], row["hand"], row["model"], row["joint"]) == ("S01", "left", model, joint)
        return judged_joint(row | UNJUDGED | changes, FINGER_MM) if mine else row

    return replace(results, joints=[of(row) for row in results.joints])


def _verdict(results: StudyResults, model: str, joint: str) -> tuple[str, str]:
    (found,) = [v for v in verdicts(results, LEFT, model) if v.joint == joint]
    return found.believed, found.why


@pytest.mark.parametrize("model", ["paper-fig4", "whole-hand"])
@pytest.mark.parametrize(
    ("changes", "believed", "why"),
    [
        ({}, BELIEVED, ""),
        ({"message": "a note."}, BELIEVED, "a note"),
        ({"sd_mm": 2.01}, CARE, "known less well than to 2 mm (1 sigma, 3-D)"),
        ({"sd_mm": None}, CARE, "no error is stated for its place"),
        (
            {"range_deg": 3.2, "sd_mm": 7.0},
            NOT,
            "moved only 3 deg; skin alone can look like that; known less well than to 2 mm (1 sigma, 3-D)",
        ),
        ({"status": "failed", "sd_mm": None, "message": "no frames"}, NOT, "has no place: no frames"),
    ],
)
def test_the_words_are_of_the_columns(
    fitted: StudyResults, model: str, changes: dict[str, object], believed: str, why: str
) -> None:
    changed = _with(fitted, model, "index_pip", **changes)
    assert _verdict(changed, model, "index_pip") == (believed, why)


def test_the_page_says_it_in_words(fitted: StudyResults) -> None:
    """Every joint, each reason once below; the picture of the hand leads to every row."""
    page = subject_page(fitted, "S01")
    caption = "Whether to believe the joints of whole-hand: subject S01, left hand."
    table = table_called(page, caption)
    found = {v.joint: v for v in verdicts(fitted, LEFT, "whole-hand")}
    assert [row[0] for row in table.rows[1:]] == list(found)
    for row in table.rows[1:]:
        assert row[1] == found[row[0]].believed
    whys = [verdict.why for verdict in found.values() if verdict.why]
    text = " ".join(read_page(page).text)
    assert whys
    for why in set(whys):
        assert text.count(f": {why}.") >= 1
    tags = read_page(page).tags
    links = {attrs["href"] for tag, attrs in tags if tag == "a" and "aria-label" in attrs}
    rows = {attrs["id"] for tag, attrs in tags if tag == "tr" and "id" in attrs}
    assert {f"#{joint_anchor(LEFT, joint, 'whole-hand')}" for joint in found} <= links
    assert {str(link).removeprefix("#") for link in links} <= rows
    assert table_called(page, "Whether to believe the joints of paper-fig4: subject S01, left hand.")
