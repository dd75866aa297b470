"""Whether to believe a joint: the words follow from the table."""

from __future__ import annotations

from dataclasses import replace

import pytest
from report_samples.read_page import rows_where

from shukotsu.schemas.layout import FINGER_MM
from shukotsu.schemas.study import Hand
from shukotsu.schemas.verdict import UNJUDGED, judged_joint
from shukotsu.stages.report.belief import BELIEVED, CARE, NOT, believed_counts, joint_table
from shukotsu.stages.report.study_results import Row, StudyResults

LEFT = Hand("S01", "left")


def _with(results: StudyResults, model: str, joint: str, **changes: object) -> StudyResults:
    """The results with one joint of S01's left hand changed."""

    def of(row: Row) -> Row:
        mine = (row["subject"], row["hand"], row["model"], row["joint"]) == ("S01", "left", model, joint)
        return judged_joint(row | UNJUDGED | changes, FINGER_MM) if mine else row

    return replace(results, joints=[of(row) for row in results.joints])


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
    table = joint_table(_with(fitted, model, "index_pip", **changes), LEFT, model)
    (row,) = (row for row in table.blocks[0].rows if row[0] == "index_pip")
    assert (row[1], row[-1]) == (believed, why)


def test_every_joint_stands_with_its_numbers(fitted: StudyResults) -> None:
    rows = rows_where(fitted.joints, subject="S01", hand="left", model="whole-hand")
    block = joint_table(fitted, LEFT, "whole-hand").blocks[0]
    assert block.header[:4] == ("Joint", "Believe it?", "SD of the centre [mm]", "Moved [deg]")
    for row, cells in zip(rows, block.rows, strict=True):
        sd, moved = row["sd_mm"], row["range_deg"]
        assert cells[0] == row["joint"]
        assert cells[2:4] == ("–" if sd is None else f"{sd:.2f}", "–" if moved is None else f"{moved:.1f}")
    counted = [len(rows_where(rows, verdict=verdict)) for verdict in ("believe", "care", "no")]
    assert believed_counts(rows) == "✓ yes {}, ◆ with care {}, ✕ no {}".format(*counted)
