"""What to record or measure next: three lines at most, the numbers of the table gains in them."""

from __future__ import annotations

from report_samples.made_scores import gain_rows

from shukotsu.stages.report.belief import MOST_GAINS, gain_lines
from shukotsu.stages.report.study_results import StudyResults


def test_the_best_gains_in_words(fitted: StudyResults) -> None:
    rows = next(iter(fitted.gains_of.values()))
    lines = gain_lines(rows)
    assert len(lines) == min(len(rows), MOST_GAINS)
    for line, row in zip(lines, rows, strict=False):
        assert f"to {row['sd_mm']:.1f} mm would take " in line
        assert f"from {row['joint_sd_before_mm']:.1f} to {row['joint_sd_after_mm']:.1f} mm" in line
        assert f"from {row['mean_sd_before_mm']:.2f} to {row['mean_sd_after_mm']:.2f} mm" in line


def test_a_touch_and_a_length_are_told_apart() -> None:
    key = {"subject": "S01", "hand": "right", "task": "rom", "trial": ""}
    lines = " ".join(gain_lines(gain_rows(key, "whole-hand")))
    assert "Touching a known point with the " in lines
    assert "Measuring " in lines
