"""Tables of the skeletons' scores and of their errors against the truth."""

from typing import Any

import numpy as np
from report_samples.pages import read_page, rows_where, table_called

from shukotsu.report.study_results import StudyResults

SCORES = "Mean over digits and hands: subject S01, opposition."
TRUTH = "Errors of joints against the truth, both hands: subject S01."


def _mean(rows: list[dict[str, Any]], name: str) -> str:
    values = [row[name] for row in rows if row[name] is not None]
    decimals = 1 if name == "true_tip_mean_mm" else 2
    return f"{np.mean(values):.{decimals}f}" if values else "–"


def test_scores_on_the_page_are_means_of_skeleton_scores(fitted: StudyResults, fitted_page: str) -> None:
    """Rows are held-out skeletons, in-sample ones, then references; cells are means over both hands'
    digits.
    """
    table = table_called(fitted_page, SCORES)
    assert [row[:3] for row in table.rows] == [
        ["Skeleton", "Calibrated on", "Held out"],
        ["paper-fig4", "rom", "yes"],
        ["whole-hand", "rom", "yes"],
        ["paper-fig4", "opposition", "○ no"],
        ["whole-hand", "opposition", "○ no"],
        ["Reference", "Calibrated on", "Held out"],
        ["prior-only", "–", "–"],
        ["distal-receiver", "–", "–"],
        ["true-skeleton", "–", "–"],
    ]
    names = ("replay_mean_mm", "posed_mean_mm", "left_out_mean_mm", "wrist_mcp_sd_mm", "metacarpal_deg")
    for cells in (row for row in table.rows if row[1] != "Calibrated on"):
        made_from = "" if cells[1] == "–" else cells[1]
        rows = rows_where(fitted.rows.skeleton_scores, model=cells[0], calibrated_on=made_from)
        expected = [_mean(rows, name) for name in (*names, "true_tip_mean_mm")]
        if cells[0] in ("paper-fig4", "true-skeleton"):  # never posed, so nothing was left out of a pose
            expected[2] = "–"
        assert cells[3:] == expected


def test_the_truth_table_summarises_joint_errors(fitted: StudyResults, fitted_page: str) -> None:
    """Each skeleton's row has n, median, 90th percentile, maximum, share over 5 mm, axis and bone errors,
    coverage.
    """
    (table,) = [table for table in read_page(fitted_page).tables if table.caption.startswith(TRUTH)]
    skeletons = ["paper-fig4", "paper-fig4", "whole-hand", "whole-hand"]
    assert [row[0] for row in table.rows[1:]] == [*skeletons, "Reference", "prior-only"]
    for cells in (row for row in table.rows[1:] if row[0] != "Reference"):
        made_from = "" if cells[1] == "–" else cells[1]
        rows = rows_where(fitted.rows.joint_errors, model=cells[0], calibrated_on=made_from)
        error = np.array([row["error_mm"] for row in rows if row["error_mm"] is not None])
        assert len(error) == 29
        axes = [row["axis_deg"] for row in rows if row["axis_deg"] is not None]
        halves = [row[f"{side}within_95"] for row in rows for side in ("", "parent_")]
        within = [each for each in halves if each is not None]
        expected = [np.median(error), np.quantile(error, 0.9), error.max()]
        medians = [np.median(axes), np.median(error)]
        assert cells[2:] == [
            "29/30",
            *(f"{value:.2f}" for value in expected),
            f"{100 * np.mean(error > 5):.0f}",
            *(f"{value:.2f}" for value in medians),
            f"{100 * np.mean(within):.0f}" if within else "–",
        ]


def test_without_a_truth_no_table_mentions_it(page: str) -> None:
    assert not [cell for cell in table_called(page, SCORES).rows[0] if "truth" in cell]
    assert not [table for table in read_page(page).tables if "true one" in table.caption]
