"""What a study's figures show: the tables' own numbers, who is missing and why, n and units."""

import math
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from report_samples.read_page import rows_where

from schemas.errors import InputError
from schemas.results import STUDY_FIGURES
from stages.report.belief import BELIEVED, CARE, NOT
from stages.report.comparison.answers import answer
from stages.report.comparison.questions import JOINT_ERROR, TRUE_TIP
from stages.report.palette import MODELS as COLOURS
from stages.report.print_figures.drawing import Drawing, NoDataError
from stages.report.print_figures.joints import joint_trust
from stages.report.print_figures.models import models_by_digit, paired_differences
from stages.report.print_figures.study_figures import of_study
from stages.report.print_figures.style import applied
from stages.report.study_results import StudyResults
from stages.report.trust import study_beliefs

MODELS = ("paper-fig4", "whole-hand")


def dots_in(axes: Axes, colour: str) -> list[np.ndarray]:
    """Places (n, 2) of every group of dots in that colour, in the order in which they were drawn."""
    return [line.get_xydata() for line in axes.lines if (line.get_color(), line.get_alpha()) == (colour, 0.6)]


def subject_means(results: StudyResults, model: str, digit: str, column: str) -> list[float]:
    """Held-out means over a subject's hands, straight from the rows."""
    found = defaultdict(list)
    for row in results.scores:
        if (row["model"], row["digit"], row["held_out"]) == (model, digit, True) and row[column] is not None:
            found[row["subject"]].append(row[column])
    return [math.fsum(values) / len(values) for values in found.values()]


def test_every_figure_is_there_in_its_order(drawings: dict[str, Drawing]) -> None:
    assert tuple(drawings) == STUDY_FIGURES
    of_movement = STUDY_FIGURES[-4:]  # this study has none
    assert tuple(name for name, drawing in drawings.items() if drawing.missing) == of_movement


def test_a_dot_is_a_subjects_held_out_mean(simulated: StudyResults, drawings: dict[str, Drawing]) -> None:
    panel = drawings["models-by-digit"].figure.axes[0]
    digits = [label.get_text().lower() for label in panel.get_xticklabels()]
    assert digits == ["thumb", "index", "middle", "ring", "little"]
    for model, colour in zip(MODELS, COLOURS, strict=False):
        drawn = dots_in(panel, colour)
        for digit, places in zip(digits, drawn, strict=True):
            expected = subject_means(simulated, model, digit, "true_tip_mean_mm")
            assert len(expected) == 8
            np.testing.assert_allclose(sorted(places[:, 1]), sorted(expected))


def test_marks_are_medians_and_bars_quartiles(simulated: StudyResults, drawings: dict[str, Drawing]) -> None:
    panel = drawings["models-by-digit"].figure.axes[0]
    values = subject_means(simulated, "whole-hand", "little", "true_tip_mean_mm")
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
    lines = [np.asarray(line.get_ydata(), float) for line in panel.lines if line.get_color() == COLOURS[1]]
    assert any(y.shape == (1,) and np.isclose(y[0], middle) for y in lines)
    assert any(y.shape == (2,) and np.allclose(y, [low, high]) for y in lines)


def test_joint_panel_has_the_joints_mean(simulated: StudyResults, drawings: dict[str, Drawing]) -> None:
    """S7, whose left hand failed, has the right hand's joints alone."""
    panel = drawings["models-by-digit"].figure.axes[1]
    mine = rows_where(simulated.joint_errors, subject="S7", model="whole-hand", calibrated_on="rom")
    errors = [row["error_mm"] for row in mine if row["joint"].startswith("middle_")]
    assert len(errors) == 3
    middle = dots_in(panel, COLOURS[1])[2]
    assert np.isclose(middle[:, 1], np.mean(errors)).any()


def test_differences_mean_and_interval_are_the_comparisons(
    simulated: StudyResults, drawings: dict[str, Drawing]
) -> None:
    figure = drawings["paired-differences"].figure
    for panel, question in zip(figure.axes, (TRUE_TIP, JOINT_ERROR), strict=True):
        own = answer(simulated, question)
        assert own is not None
        (comparison,) = own.overall
        assert comparison.statistics is not None
        assert comparison.statistics.interval is not None
        (places,) = dots_in(panel, COLOURS[1])
        np.testing.assert_allclose(places[:, 0], [pair.difference for pair in comparison.compared])
        drawn = [np.asarray(line.get_xdata(), float) for line in panel.lines]
        assert any(x.shape == (1,) and np.isclose(x[0], comparison.statistics.mean) for x in drawn)
        assert any(x.shape == (2,) and np.allclose(x, comparison.statistics.interval) for x in drawn)
        assert f"{comparison.statistics.mean:.2f} mm" in drawings["paired-differences"].caption


def test_differences_can_be_taken_from_another_model(simulated: StudyResults) -> None:
    with applied():
        figure, caption = paired_differences(simulated, "whole-hand")
        with pytest.raises(InputError, match="--against nobody: no such model; expected one of paper-fig4, "):
            paired_differences(simulated, "nobody")
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == ["paper-fig4"]
    assert "less that of whole-hand" in caption


