"""Movement results: figures and tables show the numbers of the movement tables."""

from dataclasses import replace

import drawn_movement as drawn
import numpy as np
import pandas as pd
import pytest
from report_samples.made_study import FITTED_MODELS, write

from shukotsu.movement.study_comparison import compare_study
from shukotsu.report.belief import NOT
from shukotsu.report.figures.drawing import NoDataError
from shukotsu.report.figures.study_figures import groups, ranges_of_motion, study_cycles
from shukotsu.report.methods_text import methods_text
from shukotsu.report.movement_results import (
    RANGE,
    StudyMovement,
    compared_factors,
    read_movement,
    subject_groups,
)
from shukotsu.report.study_results import StudyResults
from shukotsu.study.results import Results
from shukotsu.study.study import Study, read_study
from shukotsu.tables.catalogue import PROBLEMS

RECORDINGS = drawn.recordings(12, ("1", "2"), task="opposition")
CALIBRATIONS = drawn.recordings(12, ("1", "2"), task="rom")


@pytest.fixture(scope="module")
def results(fitted: StudyResults, tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    """The fitted study with movement tables of twelve other subjects."""
    paths = Results(tmp_path_factory.mktemp("moved"))
    write(paths.study_table("problems"), PROBLEMS, [])
    drawn.write_movement(
        paths,
        [*drawn.ranges(RECORDINGS, models=FITTED_MODELS), *drawn.ranges(CALIBRATIONS, 2, FITTED_MODELS)],
        drawn.curves([*RECORDINGS, *CALIBRATIONS], FITTED_MODELS),
    )
    compare_study(RECORDINGS, ["group"], paths)
    return replace(fitted, paths=paths)


@pytest.fixture(scope="module")
def movement(results: StudyResults) -> StudyMovement:
    return read_movement(results)


def test_a_dot_is_a_subjects_mean_range_under_the_leading_model(
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
    rest = read_movement(results.with_rows(problems=[finding]))
    assert not ((rest.ranges["subject"] == "P00") & (rest.ranges["session"] == "1")).any()
    assert ((rest.ranges["subject"] == "P00") & (rest.ranges["session"] == "2")).any()
    none = replace(movement, ranges=movement.ranges.iloc[:0])
    with pytest.raises(NoDataError, match="suspect finding"):
        ranges_of_motion(results, none)


@pytest.fixture(scope="module")
def groups_study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """A study file of these subjects in alternating groups, comparing a measured and an unmeasured
    quantity.
    """
    folder = tmp_path_factory.mktemp("groups")
    lines = (f"{r['subject']}\t{r['session']}\tright\topposition\tboth\tx.csv\n" for r in RECORDINGS)
    (folder / "sheet.tsv").write_text("subject\tsession\thand\ttask\trole\tfile\n" + "".join(lines))
    people = "".join(f"P{n:02}\t{'AB'[n % 2]}\tall\n" for n in range(12))
    (folder / "people.tsv").write_text("subject\tgroup\tsite\n" + people)
    text = "study: two\nrecordings: sheet.tsv\nparticipants: people.tsv\nlayout: liberty16\n"
    text += "models: [whole-hand]\n"
    text += "factors: [group, site]\ncompare: [range_deg index_mcp flexion, path_length_mm thumb]\n"
    (folder / "study.yaml").write_text(text)
    return read_study(folder / "study.yaml")


def test_groups_are_compared_in_a_table_and_a_figure(
    results: StudyResults, movement: StudyMovement, groups_study: Study
) -> None:
    """Rows have n, mean, SD, difference and p: first the quantities that the study names, then the largest
    effects.
    """
    group, site = compared_factors(results, groups_study, movement)
    assert group.levels == "A (6 subjects) and B (6 subjects)"
    assert site.table is None
    assert (site.levels, site.reason) == ("all (12 subjects)", "has 1 level, so nothing is compared")
    assert group.table is not None
    (block,) = group.table.blocks
    assert block.header[3:5] == ("A: n, mean ± SD", "B: n, mean ± SD")
    assert [row[0] for row in block.rows[:2]] == [
        "Range of motion [deg], index_mcp, flexion", "Range of motion [deg], index_pip, flexion"
    ]  # fmt: skip
    assert "path_length_mm thumb" in group.table.notes[0]
    means = movement.subject_means
    means = means[(means["task"] == "opposition") & (means["joint"] == "index_pip")]
    of_a, of_b = (
        means[means["subject"].str[1:].astype(int) % 2 == n].set_index("subject")[RANGE] for n in (0, 1)
    )
    texts = [f"6, {of.mean():.1f} ± {of.std():.1f}" for of in (of_a, of_b)]
    assert list(block.rows[1][3:6]) == [*texts, f"{of_a.mean() - of_b.mean():.1f}"]
    assert block.rows[1][7].startswith("p ")
    pip = next(each for each in group.drawn if "Range of motion [deg], index_pip" in each.title)
    assert {k: pytest.approx(v) for k, v in pip.levels["A"].items()} == of_a.to_dict()
    figure, _ = groups(results, groups_study, movement)
    dots = [line.get_xdata() for line in figure.axes[1].lines if str(line.get_gid()).startswith("dots")]
    assert [sorted(each) for each in dots] == [pytest.approx(sorted(of.tolist())) for of in (of_a, of_b)]


def test_groups_have_mean_cycle_curves_in_two_colours(
    results: StudyResults, movement: StudyMovement, groups_study: Study
) -> None:
    """A group's curve averages its subjects' mean cycles over sessions, at each percent those that were
    measured.
    """
    rows = pd.DataFrame(drawn.curves(RECORDINGS, FITTED_MODELS))
    rows = rows[(rows["model"] == "whole-hand") & (rows["joint"] == "index_pip")]
    own = rows.astype({"mean_deg": float}).pivot_table("mean_deg", "subject", "cycle_percent", dropna=False)
    figure, caption = study_cycles(results, movement, subject_groups(groups_study))
    assert [axes.get_title("right") for axes in figure.axes] == [
        "index_mcp, n = 5–6, 6", "index_pip, n = 5–6, 6"
    ], "only of the task; calibrations are not averaged"  # fmt: skip
    _, pip = figure.axes
    for line, band, n in zip(pip.lines[1:], pip.collections, (0, 1), strict=True):
        of_group = own[own.index.str[1:].astype(int) % 2 == n]
        np.testing.assert_allclose(np.asarray(line.get_ydata(), float), of_group.mean())
        outline = band.get_paths()[0].vertices
        ends = [outline[outline[:, 0] == 50, 1].min(), outline[outline[:, 0] == 50, 1].max()]
        middle, sd = of_group[50].mean(), of_group[50].std()
        np.testing.assert_allclose(ends, [middle - sd, middle + sd])
    assert len({line.get_color() for line in pip.lines[1:]}) == 2
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["A", "B"]
    assert "mean cycle" in caption


def test_without_groups_a_curve_averages_all_subjects(results: StudyResults, movement: StudyMovement) -> None:
    everybody = dict.fromkeys(movement.ranges["subject"], "")
    figure, _ = study_cycles(results, movement, everybody)
    assert [len(axes.lines) for axes in figure.axes] == [2, 2], "the zero line and one mean"
    assert figure.axes[0].get_title("right") == "index_mcp, n = 11–12"
    with pytest.raises(NoDataError, match="events, which the study’s events sheet lists"):
        study_cycles(results, replace(movement, curves=movement.curves.iloc[:0]), everybody)


def test_an_untested_difference_states_the_reason(
    results: StudyResults, movement: StudyMovement, groups_study: Study
) -> None:
    few = movement.differences.assign(n=2, n_other=3, p=np.nan, p_holm=np.nan, low=np.nan, high=np.nan)
    table = compared_factors(results, groups_study, replace(movement, differences=few))[0].table
    assert table is not None
    reason = "not tested: groups of 2 and 3 subjects, a test needs 4 in each"
    assert {row[6:] for row in table.blocks[0].rows} == {("–", reason)}
    doubted = replace(movement, believed={"index_pip": NOT})
    shown = compared_factors(results, groups_study, doubted)[0].table
    assert shown is not None
    assert not [row for row in shown.blocks[0].rows if "index_pip" in row[0]]


def test_the_methods_text_states_tests_and_subjects(results: StudyResults, movement: StudyMovement) -> None:
    text = " ".join(methods_text(results, movement))
    assert "Movement was measured in 12 subjects by joint angles under the model whole-hand." in text
    assert "Holm's correction over all quantities, joint angles, hands and tasks of a pair of levels" in text
    unmoved = replace(movement, ranges=movement.ranges.iloc[:0])
    assert "Movement was measured" not in " ".join(methods_text(results, unmoved))
