"""Verdicts on joints: their words follow from the table, and every kind of doubt has a sentence."""

from typing import Any

import pytest
from report_samples.made_study import gain_rows
from report_samples.pages import rows_where

from shukotsu.report import belief
from shukotsu.report.belief import BELIEVED, CARE, MOST_GAINS, NOT
from shukotsu.report.study_results import StudyResults
from shukotsu.report.templates import speaking
from shukotsu.study import verdict
from shukotsu.study.layout import FINGER_MM, read_layout
from shukotsu.study.verdict import LIMITS, UNJUDGED, judged_joint, note_doubts
from shukotsu.tables.subjects import Hand
from shukotsu.translation import FOREIGN

VALUES: dict[str, dict[str, Any]] = {
    verdict.FAR: {"what": "palm width", "sd": 6.4},
    verdict.TOO_CLOSE: {"joints": ["middle_mcp", "ring_mcp"], "mm": 4.5},
    verdict.HALVES: {"gap_mm": 7.3},
    verdict.UNCERTAIN: {"sd_mm": 3.0, "radius_95_mm": 4.8, "wanted_mm": 2.0},
    verdict.ONE_WAY: {"sd_mm": 3.0, "radius_95_mm": 4.8, "wanted_mm": 2.0, "worst_mm": 2.9},
    verdict.MOVED_LITTLE: {"range_deg": 6.2},
    verdict.NO_POSE: {"segments": ["index_distal"]},
    verdict.NOT_WORN: {"segments": ["index_distal"]},
    verdict.ONE_RECEIVER: {"segments": ["index_middle", "index_distal"]},
    verdict.ACROSS: {"segment": "ring_metacarpal", "receiver": "hand"},
    verdict.AXIS_IN_PLANE: {"axis_plane_deg": 4.0, "slide_mm": 59.0},
    verdict.BY_HAND: {"correction_mm": 3.0},
    verdict.FROM_DOUBTFUL: {"joints": ["ring_mcp", "little_mcp"]},
    verdict.AXIS: {"axis_sd_deg": 8.0},
}
OF_BONES = {verdict.NO_LENGTH, verdict.END_IN_DOUBT, verdict.NOT_THE_BONE}


LEFT = Hand("S01", "left")


@pytest.mark.parametrize("language", ["en", "ja"])
def test_every_kind_of_doubt_has_a_sentence(language: str) -> None:
    for kind in {*LIMITS} - OF_BONES - {verdict.NOT_SOLVED}:
        row = {**UNJUDGED, **note_doubts({kind: VALUES.get(kind, {})}), "message": ""}
        with speaking(language):
            (sentence,) = belief.reasons_of(row)
        assert "{" not in sentence
        assert FOREIGN not in sentence
        assert sentence.isascii() == (language == "en")


def test_the_wanted_error_is_listed_for_each_layout() -> None:
    arm, hand = read_layout("arm"), read_layout("liberty16")
    assert belief.wanted_text([hand, hand]) == "2"
    assert belief.wanted_text([arm, hand], 3.0) == "6 or 30"


def _with_changed_row(results: StudyResults, model: str, joint: str, **changes: object) -> StudyResults:
    def of(row: dict[str, Any]) -> dict[str, Any]:
        mine = (row["subject"], row["hand"], row["model"], row["joint"]) == ("S01", "left", model, joint)
        return judged_joint(row | UNJUDGED | changes, FINGER_MM) if mine else row

    return results.with_rows(joint_centres=[of(row) for row in results.rows.joint_centres])


@pytest.mark.parametrize("model", ["paper-fig4", "whole-hand"])
@pytest.mark.parametrize(
    ("changes", "believed", "why"),
    [
        ({}, BELIEVED, ""),
        ({"message": "a note."}, BELIEVED, "a note"),
        ({"sd_mm": 2.01}, CARE, "the error exceeds 2 mm (1 sigma, 3-D)"),
        ({"sd_mm": None}, CARE, "no error is stated for the position"),
        (
            {"range_deg": 3.2, "sd_mm": 7.0},
            NOT,
            "moved only 3 deg; skin motion alone can cause this; the error exceeds 2 mm (1 sigma, 3-D)",
        ),
        ({"status": "failed", "sd_mm": None, "message": "no frames"}, NOT, "has no position: no frames"),
    ],
)
def test_verdict_and_reasons_follow_from_the_row(
    fitted: StudyResults, model: str, changes: dict[str, object], believed: str, why: str
) -> None:
    table = belief.joint_table(_with_changed_row(fitted, model, "index_pip", **changes), LEFT, model)
    (row,) = (row for row in table.blocks[0].rows if ">index_pip<" in row[0] or row[0] == "index_pip")
    assert (row[1], row[-1]) == (believed, why)


def test_the_joint_table_lists_every_joint_with_its_numbers(fitted: StudyResults) -> None:
    rows = rows_where(fitted.rows.joint_centres, subject="S01", hand="left", model="whole-hand")
    block = belief.joint_table(fitted, LEFT, "whole-hand").blocks[0]
    assert block.header[:4] == ("Joint", "Believe it?", "SD of the centre [mm]", "Range moved [deg]")
    for row, cells in zip(rows, block.rows, strict=True):
        sd, moved = row["sd_mm"], row["range_deg"]
        assert cells[0] == f'<span id="left-{row["joint"]}">{row["joint"]}</span>'
        assert cells[2:4] == ("–" if sd is None else f"{sd:.1f}", "–" if moved is None else f"{moved:.1f}")
    counted = [len(rows_where(rows, verdict=verdict)) for verdict in ("believe", "care", "no")]
    assert belief.believed_counts(rows) == "✓ yes {}, ◆ with care {}, ✕ no {}".format(*counted)


def test_a_joint_slightly_over_the_limit_states_its_remaining_uses(fitted: StudyResults) -> None:
    layout = fitted.layouts[LEFT]
    believed = rows_where(fitted.joints_of[LEFT, "whole-hand"], verdict="believe")
    row = {**believed[0], "sd_mm": 2.2, **note_doubts({verdict.UNCERTAIN: {"wanted_mm": 2.0}})}
    mends = {**gain_rows()[0], "joint": row["joint"], "joint_sd_after_mm": 1.9}
    helps = belief.near_lines([row], [mends], layout)
    assert "the error is 2 to 2.5 mm" in helps[0]
    assert "moment arms" in helps[0]
    assert helps[1:] == belief.gain_lines([mends])
    with speaking("ja"):
        assert row["joint"] not in belief.near_lines([row], [mends], layout)[0]
    assert "bend slowly" in belief.near_lines([row], [{**mends, "joint_sd_after_mm": 2.1}], layout)[1]
    assert belief.near_lines([row | {"sd_mm": 2.6}, row | {"sd_mm": 1.9}], [mends], layout) == []


def test_the_three_best_gains_are_written_as_sentences(fitted: StudyResults) -> None:
    rows = next(iter(fitted.gains_of.values()))
    lines = belief.gain_lines(rows)
    assert len(lines) == min(len(rows), MOST_GAINS)
    for line, row in zip(lines, rows, strict=False):
        assert f"to within {row['sd_mm']:.1f} mm would reduce " in line
        assert f"from {row['joint_sd_before_mm']:.1f} to {row['joint_sd_after_mm']:.1f} mm" in line
        assert f"joints: {row['mean_sd_before_mm']:.2f} to {row['mean_sd_after_mm']:.2f} mm)." in line
    text = " ".join(belief.gain_lines(gain_rows()))
    assert "Touching a known point with the ring fingertip" in text
    assert "Measuring the " in text
