"""The study's page: who is in it, what was held out, and methods text that says what was done."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

import pytest
from finding_examples import EVIDENCE
from hypothesis import given
from hypothesis import strategies as st
from report_samples.read_page import ReadTable, read_page, rows_where, table_called

from shukotsu.schemas.findings import STAGE, SUSPECT, Finding, problem_row
from shukotsu.schemas.results import Results
from shukotsu.schemas.study import Hand, Study, read_study
from shukotsu.stages.report.links import anchor, link
from shukotsu.stages.report.study_page import render_study
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.terminal import terminal_tables
from shukotsu.stages.report.trust import believed_text

NAMES = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=12)


@pytest.fixture(scope="module")
def file(fitted_made: tuple[Path, Path]) -> Study:
    """The fitted study's file, read."""
    return read_study(fitted_made[0])


def _hands(results: StudyResults, study: Study) -> dict[tuple[str, str], list[str]]:
    """Rows of the subjects' table by subject and hand."""
    (table,) = [
        t
        for t in read_page(render_study(results, study)).tables
        if t.caption.startswith("Every hand of the study")
    ]
    return {(row[0], row[1]): row[2:] for row in table.rows[1:]}


@given(NAMES)
def test_links_survive_any_name(name: str) -> None:
    """A link leads to the file of that name, and shows the name as it is."""
    paths = Results(Path("results/any"))
    page, target = paths.report, paths.subject_page(name)
    to = link(name, page, target)
    assert page.parent / unquote(to.href) == target
    shown = read_page(str(anchor(to)))
    assert [tag for tag, _ in shown.tags] == ["a"]
    assert "".join(shown.text).split() == name.split()


def test_every_hand_has_a_row(results: StudyResults, study: Study) -> None:
    """With its recordings' links; what was not used is told with its reason."""
    hands = _hands(results, study)
    assert list(hands) == [(hand.subject, hand.hand) for hand in results.hands]
    assert hands["S01", "right"][:3] == [
        "opposition",
        "1 recording",
        believed_text(results, Hand("S01", "right"), results.leading),
    ]
    failed = [row["message"] for row in results.recording_rows if row["status"] == "failed"]
    (told,) = [row[1] for row in hands.values() if row[1].startswith("◆")]
    assert told == f"◆ 0 of 1 recording; failed: {failed[0]}"


def test_what_was_fitted_and_what_held_out(fitted: StudyResults, file: Study) -> None:
    table = table_called(
        render_study(fitted, file), "What skeletons were made from, and what they were scored on."
    )
    expected = {
        (row["model"], row["calibrated_on"], row["task"], "held out" if row["held_out"] else "○ in-sample")
        for row in fitted.scores
        if not row["reference"]
    }
    assert {tuple(row[:4]) for row in table.rows[1:]} == expected
    assert {row[4] for row in table.rows[1:]} == {"2 hands of 1 subject"}


def _lengths(page: str, model: str) -> ReadTable:
    return table_called(page, f"Bone lengths of every hand under {model}, in mm, with 1-sigma error.")


def test_bone_lengths_stand_side_by_side(fitted: StudyResults, file: Study) -> None:
    """A row a hand and a column a bone, as the gathered table has them, with a doubt's sign behind."""
    page = render_study(fitted, file)
    header, *rows = _lengths(page, "whole-hand").rows
    assert header[:5] == ["Subject", "Hand", "Lengths to believe", "thumb metacarpal", "thumb proximal"]
    assert [row[:3] for row in rows] == [["S01", "right", "15 of 19"], ["S01", "left", "11 of 19"]]
    for row in rows:
        known = rows_where(fitted.bones, hand=row[1], model="whole-hand")
        cells = dict(zip(header[3:], row[3:], strict=True))
        assert len(cells) == len(known) == 19
        for bone in known:
            start = f"{bone['length_mm']:.1f} ± {bone['sd_mm']:.1f}"
            assert cells[bone["bone"].replace("_", " ")].removesuffix(" ◆").removesuffix(" ✕") == start
    left = dict(zip(header, rows[1], strict=True))
    assert left["ring distal"].endswith(" ✕")  # its DIP joint failed
    assert left["little middle"].endswith(" ✕")  # and here it is weak
    assert page.count('href="#bones"') == 1


def _study_of_one_fault(fitted: StudyResults, accepted: str = "") -> StudyResults:
    seen = {"rotates": "transmitter-to-receiver", "seen": "gap", **EVIDENCE["gap"]}
    finding = Finding("quaternion-inverse", SUSPECT, "", seen).accept(accepted)
    where = [{"subject": f"S{i:02}", "hand": "left", "task": "rom"} for i in range(11)]
    return replace(fitted, problems=[problem_row(STAGE, finding, **own) for own in where])


def test_one_fault_in_eleven_recordings_is_one_item_of_the_page(fitted: StudyResults, file: Study) -> None:
    page = render_study(_study_of_one_fault(fitted), file)
    assert page.count("seem to be the inverse of what is declared") == 1
    assert page.count("write <code>rotates: transmitter-to-receiver</code> under") == 1
    assert "<strong>11 recordings</strong>" in page
    assert "<p>subject S00, left hand, rom; subject S01, left hand, rom; " in page
    assert "<li>subject S10, left hand, rom: put right, the gap of index_pip falls" in page
    assert 'id="problems"' not in page


def test_the_terminal_has_findings_first_each_once(fitted: StudyResults) -> None:
    text = " ".join(terminal_tables(_study_of_one_fault(fitted)).split())
    assert text.count("seem to be the inverse") == 1
    assert 'write "rotates: transmitter-to-receiver" under "orientation" in the mapping' in text
    assert "Found in the recordings, to be settled first: - 11 recordings, check_recordings: The rot" in text
    assert (
        "subject S03, left hand, rom; and 7 more subject S00, left hand, rom: put right, the gap of" in text
    )


def test_a_picture_that_fails_is_a_problem_of_the_page(
    fitted: StudyResults, file: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shukotsu.stages.report.plots.page_pictures.page_figure", lambda _: {}["x"])
    page = render_study(replace(fitted, problems=[*fitted.problems]), file)
    assert "<svg" not in page
    assert "Not drawn: internal error in report" in page
    (table,) = [t for t in read_page(page).tables if t.caption.startswith("Everything that did not go")]
    assert any("KeyError" in row[-1] for row in table.rows)
