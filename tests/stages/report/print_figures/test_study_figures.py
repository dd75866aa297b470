"""What a study's figures show: the tables' own numbers, who is missing and why, n and units."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.container import BarContainer
from report_samples.compared import compared
from report_samples.read_page import rows_where

from shukotsu.schemas.results import STUDY_FIGURES
from shukotsu.stages.report.judged_models import REPLAY, judged_models
from shukotsu.stages.report.palette import PAPER
from shukotsu.stages.report.plots.panels import page_figure
from shukotsu.stages.report.print_figures.study_figures import (
    Drawing,
    NoDataError,
    joint_errors,
    joint_trust,
    lengths_panel,
    models,
    of_study,
)
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


def test_a_dot_is_a_subject_and_the_mark_its_mean(simulated: StudyResults) -> None:
    """As model_values has them; a line goes through the dots of one subject."""
    judged = {each.metric: each for each in judged_models(simulated)}
    drawn = models(simulated)[0].axes
    for axes, metric in zip(drawn, (REPLAY, "error_mm", "true_tip_mean_mm"), strict=True):
        rows = names_of(axes)
        dots = {rows[row]: numbers for row, numbers in dots_of(axes).items()}
        assert dots == {name: judged[metric].values[name] for name in rows}
        means = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) == 1]  # type: ignore[arg-type]
        np.testing.assert_allclose(np.ravel(means), [np.mean(list(dots[name].values())) for name in rows])
        through = np.asarray(axes.lines[-1].get_xdata(), float).reshape(-1, len(rows) + 1)
        np.testing.assert_allclose(through[:, 0], list(dots[rows[0]].values()))
        assert "n = 8 subjects, held out" in models(simulated)[1]


def test_without_a_truth_fitted_hands_stand_apart(simulated: StudyResults) -> None:
    """Left-out errors are of fitted hands and anatomy alone; a replay's are not one test with theirs."""
    blind = [{**row, "true_tip_mean_mm": None} for row in simulated.scores]
    figure, caption = models(compared(replace(simulated, scores=blind, joint_errors=[])))
    replay, left_out = figure.axes
    assert "replay" in replay.get_xlabel()
    assert names_of(replay) == list(MODELS)
    assert names_of(left_out) == ["whole-hand", "prior-only"]
    assert "not where they are" in caption


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
    panel = lengths_panel(replace(simulated, bones=bones), simulated.sessions[2], "whole-hand")
    assert panel is not None
    axes = page_figure(panel).axes[0]
    drawn = [float(np.asarray(line.get_xdata())[0]) for line in axes.lines]
    expected = [row["length_mm"] for row in rows_where(bones, model="whole-hand", subject="S2")]
    np.testing.assert_allclose(sorted(drawn), sorted(expected))
    reaches = [np.ptp(bars.get_segments()[0][:, 0]) for bars in axes.collections]  # type: ignore[attr-defined]
    np.testing.assert_allclose(reaches, 1.0)
    faces = [line.get_markerfacecolor() for line in axes.lines]
    assert 0 < faces.count(PAPER) < len(faces)


def test_captions_state_n_units_what_is_missing_and_the_program(drawings: dict[str, Drawing]) -> None:
    for name in ("models", "joint-errors"):
        caption = drawings[name].caption
        assert "mm" in caption
        assert "simulated recordings of 8 subjects, 16 hands" in caption
        assert "eld out" in caption
        assert "Drawn by shukotsu" in caption


def test_a_study_without_any_score_says_so(simulated: StudyResults) -> None:
    empty = compared(replace(simulated, scores=[], joint_errors=[], joints=[], bones=[]))
    with pytest.raises(NoDataError, match="no model of this study has a score"):
        models(empty)
    drawings = list(of_study(empty))
    assert [drawing.name for drawing in drawings] == list(STUDY_FIGURES)
    for drawing in drawings:
        words = " ".join(text.get_text() for text in drawing.figure.texts)
        assert words.replace("\n", " ") == drawing.missing == drawing.caption
