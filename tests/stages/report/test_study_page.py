"""The study's page: who is in it, what was held out, and methods text that says what was done."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

import pytest
from finding_examples import EVIDENCE
from hypothesis import given
from hypothesis import strategies as st
from report_samples.read_page import ReadTable, read_page, rows_where, table_called

from schemas.findings import STAGE, SUSPECT, Finding, problem_row
from schemas.layout import read_layout
from schemas.results import Results
from schemas.study import Hand, Study, SubjectSession, read_study
from stages.report.links import anchor, link, recording_links
from stages.report.methods_text import REFERENCES, methods_text
from stages.report.study_page import render_study
from stages.report.study_results import StudyResults
from stages.report.terminal import terminal_tables
from stages.report.trust import believed_text
from stages.report.wording import speaking

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


def test_a_model_of_whole_hands_leads_where_any_layout_is_a_hand(fitted: StudyResults) -> None:
    arms = replace(fitted, layouts=dict.fromkeys(fitted.layouts, read_layout("arm")))
    assert (fitted.leading, arms.leading) == ("whole-hand", "paper-fig4")
    assert replace(arms, models={"whole-hand": fitted.models["whole-hand"]}).leading == "whole-hand"


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


def test_scores_of_a_hand_are_means_of_the_table(fitted: StudyResults, file: Study) -> None:
    """Of held-out scores where there are any."""
    for (subject, hand), row in _hands(fitted, file).items():
        mine = rows_where(fitted.scores, subject=subject, hand=hand, model="whole-hand", held_out=True)
        for cell, name in zip(row[3:5], ("left_out_mean_mm", "true_tip_mean_mm"), strict=True):
            values = [r[name] for r in mine if r[name] is not None]
            assert cell == f"{sum(values) / len(values):.2f}"


def test_in_sample_scores_stand_where_nothing_is_held_out(fitted: StudyResults, file: Study) -> None:
    seen = replace(fitted, scores=[row for row in fitted.scores if not row["held_out"] or row["reference"]])
    mine = rows_where(seen.scores, hand="right", model="whole-hand")
    values = [row["left_out_mean_mm"] for row in mine if row["left_out_mean_mm"] is not None]
    assert _hands(seen, file)["S01", "right"][3] == f"{sum(values) / len(values):.2f}"


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


def test_many_bone_lengths_are_folded(fitted: StudyResults, file: Study) -> None:
    def section(results: StudyResults) -> str:
        return render_study(results, file).partition('<section id="bones">')[2][:200]

    recordings = [
        replace(recording, hand=replace(recording.hand, subject=f"S{index}"))
        for index in range(20)
        for recording in fitted.recordings
    ]
    layouts = {recording.hand: next(iter(fitted.layouts.values())) for recording in recordings}
    assert "<details open>" in section(fitted)
    assert "<details>" in section(replace(fitted, recordings=tuple(recordings), layouts=layouts))
    assert "No bone length was computed." in render_study(replace(fitted, bones=[]), file)


def test_lengths_of_a_hand_with_a_finding_count_for_nothing(fitted: StudyResults, file: Study) -> None:
    where = {"subject": "S01", "hand": "left", "task": "rom"}
    finding = problem_row(STAGE, Finding("units", SUSPECT, "radians"), **where)
    page = render_study(replace(fitted, problems=[finding]), file)
    rows = _lengths(page, "whole-hand").rows[1:]
    assert [row[2] for row in rows] == ["15 of 19", "0 of 19 (◆ has a finding)"]


def test_lengths_that_are_not_the_bones_are_said(results: StudyResults, study: Study) -> None:
    """The paper's models end a digit at its distal receiver."""
    page = render_study(results, study)
    rows = _lengths(page, "rigid").rows
    last = [place for place, name in enumerate(rows[0]) if name.endswith("distal")]
    assert all(row[place][-1] in "◆✕" for row in rows[1:] for place in last if row[place] != "–")
    assert "rigid ends a digit at its distal receiver" in page


def test_methods_say_what_the_study_is(fitted: StudyResults, results: StudyResults) -> None:
    """Subjects, hands, receivers, recordings, models; simulated recordings are never passed off as real."""
    text = " ".join(methods_text(fitted))
    assert "2 hands of 1 subject were simulated with 16 receivers a hand" in text
    assert "no person's hand is behind these numbers" in text
    assert "recordings of tasks that they were not made from" in text
    for name, model in fitted.models.items():
        assert f"{name}: {model.description.rstrip('.')}." in text
    plain = " ".join(methods_text(results))
    assert "were recorded with" in plain
    assert "simulator" not in plain
    assert "; 1 further recording could not be used." in plain
    assert "nothing was held out" in plain


