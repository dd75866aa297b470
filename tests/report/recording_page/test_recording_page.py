"""The page of a recording: numbers equal the tables', reasons for missing parts, and escaped names."""

from dataclasses import replace

import pytest
from report_samples.made_study import HOSTILE, MadeStudy
from report_samples.pages import read_page, table_called

from shukotsu.report.recording_page import recording_page
from shukotsu.report.recording_results import read_recording
from shukotsu.study.findings import STAGE
from shukotsu.study.model import read_model
from shukotsu.tables.catalogue import JOINT_CENTRES, JOINT_SOLUTIONS, TIP_ERRORS


@pytest.fixture(scope="module")
def recorded(study: MadeStudy) -> str:
    """The page of S01's right hand."""
    return recording_page(study.recording_results())


TITLE = "Subject S01, right hand, opposition"


def text_of(page: str) -> str:
    return " ".join("".join(read_page(page).text).split())


def cells(number: float | None, decimals: int) -> str:
    return "–" if number is None else f"{number:z.{decimals}f}"


@pytest.mark.parametrize("model", ["paper-fig4", "whole-hand"])
def test_the_calibration_table_equals_the_results(study: MadeStudy, recorded: str, model: str) -> None:
    table = table_called(recorded, f"What the calibration says of each joint, {model}.")
    values = {row["joint"]: row["singular_values"] for row in study.rows(JOINT_SOLUTIONS, model)}
    rows = study.rows(JOINT_CENTRES, model)
    assert [row[0] for row in table.rows[1:]] == [row["joint"] for row in rows]
    for shown, row in zip(table.rows[1:], rows, strict=True):
        gaps = [cells(row[name], 2) for name in ("gap_rms_mm", "gap_rms_free_mm")]
        gaps.append(cells(row["sd_mm"], 1))
        singular = [cells(value, 4) for value in values.get(row["joint"], [None] * 6)]
        counts = [str(row["n_frames"]), cells(row["n_effective"], 1)]
        assert shown[2:] == [*gaps, *counts, *singular, row["message"]]


def test_the_tip_error_table_equals_the_results(study: MadeStudy, recorded: str) -> None:
    table = table_called(recorded, f"Tip error of the replay, {TITLE}.")
    rows = [row for model in study.study.models for row in study.rows(TIP_ERRORS, model)]
    assert len(table.rows) == len(rows) + 1 > 20
    for shown, row in zip(table.rows[1:], rows, strict=True):
        names = ("mean_mm", "sd_mm", "median_mm", "p95_mm", "max_mm", "min_mm")
        numbers = [cells(row[name], 2) for name in names]
        counts = [str(row["n_frames"]), str(row["n_frames_total"])]
        assert shown[:11] == [row["model"], row["digit"], row["binding"], *numbers, *counts]


def test_a_model_without_results_is_left_out_with_the_reason(study: MadeStudy) -> None:
    subject = study.subject()
    models = {"paper-fig4": subject.models["paper-fig4"], "rigid": read_model("rigid")}
    results = read_recording(replace(subject, models=models), study.recording())
    assert [model.name for model in results.models] == ["paper-fig4"]
    assert results.left_out["rigid"]
    page = recording_page(replace(results, left_out={"rigid": "no hand <was> fitted"}))
    text = text_of(page)
    assert "rigid: no hand <was> fitted" in text
    assert "Joint angles are computed only by models that fit the whole hand" in text
    assert 'data-plot="angles"' not in page


def test_a_recording_without_poses_has_a_page_with_the_reason(study: MadeStudy) -> None:
    results = study.recording_results(HOSTILE, "left")
    assert results.motion is None
    text = text_of(recording_page(results))
    assert "There is no motion to show. opposition-A" in text
    assert "-left.csv: row 7, column x_mm: 'n/a' is <not> a number" in text
    assert "Right hand, same task" in text


def test_the_page_of_a_hand_with_findings_states_them(study: MadeStudy, recorded: str) -> None:
    results = study.recording_results()
    row = {"subject": "S01", "session": "", "task": "rom", "model": "", "stage": STAGE, "kind": "units"}
    row |= {"severity": "suspect", "message": "in m", "accepted": "", "variant": "", "values": ""}
    for hand, stated in (("right", True), ("left", False)):
        doubted = replace(results, study=results.study.with_rows(problems=[row | {"hand": hand}]))
        assert ("Problems and their cure" in recording_page(doubted)) == stated
        assert ("subject S01, right hand, rom: in m" in text_of(recording_page(doubted))) == stated
    assert "Problems and their cure" not in recorded


def test_cycle_curves_are_shown_or_the_reason_for_their_absence(study: MadeStudy, recorded: str) -> None:
    """Each joint with curves has a picture with n; the page of a hand without events states that it has
    none.
    """
    section = recorded.partition('<section id="cycles">')[2].partition("</section>")[0]
    assert "Cycles from “tap”" in section
    assert section.count("<svg viewBox") == 9 + 3, "the joints of the table, and the legend's three angles"
    assert "index_pip, n = 2–3" in section
    left = text_of(recording_page(study.recording_results("S01", "left")))
    assert "No event starts a cycle in this recording" in left
