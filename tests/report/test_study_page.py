"""The study's page: numbers from the tables, order of its contents, and size."""

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from statistics import median
from urllib.parse import unquote

import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_samples.made_study import MadeStudy, many_subjects
from report_samples.pages import read_page, rows_where, table_called

from shukotsu.report import judged_models
from shukotsu.report.judged_models import WIDTH
from shukotsu.report.study_page import render_study
from shukotsu.report.study_results import StudyResults
from shukotsu.report.subject_page import render_subject
from shukotsu.report.table_cells import anchor, link
from shukotsu.scores.agreement import times_expected
from shukotsu.study.findings import NOTE, STAGE, SUSPECT, Finding, finding_of_text, problem_row
from shukotsu.study.results import Results
from shukotsu.study.verdict import BY_ANATOMY, MOVED_LITTLE, NO_POSE, NOT_SOLVED, UNCERTAIN, note_doubts

NAMES = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=12)
MARKS = {"believe": "", "care": "◆", "no": "✕"}


@pytest.fixture(scope="module")
def fitted_study_page(fitted_study: MadeStudy) -> str:
    return fitted_study.pages[fitted_study.paths.report]


@given(NAMES)
def test_links_work_for_any_name(name: str) -> None:
    """A link leads to the file of that name and shows the name literally."""
    paths = Results(Path("results/any"))
    page, target = paths.report, paths.subject_page(name)
    to = link(name, page, target)
    assert page.parent / unquote(to.href) == target
    shown = read_page(str(anchor(to)))
    assert [tag for tag, _ in shown.tags] == ["a"]
    assert "".join(shown.text).split() == name.split()


def test_the_headline_numbers_follow_from_the_tables(fitted: StudyResults, fitted_study_page: str) -> None:
    rows = rows_where(fitted.rows.joint_centres, model="whole-hand")
    believed = rows_where(rows, verdict="believe")
    sd_mm = median(row["sd_mm"] for row in rows if row["sd_mm"] is not None)
    scored = rows_where(fitted.rows.model_values, metric="error_mm", model="whole-hand", digit="")
    errors = [row["value"] for row in scored]
    joints, error, findings = judged_models.big_numbers(fitted)
    assert (joints.value, joints.unit) == (str(len(believed)), f"of {len(rows)} joints")
    assert (error.value, error.unit) == (f"{sd_mm:.1f}", "mm")
    assert error.of.endswith(f"{sum(errors) / len(errors):.1f} mm on average")
    assert (findings.value, findings.unit) == ("0", "of 2 hands")
    text = " ".join(" ".join(read_page(fitted_study_page).text).split())
    for number in (joints, error, findings):
        assert f"{number.value} {number.unit} {number.of}" in text


def _suspect(results: StudyResults, *hands: str) -> StudyResults:
    row = {"subject": "S01", "session": "", "task": "rom", "model": "", "stage": STAGE, "kind": "units"}
    row |= {"severity": "suspect", "message": "in m", "accepted": "", "variant": "", "values": ""}
    return results.with_rows(problems=[row | {"hand": hand} for hand in hands])


def test_a_hand_with_findings_gets_no_other_advice_on_its_subjects_page(fitted: StudyResults) -> None:
    pages = [render_subject(results) for results in (fitted, _suspect(fitted, "left", "right"))]
    assert ["What to record next" in page for page in pages] == [True, False]


def test_the_terminal_tells_recordings_with_a_fault_from_other_places(fitted: StudyResults) -> None:
    suspect = _suspect(fitted, "left", "right")
    whole_hands = [row | {"task": "", "severity": "note"} for row in suspect.rows.problems]
    for results, counted in (
        (suspect, "2 recordings: in m (subject S01, "),
        (fitted.with_rows(problems=whole_hands), "2 places: in m (subject S01, "),
    ):
        assert counted in " ".join(judged_models.outcome_text(results).split())


def test_hands_with_findings_are_left_out_of_the_headline_numbers(fitted: StudyResults) -> None:
    joints, _, findings = judged_models.big_numbers(_suspect(fitted, "left"))
    right = rows_where(fitted.rows.joint_centres, model="whole-hand", hand="right")
    assert (joints.unit, findings.value) == (f"of {len(right)} joints", "1")
    joints, error, findings = judged_models.big_numbers(_suspect(fitted, "left", "right"))
    assert (joints.value, error.value, findings.value) == ("0", "–", "2")
    assert joints.of == "can be believed: whole-hand solved no joint of a hand without findings"


