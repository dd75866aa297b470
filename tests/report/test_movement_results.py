"""Ranges of motion are drawn, and differences listed, as the tables have them."""

from __future__ import annotations

from dataclasses import replace

import drawn_movement as drawn
import pytest
from report_samples.made_study import FITTED_MODELS, write

from shukotsu.movement.study_comparison import compare_study
from shukotsu.report.belief import NOT
from shukotsu.report.figures.study_figures import NoDataError, ranges_of_motion
from shukotsu.report.methods_text import methods_text
from shukotsu.report.movement_results import RANGE, StudyMovement, read_movement
from shukotsu.report.study_results import StudyResults
from shukotsu.study.results import Results
from shukotsu.tables.catalogue import PROBLEMS

RECORDINGS = drawn.recordings(12, ("1", "2"), task="opposition")
CALIBRATIONS = drawn.recordings(12, ("1", "2"), task="rom")


@pytest.fixture(scope="module")
def results(fitted: StudyResults, tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    """A study with tables of the movement of twelve subjects, whose other results are not theirs."""
    paths = Results(tmp_path_factory.mktemp("moved"))
    write(paths.study_table("problems"), PROBLEMS, [])
    drawn.write_movement(
        paths,
        [*drawn.ranges(RECORDINGS, models=FITTED_MODELS), *drawn.ranges(CALIBRATIONS, 2, FITTED_MODELS)],
    )
    compare_study(RECORDINGS, ["group"], paths)
    return replace(fitted, paths=paths)


@pytest.fixture(scope="module")
def movement(results: StudyResults) -> StudyMovement:
    return read_movement(results)


def test_a_dot_of_a_tasks_figure_is_a_subjects_mean_of_the_leading_model(
    results: StudyResults, movement: StudyMovement
) -> None:
    assert set(movement.ranges["model"]) == {"whole-hand"}
    figure, caption = ranges_of_motion(results, movement)
    assert [axes.get_title("right") for axes in figure.axes] == ["rom, calibration", "opposition"]
    for axes, task in zip(figure.axes, ("rom", "opposition"), strict=True):
        dots = [sorted(line.get_xdata()) for line in axes.lines if str(line.get_gid()).startswith("dots")]
        ranges = movement.ranges[
            (movement.ranges["joint"] == "index_pip") & (movement.ranges["task"] == task)
        ]
        means = sorted(ranges.groupby("subject")[RANGE].mean())
        assert dots[drawn.JOINTS.index("index_pip")] == pytest.approx(means)
    assert "Model whole-hand." in caption


def test_hands_with_a_suspect_finding_are_left_out(results: StudyResults, movement: StudyMovement) -> None:
    finding = {"subject": "P00", "session": "1", "hand": "right", "severity": "suspect", "stage": "x"}
    rest = read_movement(replace(results, problems=[finding]))
    assert not ((rest.ranges["subject"] == "P00") & (rest.ranges["session"] == "1")).any()
    assert ((rest.ranges["subject"] == "P00") & (rest.ranges["session"] == "2")).any()
    none = replace(movement, ranges=movement.ranges.iloc[:0])
    with pytest.raises(NoDataError, match="suspect finding"):
        ranges_of_motion(results, none)


def test_differences_are_those_shown_of_joints_to_be_believed(movement: StudyMovement) -> None:
    table, tested = movement.differences_table(), movement.differences
    assert table is not None
    row = next(row for row in table.blocks[0].rows if row[1].startswith("range_deg"))
    of_index = tested[(tested["of"] == "index_pip flexion") & (tested["quantity"] == RANGE)]
    (moved,) = of_index.to_dict("records")
    assert row[:2] == ("group: A − B", "range_deg, index_pip flexion")
    interval = f"{moved['low']:.2f} – {moved['high']:.2f}"
    assert row[4:7] == ("6/6", f"{moved['difference']:.2f} deg", interval)
    assert f"of {(tested['verdict'] != '').sum()} numbers" in table.caption
    doubted = replace(movement, believed={"index_pip": NOT}).differences_table()
    assert doubted is not None
    assert not doubted.blocks[0].rows
    assert replace(movement, differences=movement.differences.iloc[:0]).differences_table() is None


def test_methods_say_what_was_done(results: StudyResults, movement: StudyMovement) -> None:
    text = " ".join(methods_text(results, movement))
    assert "Movement was measured in 12 subjects by joint angles under whole-hand." in text
    assert "Holm's correction over all quantities, joint angles, hands and tasks of two levels" in text
    assert "Movement was measured" not in " ".join(methods_text(results))