def test_methods_name_the_hands_left_out_the_tracker_and_mappings(
    results: StudyResults, tmp_path: Path
) -> None:
    mapping = tmp_path / "lab.yaml"
    mapping.write_text(
        "format: csv\nposition_unit: inch\norientation: {kind: euler, axes: ZYX, unit: deg}\n"
        "receivers: {hand: {position: [x, y, z], orientation: [a, e, r]}}\n"
    )
    problem = {**vars(Hand("S01", "left")), "severity": "suspect"}
    first, *others = results.recordings
    rows = [row | {"tracker": "LIBERTY", "status": "used"} for row in results.recording_rows]
    named = replace(
        results,
        problems=[problem],
        recordings=(replace(first, mapping=mapping), *(replace(own, mapping=None) for own in others)),
        recording_rows=rows,
    )
    text = methods_text(named)[0]
    assert (
        "Left out of every statistic, for what was found in their recordings: subject S01, left hand." in text
    )
    assert " The tracker was: LIBERTY." in text
    declared = "positions in inch, euler ZYX deg receiver-to-transmitter"
    assert f" 1 recording of another program was read as lab.yaml declares: {declared}." in text
    mapping.unlink()
    unknown = replace(named, recording_rows=[row | {"tracker": None} for row in rows])
    text = methods_text(unknown)[0]
    assert "do not name the tracker" in text
    assert "was read as lab.yaml declares." in text


def test_methods_of_an_arm_speak_of_no_thumb(fitted: StudyResults) -> None:
    arms = replace(fitted, layouts=dict.fromkeys(fitted.hands, read_layout("arm")))
    assert "thumb" in " ".join(methods_text(fitted))
    text = " ".join(methods_text(arms))
    assert "thumb" not in text
    assert "paper-fig4: each joint by the receivers on both sides of it." in text


@pytest.mark.parametrize("number", range(1, len(REFERENCES) + 1))
def test_every_reference_is_cited(fitted: StudyResults, number: int) -> None:
    text = " ".join(methods_text(fitted)).replace("[1–3]", "[1] [2] [3]")
    assert f"[{number}]" in text
    assert f"[{len(REFERENCES) + 1}]" not in text


def test_rate_is_that_of_the_recordings(fitted: StudyResults) -> None:
    """The median over recordings; nothing is said where no recording has device times."""
    timed = replace(
        fitted,
        recording_rows=[
            row | {"status": "used", "n_frames": 241, "duration_s": 1.0} for row in fitted.recording_rows
        ],
    )
    assert " at 240 Hz, in " in methods_text(timed)[0]
    untimed = replace(timed, recording_rows=[row | {"duration_s": None} for row in timed.recording_rows])
    assert " Hz" not in methods_text(untimed)[0]


def test_links_name_trial_and_hand(results: StudyResults) -> None:
    """What tells recordings apart stands in their links."""
    who = SubjectSession("S01")
    links = recording_links(results.shown, results.paths, results.paths.report, who)
    assert [each.words for each in links] == ["opposition, right hand", "opposition, left hand"]
    (one,) = recording_links(
        results.shown, results.paths, results.paths.report, SubjectSession("S01"), "left"
    )
    assert one == ("opposition", "report/sub-S01/left/opposition.html")


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


def test_a_fault_is_an_item_of_a_japanese_page_too(fitted: StudyResults, file: Study) -> None:
    results = _study_of_one_fault(fitted)
    with speaking("ja", results.problems):
        section = (
            render_study(results, file).partition('<section class="findings"')[2].partition("</section>")[0]
        )
    assert section.count("回転が宣言の逆回転と考えられる") == 1
    assert "<strong>11 件の記録</strong>" in section
    assert "<code>rotates: transmitter-to-receiver</code>" in section
    assert not re.search("lang=|&lt;|`", section)


def test_an_accepted_fault_is_shown_once_as_accepted(fitted: StudyResults, file: Study) -> None:
    results = _study_of_one_fault(fitted, "as worn")
    page, text = render_study(results, file), terminal_tables(results)
    for shown in (page, text):
        assert shown.count("seem to be the inverse") == 1
        assert shown.count("as worn") == 1
        assert "Accepted in the recordings sheet" in shown
        assert "settle" not in shown.lower().partition("accepted in the recordings sheet")[0]
    assert 'id="problems"' not in page
    assert "What went wrong" not in text
    assert "`" not in text
    assert "- 11 recordings, check_recordings: The rotations" in " ".join(text.split())


def test_the_terminal_has_findings_first_each_once(fitted: StudyResults) -> None:
    text = " ".join(terminal_tables(_study_of_one_fault(fitted)).split())
    assert text.count("seem to be the inverse") == 1
    assert 'write "rotates: transmitter-to-receiver" under "orientation" in the mapping' in text
    assert "Found in the recordings, to be settled first: - 11 recordings, check_recordings: The rot" in text
    assert (
        "subject S03, left hand, rom; and 7 more subject S00, left hand, rom: put right, the gap of" in text
    )