def test_headline_numbers_read_as_sentences_in_singular_and_plural(fitted: StudyResults) -> None:
    """So do a missing number and recordings that are left out of all statistics."""
    suspect = _suspect(fitted, "left", "right")
    assert judged_models.numbers_texts(_suspect(fitted, "left"))[2].startswith("1 of 2 hands has recordings")
    one = replace(fitted, recordings=[row for row in fitted.recordings if row.hand.hand == "left"])
    assert judged_models.numbers_texts(one)[2] == "0 of 1 hand has recordings with a mistake."
    assert judged_models.numbers_texts(fitted)[2] == "0 of 2 hands have recordings with a mistake."
    _, typical, _ = judged_models.numbers_texts(suspect)
    assert typical == "No typical error can be stated, because no joint is counted."
    assert judged_models.used_text(suspect).startswith(
        "0 of 4 recordings used (4 left out of all statistics because of findings)"
    )


def test_the_terminal_lists_doubts_and_the_most_helpful_next_step(fitted: StudyResults) -> None:
    """Findings come first, then movements, receivers or sizes; measuring a bone only if nothing else
    helps.
    """
    believed = [row | {"verdict": "believe"} for row in fitted.rows.joint_centres]
    sure = fitted.with_rows(joint_centres=believed)
    assert (judged_models.care_line(sure), judged_models.next_step(sure)) == ("", "")
    suspect = _suspect(fitted, "left")
    refused = [row | {"severity": "refused", "stage": "capture"} for row in suspect.rows.problems]
    for faulty in (suspect, fitted.with_rows(problems=refused)):
        assert judged_models.next_step(faulty).startswith("Next: correct the mistakes found")

    def doubted(*joints: str, **doubts: object) -> StudyResults:
        doubt = {"sd_mm": 5.0, "verdict": "care", **note_doubts(doubts)}
        rows = [row | (doubt if row["joint"] in joints else {}) for row in believed]
        return fitted.with_rows(joint_centres=rows)

    little = doubted("thumb_ip", "thumb_mcp", **{MOVED_LITTLE: {"range_deg": 3.0}})
    reason = "moved only 3 deg; skin motion alone can cause this"
    assert judged_models.care_line(little) == f"Use with care: thumb_mcp and thumb_ip: {reason}."
    serves = "bend and straighten the thumb alone for 10 s; this would improve thumb_mcp and thumb_ip."
    assert judged_models.next_step(little) == f"Next: {serves}"
    dead = doubted("index_dip", **{NO_POSE: {"segments": ["index_distal"]}})
    worn = "wear a receiver on index_distal, and record again; this would improve index_dip."
    assert judged_models.next_step(dead) == f"Next: {worn}"
    unsolved = [row | {"verdict": "no", "reason": NOT_SOLVED} for row in believed]
    assert judged_models.care_line(fitted.with_rows(joint_centres=unsolved)) == ""
    placed = doubted("wrist", **{BY_ANATOMY: {}})
    assert judged_models.next_step(placed).startswith("Next: measure the hand's length (participants.tsv")
    assert "Measuring" in judged_models.next_step(doubted("wrist", **{UNCERTAIN: {"wanted_mm": 2.0}}))


def test_without_errors_from_recordings_there_is_no_typical_error(fitted: StudyResults) -> None:
    by_anatomy = {"sd_mm": 25.98, **note_doubts({BY_ANATOMY: {}})}
    rows = [
        row | (by_anatomy if row["joint"] == "wrist" else {"sd_mm": None})
        for row in fitted.rows.joint_centres
    ]
    joints, error, _ = judged_models.big_numbers(fitted.with_rows(joint_centres=rows))
    assert (error.value, error.of) == ("–", f"the recordings determine the error of none {joints.unit}")
    unworn = [
        row | ({"reason": "not-worn"} if row["joint"] == "little_dip" else {})
        for row in fitted.rows.joint_centres
    ]
    fewer, error, _ = judged_models.big_numbers(fitted.with_rows(joint_centres=unworn))
    assert int(fewer.unit.split()[1]) == int(joints.unit.split()[1]) - 2
    assert fewer.of.endswith("; joints without a receiver, not counted: 2")
    worn = [row for row in rows_where(unworn, model="whole-hand") if row["reason"] != "not-worn"]
    n = sum(row["sd_mm"] is not None for row in worn)
    assert f"the median over {n} {fewer.unit}, 1 sigma" in error.of


def test_the_overview_lists_every_joint_of_every_hand(fitted: StudyResults, fitted_study_page: str) -> None:
    """A joint's cell has its stated error to one decimal, its verdict as a mark and the reason as a
    tooltip.
    """
    table = table_called(fitted_study_page, "Joints of every hand, whole-hand")
    digits, parts, *rows = table.rows
    assert parts == [*["CMC", "MCP", "IP"], *["CMC", "MCP", "PIP", "DIP"] * 4, "wrist"]
    assert [row[:2] for row in rows] == [[hand.subject, hand.hand] for hand in fitted.hands]
    assert digits[2:7] == ["thumb", "index", "middle", "ring", "little"]
    for hand, cells in zip(fitted.hands, rows, strict=True):
        joints = rows_where(fitted.rows.joint_centres, model="whole-hand", hand=hand.hand)
        shown = [
            ("–" if row["sd_mm"] is None else f"{row['sd_mm']:.1f}") + MARKS[row["verdict"]] for row in joints
        ]
        assert sorted(cells[2:-1]) == sorted(shown)
        believed = Counter(row["verdict"] for row in joints)["believe"]
        assert cells[-1] == f"{believed}/{len(joints)}"
        for row in rows_where(joints, verdict="care"):
            assert f'subject.html#{hand.hand}-{row["joint"]}">◆</a>' in fitted_study_page
    assert 'title="has no position: too few frames (3)"' in fitted_study_page


