"""What the skeletons are worth, what would make them better, and where the receivers sit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from report_samples.read_page import ReadTable, read_page, rows_where, table_called

from shukotsu.schemas.findings import STAGE
from shukotsu.stages.report.belief import BELIEVED, belief
from shukotsu.stages.report.headline import headline, opening
from shukotsu.stages.report.next_step import next_step
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.trust import study_beliefs

SCORES = "Mean over digits and hands: subject S01, opposition."
TRUTH = "Distance of the joints from the true ones, both hands: subject S01."


def _text(page: str) -> str:
    return " ".join(" ".join(read_page(page).text).split())


def _mean(rows: list[dict[str, Any]], name: str) -> str:
    known = [row[name] for row in rows if row[name] is not None]
    return f"{np.mean(known):.2f}" if known else "–"


def _truth_table(page: str) -> ReadTable:
    (found,) = [table for table in read_page(page).tables if table.caption.startswith(TRUTH)]
    return found


def test_scores_are_means_of_the_table(fitted: StudyResults, fitted_page: str) -> None:
    """Held-out rows and references, in-sample rows apart; every cell the mean over both hands' digits."""
    table = table_called(fitted_page, SCORES)
    seen = table_called(fitted_page, f"In-sample, m{SCORES[1:]}")
    assert [row[:3] for row in seen.rows[1:]] == [
        ["paper-fig4", "opposition", "○ no"],
        ["whole-hand", "opposition", "○ no"],
    ]
    assert [row[:3] for row in table.rows] == [
        ["Skeleton", "Made from", "Held out"],
        ["paper-fig4", "rom", "yes"],
        ["whole-hand", "rom", "yes"],
        ["Reference", "Made from", "Held out"],
        ["prior-only", "–", "–"],
        ["distal-receiver", "–", "–"],
        ["true-skeleton", "–", "–"],
    ]
    names = ("replay_mean_mm", "posed_mean_mm", "left_out_mean_mm", "wrist_mcp_sd_mm", "metacarpal_deg")
    for cells in (row for row in [*table.rows, *seen.rows] if row[1] != "Made from"):
        made_from = "" if cells[1] == "–" else cells[1]
        rows = rows_where(fitted.scores, model=cells[0], calibrated_on=made_from)
        expected = [_mean(rows, name) for name in (*names, "true_tip_mean_mm")]
        if cells[0] in ("paper-fig4", "true-skeleton"):  # never posed, so nothing was left out of a pose
            expected[2] = "–"
        assert cells[3:] == expected


def test_joints_against_the_truth(fitted: StudyResults, fitted_page: str) -> None:
    """Median, 90th percentile, worst, share far off, parts, axis, bones and coverage, a row a skeleton."""
    table = _truth_table(fitted_page)
    assert [row[0] for row in table.rows[1:]] == ["paper-fig4"] * 2 + ["whole-hand"] * 2 + [
        "Reference",
        "prior-only",
    ]
    for cells in (row for row in table.rows[1:] if row[0] != "Reference"):
        made_from = "" if cells[1] == "–" else cells[1]
        rows = rows_where(fitted.joint_errors, model=cells[0], calibrated_on=made_from)
        error = np.array([row["error_mm"] for row in rows if row["error_mm"] is not None])
        assert len(error) == 29
        axes = [row["axis_deg"] for row in rows if row["axis_deg"] is not None]
        within = [row["within_95"] for row in rows if row["within_95"] is not None]
        expected = [np.median(error), np.quantile(error, 0.9), error.max()]
        medians = [0.8 * np.median(error), 0.6 * np.median(error), np.median(axes), np.median(error)]
        assert cells[2:] == [
            "29 of 30",
            *(f"{value:.2f}" for value in expected),
            f"{100 * np.mean(error > 5):.0f}",
            *(f"{value:.2f}" for value in medians),
            f"{100 * np.mean(within):.0f}" if within else "–",
        ]


def test_without_a_truth_nothing_is_said_of_it(page: str) -> None:
    """A real study has neither the truth's columns nor a word about its absence."""
    table = table_called(page, SCORES)
    assert not [cell for cell in table.rows[0] if cell.startswith(("Metacarpal", "True"))]
    assert not [table for table in read_page(page).tables if "true one" in table.caption]
    assert "compared with its truth" not in _text(page)


def test_headline_leads_with_the_fitted_hand(fitted: StudyResults) -> None:
    """Recordings, held-out error, joints beside the paper's."""
    mine = rows_where(fitted.scores, model="whole-hand", held_out=True)
    joints = [
        [row["error_mm"] for row in rows_where(fitted.joint_errors, model=model, calibrated_on="rom")]
        for model in ("whole-hand", "paper-fig4")
    ]
    ours, theirs = ([error for error in errors if error is not None] for errors in joints)
    far = sum(error > 5 for error in theirs)
    assert far
    assert headline(fitted) == (
        "4 of 4 recordings were used; they are simulated, so no person's hand is behind these numbers. "
        "On recordings that it was not made from, whole-hand misses the distal receivers, whose positions it "
        f"was not told, by {_mean(mine, 'left_out_mean_mm')} mm on average (anatomy alone, without data: "
        f"6.72 mm). Made from rom, its joints are {np.median(ours):.1f} mm from the true ones in the median "
        f"and 0 of 29 are more than 5 mm off; those of paper-fig4 {np.median(theirs):.1f} mm and {far} of 29."
    )


def test_the_opening_says_which_how_good_and_what_next(fitted: StudyResults) -> None:
    """Every joint is in one of the three lists, and what to do next stands last."""
    text = opening(fitted)
    rows = rows_where(fitted.joints, model="whole-hand")
    believed = [row["sd_mm"] for row in rows if belief(row) == BELIEVED]
    beliefs = study_beliefs(fitted, "whole-hand")
    count = sum(each == BELIEVED for each in beliefs.values())
    assert text.startswith(
        f"{count} of {len(beliefs)} joints can be believed in both hands, as whole-hand places them, "
        f"typically to {np.median(believed):.1f} mm: "
    )
    assert "Not: DIP of ring and little." in text
    assert text.endswith(next_step(fitted))


def _suspect(*hands: str) -> list[dict[str, str]]:
    row = {"subject": "S01", "session": "", "task": "rom", "model": "", "stage": STAGE, "kind": "units"}
    return [row | {"severity": "suspect", "message": "in m", "hand": hand} for hand in hands]


def test_a_hand_that_is_left_out_is_counted_out_aloud(fitted: StudyResults) -> None:
    """The joints that follow are of the other hand, and no headline is made of hands that are not judged."""
    text = opening(replace(fitted, problems=_suspect("left")))
    assert text.startswith("Judged: 1 of 2 hands. Left out for what was found in their recordings: 1. ")
    assert "can be believed, as whole-hand places them" in text
    assert "Next: settle what was found in the recordings of subject S01's left hand" in text
