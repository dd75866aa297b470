"""The movement page says in words and pictures what the tables say; what is not there in a line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from report_samples.made_movement import JOINTS, write_movement
from report_samples.made_study import FITTED_MODELS, make_study
from report_samples.read_page import read_page, table_called
from shukotsu.sentences.messages import message_of

from shukotsu.schemas.study import read_study
from shukotsu.stages.report.belief import NOT
from shukotsu.stages.report.methods_text import methods_text
from shukotsu.stages.report.movement_page.movement_page import render_movement
from shukotsu.stages.report.movement_page.movement_panels import (
    MOST_CONTRASTS,
    contrasts,
    range_panels,
)
from shukotsu.stages.report.movement_page.movement_results import RANGE, Movement, read_movement
from shukotsu.stages.report.movement_page.movement_text import answers, groups_differ, repeats
from shukotsu.stages.report.print_figures.study_figures import of_study
from shukotsu.stages.report.study_results import StudyResults, read_results

SUBJECTS = tuple(f"P{index}" for index in range(6))
DIGITS = ("thumb", "index", "middle", "ring", "little")


@pytest.fixture(scope="module")
def moved(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A study with all tables of movement; not to be changed."""
    folder = tmp_path_factory.mktemp("moved")
    study, results = make_study(folder, n_frames=4, models=FITTED_MODELS, subjects=SUBJECTS, simulated=True)
    write_movement(results, SUBJECTS, models=FITTED_MODELS)
    return study, results


@pytest.fixture(scope="module")
def results(moved: tuple[Path, Path]) -> StudyResults:
    """That study, read."""
    return read_results(read_study(moved[0]), moved[1])


@pytest.fixture(scope="module")
def movement(results: StudyResults) -> Movement:
    """Its movement."""
    return read_movement(results)


def _text(page: str) -> str:
    return " ".join(" ".join(read_page(page).text).split())


def test_ranges_are_of_the_leading_model(movement: Movement) -> None:
    assert set(movement.ranges["model"]) == {"whole-hand"}
    assert len(movement.subject_means) == len(SUBJECTS) * len(JOINTS) * 3


def test_what_moved_most_is_the_mean_over_subjects(movement: Movement) -> None:
    first = movement.moved_most.iloc[0]
    assert (first["joint"], first["angle"]) == ("index_pip", "flexion")
    own = movement.ranges[(movement.ranges["joint"] == "index_pip") & (movement.ranges["angle"] == "flexion")]
    means = own.groupby("subject")[RANGE].mean()
    assert first["mean"] == pytest.approx(means.mean())
    assert first["std"] == pytest.approx(means.std())
    said = answers(movement)[0]
    assert said.startswith(
        f"The index PIP flexion moved most: {means.mean():.1f} deg on average over 6 subjects"
    )
    doubted = replace(movement, believed={"index_pip": NOT})
    assert "index PIP" not in answers(doubted)[0]


def test_the_page_answers_each_question(results: StudyResults, movement: Movement) -> None:
    page = render_movement(results, movement)
    text = _text(page)
    for sentence in answers(movement):
        assert sentence in text
    assert "group, A against B: a difference is shown in 1 of 21 numbers (3 and 3 subjects)" in text
    assert (
        "range of motion, index PIP flexion, 12.1 deg more with A (95 % 8.1 to 16.1, p = 0.0021 corrected; "
        in text
    )
    table = table_called(page, "Differences in range_deg [deg].")
    row = next(row for row in table.rows if row[0] == "index_pip flexion")
    assert row[4:9] == ["3 and 3", "72.10", "60.00", "12.10", "8.10 to 16.10"]
    assert row[-1] == "1: P9: suspect"
    assert table_called(page, "Repeatability in range_deg [deg].").rows[1][8] == "1.00"


def test_joints_that_are_not_to_be_believed_are_in_no_answer(movement: Movement) -> None:
    doubted = replace(movement, believed={"index_pip": NOT, "index_mcp": NOT})
    said = answers(doubted)
    assert not any("index" in sentence for sentence in said)
    assert said[1] == ("group, A against B: no difference is shown in 15 numbers (3 and 3 subjects).")
    assert "median of 15 joint angles" in said[2]