def test_without_a_truth_replays_and_fitted_hands_stand_apart(simulated: StudyResults) -> None:
    """Left-out errors are of fitted hands alone; a replay's are not one test with theirs."""
    blind = [{**row, "true_tip_mean_mm": None} for row in simulated.scores]
    with applied():
        figure, caption = models_by_digit(replace(simulated, scores=blind, joint_errors=[]))
        differences, _ = paired_differences(replace(simulated, scores=blind, joint_errors=[]))
    labels = [panel.get_ylabel() for panel in figure.axes]
    assert labels == ["Left-out error [mm]", "Replay's tip error [mm]"]
    assert dots_in(figure.axes[0], COLOURS[0]) == []
    assert len(dots_in(figure.axes[0], COLOURS[1])) == len(dots_in(figure.axes[1], COLOURS[0])) == 5
    assert "not where they are" in caption
    assert "prior-only" in differences.axes[0].get_xlabel()


def test_joint_errors_and_stated_ones_are_the_tables(
    simulated: StudyResults, drawings: dict[str, Drawing]
) -> None:
    figure = drawings["joint-errors"].figure
    panel = figure.axes[1]
    joints = [label.get_text() for label in figure.axes[-1].get_xticklabels()]
    rows = rows_where(simulated.joint_errors, model="whole-hand", calibrated_on="rom")
    for joint, places in zip(joints, dots_in(panel, COLOURS[1]), strict=True):
        expected = [row["error_mm"] for row in rows_where(rows, joint=joint) if row["error_mm"] is not None]
        np.testing.assert_allclose(sorted(places[:, 1]), sorted(expected))
    stated = [line for line in panel.lines if line.get_color() == "black"]
    assert [list(line.get_ydata()) for line in stated] == [[1.0, 1.0]] * len(joints)


def test_trust_counts_every_hand_of_the_study(results: StudyResults) -> None:
    """Of four hands one failed wholly, and on another the ring DIP joint failed, the little one is weak."""
    with applied():
        figure, _ = joint_trust(results)
    joints = [label.get_text() for label in figure.axes[-1].get_xticklabels()]
    shares = {
        str(bars.get_label()): dict(zip(joints, (bar.get_height() for bar in bars), strict=False))
        for bars in figure.axes[-1].containers
    }
    assert shares["no result"]["ring_dip"] == shares[NOT]["ring_dip"] == 25
    assert (shares[BELIEVED]["little_dip"], shares[NOT]["little_dip"]) == (50, 25)
    assert shares[BELIEVED]["index_pip"] == 75


def test_the_figure_says_of_a_joint_what_the_pages_say(results: StudyResults) -> None:
    """A centre that is known less well is to be believed with care in both."""
    less = [row | {"verdict": "care"} if row["joint"] == "wrist" else row for row in results.joints]
    with applied():
        figure, _ = joint_trust(replace(results, joints=less))
    place = [label.get_text() for label in figure.axes[-1].get_xticklabels()].index("wrist")
    heights = {bars.get_label(): bars[place].get_height() for bars in figure.axes[-1].containers}
    assert (heights[CARE], heights[BELIEVED]) == (75, 0)
    assert study_beliefs(replace(results, joints=less), results.leading)["wrist"] == CARE


def test_bones_have_their_length_and_stated_error(simulated: StudyResults) -> None:
    bones = [
        {**row, "length_mm": 40.0 + index % 7, "sd_mm": 0.5} if row["model"] == "whole-hand" else row
        for index, row in enumerate(simulated.bones)
    ]
    drawing = {each.name: each for each in of_study(replace(simulated, bones=bones))}["bone-lengths"]
    panel = drawing.figure.axes[0]
    drawn = np.concatenate([np.asarray(line.get_ydata(), float) for line in panel.lines])
    expected = [row["length_mm"] for row in bones if row["model"] == "whole-hand"]
    np.testing.assert_allclose(sorted(drawn), sorted(expected))
    segments = np.concatenate([lines.get_segments() for lines in panel.collections])
    np.testing.assert_allclose(np.diff(segments[:, :, 1], axis=1), 1.0)


def test_captions_state_n_units_what_is_missing_and_the_program(drawings: dict[str, Drawing]) -> None:
    for name in ("models-by-digit", "paired-differences", "joint-errors"):
        caption = drawings[name].caption
        assert "mm" in caption
        assert "simulated recordings of 8 subjects, 16 hands" in caption
        assert "Held out" in caption
        assert "Drawn by shukotsu" in caption
    caption = drawings["models-by-digit"].caption
    assert "Without a number: S7: whole-hand and paper-fig4: failed: S7-left.csv" in caption
    assert "n = 8" in drawings["paired-differences"].caption


def test_a_study_without_any_score_says_so(simulated: StudyResults) -> None:
    empty = replace(simulated, scores=[], joint_errors=[], joints=[], bones=[])
    with applied(), pytest.raises(NoDataError, match="no model of this study has a score"):
        models_by_digit(empty)
    drawings = list(of_study(empty))
    assert [drawing.name for drawing in drawings] == list(STUDY_FIGURES)
    for drawing in drawings:
        words = " ".join(text.get_text() for text in drawing.figure.texts)
        assert words.replace("\n", " ") == drawing.missing == drawing.caption