def test_every_subject_has_a_card_with_a_link(results: StudyResults, pages: dict[Path, str]) -> None:
    page = pages[results.paths.report]
    cards = re.findall(r'<li><a href="([^"]+)" title=.*?</li>', page, re.DOTALL)
    assert [results.paths.folder / unquote(href) for href in cards] == [
        results.paths.subject_page(*who) for who in results.sessions
    ]
    assert page.count("<title>right hand of") == len(results.subjects)


def test_bone_lengths_of_all_hands_are_one_table(fitted: StudyResults, fitted_study_page: str) -> None:
    """Each hand has a row and each bone a column, with the gathered table's lengths and marks of doubt."""
    caption = "Bone lengths [mm] with 1-sigma error: whole-hand."
    header, *rows = table_called(fitted_study_page, caption).rows
    for row in rows:
        bones = rows_where(fitted.rows.bone_lengths, hand=row[1], model="whole-hand")
        cells = dict(zip(header[3:], row[3:], strict=True))
        assert len(cells) == len(bones) == 19
        for bone in bones:
            start = f"{bone['length_mm']:.1f} ± {bone['sd_mm']:.1f}"
            assert cells[bone["bone"].replace("_", " ")].rstrip(" ◆✕") == start
    times, n = times_expected(row for row in fitted.rows.agreement if row["model"] == "whole-hand")["hand"]
    differ = f"Bone lengths of the two hands differ by {times:.1f} times the expected amount ({n} pairs)"
    assert differ in fitted_study_page


def test_the_three_gravest_problems_are_shown_and_the_rest_folded(
    fitted: StudyResults, fitted_study: MadeStudy
) -> None:
    notes = [
        problem_row("capture", finding_of_text("recording", NOTE, f"{n} stray"), task=f"rom{n}")
        for n in range(5)
    ]
    gap = {"seen": "gap", "joint": "index_pip", "before": 31.2, "after": 1.4}
    seen = {"rotates": "transmitter-to-receiver", **gap}
    finding = Finding("quaternion-inverse", SUSPECT, "", seen)
    faults = [problem_row(STAGE, finding, subject=f"S{i:02}", hand="left", task="rom") for i in range(11)]
    accepted = problem_row(STAGE, finding.accept("a doll"), subject="S11", hand="left", task="rom")
    many = fitted.with_rows(problems=[*notes, *faults, accepted])
    page = render_study(many, fitted_study.study)
    assert "Accepted in the recordings sheet: 1" in page
    section = page.partition('id="problems"')[2].partition("</section>")[0]
    shown, folded = section.split("<summary>3 more</summary>")
    assert shown.count("<strong>") == 3
    assert "<strong>11 recordings</strong>" in shown
    assert shown.count("write <code>rotates: transmitter-to-receiver</code> under") == 1
    assert "<li>subject S10, left hand, rom: after correction, the gap of index_pip falls" in shown
    assert shown.index("seem to be the inverse") < shown.index("0 stray")
    assert folded.count("stray") == 3
    text = judged_models.outcome_text(many)
    assert text.index("seem to be the inverse") < text.index("0 stray")
    assert "and 3 more; see the report" in text
    assert max(map(len, text.splitlines())) <= WIDTH


def test_a_picture_that_fails_is_a_problem_of_the_page(
    fitted: StudyResults, fitted_study: MadeStudy, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shukotsu.report.figures.drawing.page_figure", lambda _: {}["x"])
    page = render_study(fitted.with_rows(problems=[*fitted.rows.problems]), fitted_study.study)
    assert "Not drawn: internal error in report" in page
    assert "KeyError" in page.partition('id="problems"')[2].partition("</section>")[0]


@pytest.mark.slow
def test_the_page_of_a_hundred_subjects_is_under_two_megabytes(tmp_path: Path) -> None:
    hundred = many_subjects(tmp_path, 100, simulated=False)
    page = render_study(hundred.results, hundred.study)
    assert len(page.encode()) < 2_000_000
    table = table_called(page, "Joints of every hand, whole-hand")
    assert len(table.rows) == 3 + 200  # two header rows, the median, and every hand