def test_what_was_not_tested_is_said_once(movement: Movement) -> None:
    message = "not tested: groups of 3 and 3 subjects, a test needs 4 in each"
    rows = movement.differences.assign(verdict="", message=message)
    assert groups_differ(replace(movement, differences=rows)) == [f"Group, A against B: {message}."]
    levels = [rows.assign(level=level) for level in "CDEF"]
    many = replace(movement, differences=pd.concat([rows, *levels]))
    assert groups_differ(many) == [f"Group, 5 pairs of levels: {message}."]
    assert len(contrasts(many, DIGITS)) == MOST_CONTRASTS


def test_what_was_done_to_people_between_sessions_is_no_measurement_error(movement: Movement) -> None:
    rows = movement.reliability.assign(contains="session;drug")
    said = repeats(replace(movement, reliability=rows))
    assert "That contains what session and drug changed, so it is no measurement error." in said
    assert "cannot be told" not in said


def test_why_nothing_is_compared_is_said_as_it_is(results: StudyResults, movement: Movement) -> None:
    """All hands left out; a factor of many numbers; no factor."""
    keys = [{"subject": own, "session": session, "hand": "right"} for own in SUBJECTS for session in "12"]
    findings = [key | {"severity": "suspect", "stage": "x"} for key in keys]
    none = read_movement(replace(results, problems=findings, factors={"group": ""}))
    none = replace(none, differences=none.differences.iloc[:0])
    why = "every hand that has joint angles has a suspect finding, and counts in nothing"
    assert answers(none)[0] == f"Which joint moved most is not known: {why}."
    assert groups_differ(none) == [f"No groups, sessions or tasks are compared: {why}."]
    many = message_of("is-covariate", count=8, factor="years")
    assert groups_differ(replace(movement, factors={"years": many}))[0] == (
        "Years: has 8 numbers as levels, which are not compared pair by pair."
    )


def test_what_is_drawn_is_what_the_tables_say(movement: Movement) -> None:
    flexion = range_panels(movement, DIGITS)[0]
    assert [row.name for row in flexion.rows] == list(JOINTS)
    assert all(len(row.numbers) == len(SUBJECTS) for row in flexion.rows)
    (contrast,) = contrasts(movement, DIGITS)
    shown = [row for panel in contrast.panels for row in panel.rows if row.filled]
    assert [(row.name, row.mean, row.interval) for row in shown] == [
        ("index_pip", 12.1, (pytest.approx(8.1), pytest.approx(16.1)))
    ]


def test_hands_with_a_suspect_finding_are_left_out(results: StudyResults) -> None:
    finding = {"subject": "P0", "session": "1", "hand": "right", "severity": "suspect", "stage": "x"}
    rest = read_movement(replace(results, problems=[finding]))
    assert not ((rest.ranges["subject"] == "P0") & (rest.ranges["session"] == "1")).any()
    assert ((rest.ranges["subject"] == "P0") & (rest.ranges["session"] == "2")).any()


def test_a_study_without_movement_says_what_is_missing(tmp_path: Path) -> None:
    """In a line each, on the page and in the figures; with ranges alone the others are missing."""
    study, folder = make_study(tmp_path, n_frames=3, models=FITTED_MODELS, subjects=("A",))
    results = read_results(read_study(study), folder)
    none = read_movement(results)
    assert "not known: no recording of this study has joint angles" in answers(none)[0]
    assert "names no factor" in groups_differ(none)[0]
    text = _text(render_movement(results, none))
    assert "no second session and no second trial" in text
    missing = {drawing.name: drawing.missing for drawing in of_study(results)}
    for name in ("ranges-of-motion", "group-differences"):
        assert missing[name].startswith("Not drawn: ")
    write_movement(folder, ("A",), sessions=("",), statistics=False)
    some = read_movement(results)
    assert "over 1 subject, hands" in answers(some)[0]
    assert "is not known" in repeats(some)


def test_figures_are_drawn_with_their_captions(results: StudyResults) -> None:
    found = {drawing.name: drawing for drawing in of_study(results)}
    names = ("ranges-of-motion", "group-differences")
    assert not any(found[name].missing for name in names)
    assert "(n = 6)" in found["ranges-of-motion"].caption
    assert "bar: 95 % interval. n = 3 and 3 subjects; left out: 1." in found["group-differences"].caption


def test_methods_say_what_was_done(results: StudyResults, movement: Movement) -> None:
    text = " ".join(methods_text(results, movement))
    assert "Movement was measured in 6 subjects by joint angles under whole-hand." in text
    assert "Holm's correction over all quantities, joint angles, hands and tasks of two levels" in text
    assert "Movement was measured" not in " ".join(methods_text(results))
