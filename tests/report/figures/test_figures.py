"""Figures show the tables' numbers with gaps, peaks, n and units, and name what is missing and why."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.container import BarContainer
from report_samples.made_study import ANGLES, FITTED_MODELS, MadeStudy, compared
from report_samples.pages import rows_where

from shukotsu.report.figures import recording_figures
from shukotsu.report.figures.drawing import NoDataError, page_figure
from shukotsu.report.figures.study_figures import joint_errors, joint_trust, lengths_panel, models, of_study
from shukotsu.report.judged_models import REPLAY, judged_models
from shukotsu.report.palette import MODELS as COLOURS
from shukotsu.report.palette import PAPER
from shukotsu.report.study_results import StudyResults
from shukotsu.study.results import STUDY_FIGURES
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import CYCLE_CURVES, JOINT_ANGLES, TIPS

pytestmark = pytest.mark.slow


def names_of(axes: Axes) -> list[str]:
    return list(axes.yaxis.get_major_formatter().seq)  # type: ignore[attr-defined]


def dots_of(axes: Axes) -> dict[int, dict[str, float]]:
    """Return the numbers drawn as dots, by row from the top and then by subject."""
    dots = [line for line in axes.lines if str(line.get_gid()).startswith("dots")]
    return {
        int(str(line.get_gid())[4:]): dict(
            zip(str(line.get_label()).split("\n"), np.asarray(line.get_xdata(), float).tolist(), strict=True)
        )
        for line in dots
    }


def test_dots_are_subjects_and_the_mark_is_their_mean(twelve: StudyResults) -> None:
    """The numbers are those of model_values; the deciding metric's panel is first, the best model its first
    row.
    """
    judged = {each.metric: each for each in judged_models(twelve)}
    drawn = models(twelve)[0].axes
    for axes, metric in zip(drawn, ("error_mm", "true_tip_mean_mm", REPLAY), strict=True):
        rows = names_of(axes)
        assert rows[0] == "whole-hand"
        dots = {rows[row]: numbers for row, numbers in dots_of(axes).items()}
        assert dots == {name: judged[metric].values[name] for name in rows}
        means = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) == 1]  # type: ignore[arg-type]
        np.testing.assert_allclose(np.ravel(means), [np.mean(list(dots[name].values())) for name in rows])
        through = np.asarray(axes.lines[-1].get_xdata(), float).reshape(-1, len(rows) + 1)
        np.testing.assert_allclose(through[:, 0], list(dots[rows[0]].values()))
        assert "n = 12 subjects, held out" in models(twelve)[1]


def test_models_with_the_same_numbers_share_a_row(twelve: StudyResults) -> None:
    """Models with the same numbers share one row; with different numbers they have one each."""
    again = [
        row | {"model": "paper-fig3"} for row in twelve.rows.model_values if row["model"] == "paper-fig4"
    ]
    named = replace(twelve, models={"paper-fig3": twelve.models["paper-fig4"], **twelve.models})
    same = named.with_rows(model_values=[*twelve.rows.model_values, *again])
    assert names_of(models(same)[0].axes[0])[:2] == ["whole-hand", "paper-fig3, paper-fig4"]
    twice = [row | {"value": 2 * row["value"]} if row["value"] else row for row in again]
    apart = named.with_rows(model_values=[*twelve.rows.model_values, *twice])
    assert names_of(models(apart)[0].axes[0])[:3] == ["whole-hand", "paper-fig3", "paper-fig4"]


def test_without_a_truth_fitted_and_replayed_hands_have_separate_panels(twelve: StudyResults) -> None:
    """One panel compares left-out errors of fitted hands and anatomy alone, the other errors of the
    replay.
    """
    blind = [{**row, "true_tip_mean_mm": None} for row in twelve.rows.skeleton_scores]
    figure, caption = models(compared(twelve.with_rows(skeleton_scores=blind, joint_errors=[])))
    left_out, replay = figure.axes
    assert "replay" in replay.get_xlabel()
    assert names_of(replay) == list(FITTED_MODELS)[::-1]
    assert names_of(left_out) == ["whole-hand", "prior-only"]
    assert "not where the joint is" in caption


def test_drawn_joint_errors_and_stated_errors_equal_the_table(twelve: StudyResults) -> None:
    axes = joint_errors(twelve)[0].axes[1]
    rows = rows_where(twelve.rows.joint_errors, model="whole-hand", calibrated_on="rom")
    for row, joint in enumerate(names_of(axes)):
        errors = [each["error_mm"] for each in rows_where(rows, joint=joint) if each["error_mm"] is not None]
        np.testing.assert_allclose(sorted(dots_of(axes)[row].values()), sorted(errors))
    levels = [lines.get_segments()[0] for lines in axes.collections]  # type: ignore[attr-defined]
    stated_mm = np.median([row["sd_mm"] for row in rows_where(rows, joint="thumb_cmc")])
    assert [[stated_mm, -0.4], [stated_mm, 0.4]] in [level.tolist() for level in levels]


def test_trust_counts_every_hand_of_the_study(results: StudyResults) -> None:
    """Of four hands one failed entirely; on another the ring DIP joint failed and the little DIP joint is
    weak.
    """
    axes = joint_trust(results)[0].axes[-1]
    bars = [bar for bar in axes.containers if isinstance(bar, BarContainer)]
    shares = {name: [bar.patches[row].get_width() for bar in bars] for row, name in enumerate(names_of(axes))}
    *_, no, absent = shares["ring_dip"]
    assert no == absent == 25
    believed, _, no, _ = shares["little_dip"]
    assert (believed, no) == (50, 25)
    assert shares["index_pip"][0] == 75


def test_bone_lengths_are_drawn_with_their_stated_error(twelve: StudyResults) -> None:
    bones = [
        {**row, "length_mm": 40.0 + index % 7, "sd_mm": 0.5} if row["model"] == "whole-hand" else row
        for index, row in enumerate(twelve.rows.bone_lengths)
    ]
    panel = lengths_panel(twelve.with_rows(bone_lengths=bones), twelve.sessions[2], "whole-hand")
    assert panel is not None
    axes = page_figure(panel).axes[0]
    drawn = [float(np.asarray(line.get_xdata())[0]) for line in axes.lines]
    expected = [row["length_mm"] for row in rows_where(bones, model="whole-hand", subject="S003")]
    np.testing.assert_allclose(sorted(drawn), sorted(expected))
    reaches = [np.ptp(bars.get_segments()[0][:, 0]) for bars in axes.collections]  # type: ignore[attr-defined]
    np.testing.assert_allclose(reaches, 1.0)
    faces = [line.get_markerfacecolor() for line in axes.lines]
    assert 0 < faces.count(PAPER) < len(faces)


def test_figures_without_any_score_state_the_reason(twelve: StudyResults, fitted_study: MadeStudy) -> None:
    empty = compared(twelve.with_rows(skeleton_scores=[], joint_errors=[], joint_centres=[], bone_lengths=[]))
    with pytest.raises(NoDataError, match="no model of this study has a score"):
        models(empty)
    drawings = list(of_study(empty, fitted_study.study))
    assert [drawing.name for drawing in drawings] == list(STUDY_FIGURES)
    for drawing in drawings:
        words = " ".join(text.get_text() for text in drawing.figure.texts)
        assert words.replace("\n", " ") == drawing.missing == drawing.caption


@pytest.fixture(scope="module")
def recording(results: StudyResults) -> Recording:
    return recording_figures.find_recording(results, "S01", "right", "opposition")


def test_a_peak_and_a_gap_survive_thinning() -> None:
    time_s, error = np.arange(100_000) / 240, np.ones(100_000)
    error[54_321], error[60_000:70_000] = 77.0, np.nan
    trace = recording_figures.thin(time_s, error, 200)
    assert trace is not None
    assert abs(trace.x[np.nanargmax(trace.high)] - time_s[54_321]) <= time_s[-1] / 200
    assert (np.nanmin(trace.low), np.nanmax(trace.high)) == (1.0, 77.0)
    assert np.isnan(trace.high).sum() == np.isnan(trace.low).sum() == 1
    inside = (trace.x > time_s[60_500]) & (trace.x < time_s[69_500])
    assert not np.isfinite(trace.high[inside]).any()


@pytest.mark.parametrize(("n", "breaks"), [(50, 1), (5000, 0)])
def test_a_missing_frame_breaks_a_line_of_few_frames(n: int, breaks: int) -> None:
    error = np.ones(n)
    error[20] = np.nan
    trace = recording_figures.thin(np.arange(n, dtype=float), error, 240)
    assert trace is not None
    assert np.isnan(trace.high).sum() == breaks


def test_drawn_tip_errors_equal_the_table_and_break_at_gaps(study: MadeStudy, recording: Recording) -> None:
    figure, caption = recording_figures.tip_error(study.results, recording)
    line = next(line for line in figure.axes[1].lines if line.get_color() == COLOURS[2])
    rows = study.rows(TIPS, "paper-fig4", digit="index")
    largest = max(row["error_mm"] for row in rows if row["error_mm"] is not None)
    assert np.nanmax(line.get_ydata()) == largest
    assert np.isnan(line.get_ydata()).sum() == 1
    assert "n = 240–300 frames" in caption
    assert "least-squares" in caption
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "", "", "", "Device time [s]"]


def test_drawn_joint_angles_equal_the_table(study: MadeStudy, recording: Recording) -> None:
    figure, caption = recording_figures.joint_angles(study.results, recording, "whole-hand")
    axes_of = {axes.get_title("right"): axes for axes in figure.axes}
    assert list(axes_of)[:3] == ["thumb_cmc", "thumb_mcp", "thumb_ip"]
    for joint in ("index_pip", "ring_cmc"):
        rows = study.rows(JOINT_ANGLES, "whole-hand", joint=joint, task="opposition")
        for line, name in zip(axes_of[joint].lines[1:], ANGLES, strict=True):
            largest = max(row[name] for row in rows if row[name] is not None)
            assert np.nanmax(np.asarray(line.get_ydata(), float)) == largest
        bands = [np.ptp(area.get_paths()[0].vertices[:, 1]) for area in axes_of[joint].collections]
        np.testing.assert_allclose(
            [bands[n] - bands[n + 1] for n in (0, 2, 4)], [4.0, 6.0, 8.0], err_msg="1 sigma of 2, 3 and 4 deg"
        )
    times_s = np.asarray(axes_of["ring_cmc"].lines[1].get_xdata(), float)
    assert np.isclose(times_s[-1] - times_s[0], 299 / 240, atol=3 / 240)
    assert "n = 300 frames" in caption


def test_drawn_cycle_curves_equal_the_table_with_their_sd(study: MadeStudy, recording: Recording) -> None:
    """Each measured joint has a panel, each angle a line in a band of one SD to either side."""
    figure, caption = recording_figures.recording_cycles(study.results, recording, "whole-hand")
    axes_of = {axes.get_title("right"): axes for axes in figure.axes}
    assert list(axes_of)[:3] == ["thumb_mcp, n = 2–3", "index_mcp, n = 2–3", "index_pip, n = 2–3"]
    for joint in ("index_pip", "ring_mcp"):
        axes = axes_of[f"{joint}, n = 2–3"]
        for number, (angle, line) in enumerate(zip(ANGLES, axes.lines[1:], strict=True)):
            rows = study.rows(CYCLE_CURVES, "whole-hand", joint=joint, angle=angle.removesuffix("_deg"))
            np.testing.assert_allclose(np.asarray(line.get_xdata(), float), np.arange(101))
            mean = np.array([row["mean_deg"] for row in rows])
            np.testing.assert_allclose(np.asarray(line.get_ydata(), float), mean)
            outline = axes.collections[number].get_paths()[0].vertices
            for percent in (0, 45, 100):
                ends = outline[outline[:, 0] == percent, 1]
                sd = rows[percent]["sd_deg"]
                assert (ends.min(), ends.max()) == pytest.approx((mean[percent] - sd, mean[percent] + sd))
    assert "event “tap”" in caption


def test_the_figure_of_a_recording_without_cycles_states_the_reason(study: MadeStudy) -> None:
    left = recording_figures.find_recording(study.results, "S01", "left", "opposition")
    with pytest.raises(NoDataError, match="No event starts a cycle in this recording"):
        recording_figures.recording_cycles(study.results, left, "whole-hand")
    assert [each.name for each in recording_figures.of_recording(study.results, left)][-2:] == [
        "cycle-curves_whole-hand", "cycle-curves_whole-hand-b"
    ]  # fmt: skip
