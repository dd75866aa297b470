"""What a study's figures show: the tables' own numbers, who is missing and why, n and units."""

import math
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from report_samples.compared import compared
from report_samples.read_page import rows_where

from shukotsu.schemas.results import STUDY_FIGURES
from shukotsu.stages.report.belief import BELIEVED, NOT
from shukotsu.stages.report.comparison.answers import answer
from shukotsu.stages.report.comparison.questions import JOINT_ERROR, TRUE_TIP
from shukotsu.stages.report.plots.description import Plot, Row, RowsPanel
from shukotsu.stages.report.print_figures.drawing import Drawing, NoDataError
from shukotsu.stages.report.print_figures.joints import KINDS, bone_lengths, joint_errors, joint_trust
from shukotsu.stages.report.print_figures.models import models_by_digit, paired_differences
from shukotsu.stages.report.print_figures.study_figures import of_study
from shukotsu.stages.report.study_results import StudyResults

MODELS = ("paper-fig4", "whole-hand")


def panels_of(plot: Plot) -> list[RowsPanel]:
    """Give a plot's panels, all of them of rows."""
    panels = [panel for panel in plot.panels if isinstance(panel, RowsPanel)]
    assert len(panels) == len(plot.panels)
    return panels


def rows_of(panel: RowsPanel, model: str) -> dict[str, Row]:
    """Give a model's rows by group."""
    return {group.heading: row for group in panel.groups for row in group.rows if row.name == model}


def subject_means(results: StudyResults, model: str, digit: str, column: str) -> list[float]:
    """Held-out means over a subject's hands, straight from the rows."""
    found = defaultdict(list)
    for row in results.scores:
        if (row["model"], row["digit"], row["held_out"]) == (model, digit, True) and row[column] is not None:
            found[row["subject"]].append(row[column])
    return [math.fsum(values) / len(values) for values in found.values()]


def test_a_dot_is_a_subjects_held_out_mean(simulated: StudyResults) -> None:
    panel = panels_of(models_by_digit(simulated)[0])[0]
    for model in MODELS:
        rows = rows_of(panel, model)
        assert list(rows) == ["Thumb", "Index", "Middle", "Ring", "Little"]
        for digit, row in rows.items():
            expected = subject_means(simulated, model, digit.lower(), "true_tip_mean_mm")
            assert len(expected) == 8
            np.testing.assert_allclose(sorted(row.numbers.values()), sorted(expected))


def test_differences_mean_and_interval_are_the_comparisons(
    simulated: StudyResults, drawings: dict[str, Drawing]
) -> None:
    panels = panels_of(paired_differences(simulated)[0])
    for panel, question in zip(panels, (TRUE_TIP, JOINT_ERROR), strict=True):
        own = answer(simulated, question)
        assert own is not None
        (comparison,) = own.overall
        assert comparison.interval is not None
        (row,) = panel.rows
        assert row.numbers == comparison.differences
        assert (row.mean, row.interval) == (comparison.mean_difference, comparison.interval)
        assert f"{comparison.mean_difference:.2f} mm" in drawings["paired-differences"].caption


def test_without_a_truth_replays_and_fitted_hands_stand_apart(simulated: StudyResults) -> None:
    """Left-out errors are of fitted hands alone; a replay's are not one test with theirs."""
    blind = [{**row, "true_tip_mean_mm": None} for row in simulated.scores]
    untold = compared(replace(simulated, scores=blind, joint_errors=[]))
    plot, caption = models_by_digit(untold)
    left_out, replay = panels_of(plot)
    assert (left_out.axis, replay.axis) == ("Left-out error [mm]", "Replay's tip error [mm]")
    assert not rows_of(left_out, MODELS[0])
    assert len(rows_of(left_out, MODELS[1])) == len(rows_of(replay, MODELS[0])) == 5
    assert "not where they are" in caption
    assert "prior-only" in panels_of(paired_differences(untold)[0])[0].axis


def test_joint_errors_and_stated_ones_are_the_tables(simulated: StudyResults) -> None:
    panel = panels_of(joint_errors(simulated)[0])[1]
    rows = rows_where(simulated.joint_errors, model="whole-hand", calibrated_on="rom")
    for row in panel.rows:
        own = rows_where(rows, joint=row.name)
        expected = [each["error_mm"] for each in own if each["error_mm"] is not None]
        np.testing.assert_allclose(sorted(row.numbers.values()), sorted(expected))
        assert (1.0, False) in row.levels


def shares_of(results: StudyResults) -> dict[str, dict[str, float]]:
    """Give what the last panel says of every joint: shares of hands, by what to believe."""
    panel = panels_of(joint_trust(results)[0])[-1]
    return {
        row.name: {kind: bar.length for kind, bar in zip(KINDS, row.bars, strict=False)} for row in panel.rows
    }


def test_trust_counts_every_hand_of_the_study(results: StudyResults) -> None:
    """Of four hands one failed wholly, and on another the ring DIP joint failed, the little one is weak."""
    shares = shares_of(results)
    assert shares["ring_dip"]["no result"] == shares["ring_dip"][NOT] == 25
    assert (shares["little_dip"][BELIEVED], shares["little_dip"][NOT]) == (50, 25)
    assert shares["index_pip"][BELIEVED] == 75


def test_bones_have_their_length_and_stated_error(simulated: StudyResults) -> None:
    bones = [
        {**row, "length_mm": 40.0 + index % 7, "sd_mm": 0.5} if row["model"] == "whole-hand" else row
        for index, row in enumerate(simulated.bones)
    ]
    panel = panels_of(bone_lengths(replace(simulated, bones=bones))[0])[0]
    drawn = [length for row in panel.rows for length in row.numbers.values()]
    expected = [row["length_mm"] for row in bones if row["model"] == "whole-hand"]
    np.testing.assert_allclose(sorted(drawn), sorted(expected))
    assert {sd for row in panel.rows for sd in row.spans.values()} == {0.5}
    assert {name.rpartition(" ")[2] for row in panel.rows for name in row.hollow} == {"left"}


def test_captions_state_n_units_what_is_missing_and_the_program(drawings: dict[str, Drawing]) -> None:
    for name in ("models-by-digit", "paired-differences", "joint-errors"):
        caption = drawings[name].caption
        assert "mm" in caption
        assert "simulated recordings of 8 subjects, 16 hands" in caption
        assert "Held out" in caption
        assert "Drawn by shukotsu" in caption
    caption = drawings["models-by-digit"].caption
    assert "Without a number: S7: paper-fig4 and whole-hand: failed: S7-left.csv" in caption
    assert "n = 8" in drawings["paired-differences"].caption


def test_a_study_without_any_score_says_so(simulated: StudyResults) -> None:
    empty = compared(replace(simulated, scores=[], joint_errors=[], joints=[], bones=[]))
    with pytest.raises(NoDataError, match="no model of this study has a score"):
        models_by_digit(empty)
    drawings = list(of_study(empty))
    assert [drawing.name for drawing in drawings] == list(STUDY_FIGURES)
    for drawing in drawings:
        words = " ".join(text.get_text() for text in drawing.figure.texts)
        assert words.replace("\n", " ") == drawing.missing == drawing.caption
