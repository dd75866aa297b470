"""What a study's figures show: the tables' own numbers, who is missing and why, n and units."""

import math
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.container import BarContainer
from report_samples.compared import compared
from report_samples.read_page import rows_where

from shukotsu.schemas.results import STUDY_FIGURES
from shukotsu.stages.report.comparison.answers import answer
from shukotsu.stages.report.comparison.questions import JOINT_ERROR, TRUE_TIP
from shukotsu.stages.report.palette import PAPER
from shukotsu.stages.report.print_figures.drawing import Drawing, NoDataError
from shukotsu.stages.report.print_figures.joints import bone_lengths, joint_errors, joint_trust
from shukotsu.stages.report.print_figures.models import models_by_digit, paired_differences
from shukotsu.stages.report.print_figures.study_figures import of_study
from shukotsu.stages.report.study_results import StudyResults

MODELS = ("paper-fig4", "whole-hand")


def names_of(axes: Axes) -> list[str]:
    """Return what its rows are called, from the top."""
    return list(axes.yaxis.get_major_formatter().seq)  # type: ignore[attr-defined]


def dots_of(axes: Axes) -> dict[int, dict[str, float]]:
    """Return the numbers that are drawn, by row from the top and then by name."""
    dots = [line for line in axes.lines if str(line.get_gid()).startswith("dots")]
    return {
        int(str(line.get_gid())[4:]): dict(
            zip(str(line.get_label()).split("\n"), np.asarray(line.get_xdata(), float).tolist(), strict=True)
        )
        for line in dots
    }


def subject_means(results: StudyResults, model: str, digit: str, column: str) -> list[float]:
    """Held-out means over a subject's hands, straight from the rows."""
    found = defaultdict(list)
    for row in results.scores:
        if (row["model"], row["digit"], row["held_out"]) == (model, digit, True) and row[column] is not None:
            found[row["subject"]].append(row[column])
    return [math.fsum(values) / len(values) for values in found.values()]


def test_a_dot_is_a_subjects_held_out_mean(simulated: StudyResults) -> None:
    axes = models_by_digit(simulated)[0].axes[0]
    names, digit, seen = names_of(axes), "", 0
    for row, name in enumerate(names):
        digit = digit if row in dots_of(axes) else name
        if name in MODELS:
            expected = subject_means(simulated, name, digit.lower(), "true_tip_mean_mm")
            assert len(expected) == 8
            np.testing.assert_allclose(sorted(dots_of(axes)[row].values()), sorted(expected))
            seen += 1
    assert seen == 10


def test_differences_mean_and_interval_are_the_comparisons(
    simulated: StudyResults, drawings: dict[str, Drawing]
) -> None:
    for axes, question in zip(paired_differences(simulated)[0].axes, (TRUE_TIP, JOINT_ERROR), strict=True):
        own = answer(simulated, question)
        assert own is not None
        (comparison,) = own.overall
        assert comparison.interval is not None
        assert dots_of(axes) == {0: comparison.differences}
        bar, mean = axes.lines[-2:]
        assert tuple(bar.get_xdata()) == comparison.interval
        assert list(mean.get_xdata()) == [comparison.mean_difference]
        assert f"{comparison.mean_difference:.2f} mm" in drawings["paired-differences"].caption


def test_without_a_truth_replays_and_fitted_hands_stand_apart(simulated: StudyResults) -> None:
    """Left-out errors are of fitted hands alone; a replay's are not one test with theirs."""
    blind = [{**row, "true_tip_mean_mm": None} for row in simulated.scores]
    untold = compared(replace(simulated, scores=blind, joint_errors=[]))
    figure, caption = models_by_digit(untold)
    left_out, replay = figure.axes
    assert (left_out.get_xlabel(), replay.get_xlabel()) == ("Left-out error [mm]", "Replay's tip error [mm]")
    assert MODELS[0] not in names_of(left_out)
    assert names_of(left_out).count(MODELS[1]) == names_of(replay).count(MODELS[0]) == 5
    assert "not where they are" in caption
    assert "prior-only" in paired_differences(untold)[0].axes[0].get_xlabel()


def test_joint_errors_and_stated_ones_are_the_tables(simulated: StudyResults) -> None:
    axes = joint_errors(simulated)[0].axes[1]
    rows = rows_where(simulated.joint_errors, model="whole-hand", calibrated_on="rom")
    for row, joint in enumerate(names_of(axes)):
        errors = [each["error_mm"] for each in rows_where(rows, joint=joint) if each["error_mm"] is not None]
        np.testing.assert_allclose(sorted(dots_of(axes)[row].values()), sorted(errors))
    levels = [lines.get_segments()[0] for lines in axes.collections]  # type: ignore[attr-defined]
    assert [[1.0, -0.4], [1.0, 0.4]] in [level.tolist() for level in levels]


def test_trust_counts_every_hand_of_the_study(results: StudyResults) -> None:
    """Of four hands one failed wholly, and on another the ring DIP joint failed, the little one is weak."""
    axes = joint_trust(results)[0].axes[-1]
    bars = [bar for bar in axes.containers if isinstance(bar, BarContainer)]
    shares = {name: [bar.patches[row].get_width() for bar in bars] for row, name in enumerate(names_of(axes))}
    *_, no, absent = shares["ring_dip"]
    assert no == absent == 25
    believed, _, no, _ = shares["little_dip"]
    assert (believed, no) == (50, 25)
    assert shares["index_pip"][0] == 75


def test_bones_have_their_length_and_stated_error(simulated: StudyResults) -> None:
    bones = [
        {**row, "length_mm": 40.0 + index % 7, "sd_mm": 0.5} if row["model"] == "whole-hand" else row
        for index, row in enumerate(simulated.bones)
    ]
    axes = bone_lengths(replace(simulated, bones=bones))[0].axes[0]
    drawn = [float(np.asarray(line.get_xdata())[0]) for line in axes.lines]
    expected = [row["length_mm"] for row in bones if row["model"] == "whole-hand"]
    np.testing.assert_allclose(sorted(drawn), sorted(expected))
    reaches = [np.ptp(bars.get_segments()[0][:, 0]) for bars in axes.collections]  # type: ignore[attr-defined]
    np.testing.assert_allclose(reaches, 1.0)
    faces = [line.get_markerfacecolor() for line in axes.lines]
    assert 0 < faces.count(PAPER) < len(faces)


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
