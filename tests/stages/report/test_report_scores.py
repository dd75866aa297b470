"""What the skeletons are worth, what would make them better, and where the receivers sit."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_samples.made_study import FITTED_MODELS, make_study
from report_samples.read_page import ReadTable, read_page, rows_where, table_called
from report_samples.rendered import whole_report

from schemas.advice import GAP
from schemas.catalogue import CALIBRATION_ADVICE, GAINS, JOINT_ERRORS, RECEIVERS, SKELETON_SCORES
from schemas.findings import STAGE
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.study import Hand, Study, read_study
from schemas.tables import Provenance, write_failure
from stages.report.belief import BELIEVED, belief
from stages.report.headline import headline, opening
from stages.report.next_recording import next_recording
from stages.report.next_step import next_step
from stages.report.score_tables import LEFT_OUT, OF_A_DIGIT, score_table
from stages.report.study_results import StudyResults, hand_of, read_results
from stages.report.terminal import WIDTH, terminal_tables
from stages.report.trust import study_beliefs

SCORES = "Mean over digits and hands: subject S01, opposition."
TRUTH = "Distance of the joints from the true ones, both hands: subject S01."
COMPACT = ["replay", "posed", "left", "out", "wr-MCP", "metac.", "true", "tip"]
EMPTY = {"scores": [], "joint_errors": [], "advice": [], "receivers": [], "gains": [], "receiver_costs": []}


def _text(page: str) -> str:
    return " ".join(" ".join(read_page(page).text).split())


def _mean(rows: list[dict[str, Any]], name: str) -> str:
    known = [row[name] for row in rows if row[name] is not None]
    return f"{np.mean(known):.2f}" if known else "–"


def _truth_table(page: str) -> ReadTable:
    (found,) = [table for table in read_page(page).tables if table.caption.startswith(TRUTH)]
    return found


def test_scores_are_means_of_the_table(fitted: StudyResults, fitted_page: str) -> None:
    """Held-out rows and references, in-sample rows apart; every cell the mean over both hands' digits."""
    table = table_called(fitted_page, SCORES)
    seen = table_called(fitted_page, f"In-sample, m{SCORES[1:]}")
    assert [row[:3] for row in seen.rows[1:]] == [
        ["paper-fig4", "opposition", "○ no"],
        ["whole-hand", "opposition", "○ no"],
    ]
    assert [row[:3] for row in table.rows] == [
        ["Skeleton", "Made from", "Held out"],
        ["paper-fig4", "rom", "yes"],
        ["whole-hand", "rom", "yes"],
        ["Reference", "Made from", "Held out"],
        ["prior-only", "–", "–"],
        ["distal-receiver", "–", "–"],
        ["true-skeleton", "–", "–"],
    ]
    names = ("replay_mean_mm", "posed_mean_mm", "left_out_mean_mm", "wrist_mcp_sd_mm", "metacarpal_deg")
    for cells in (row for row in [*table.rows, *seen.rows] if row[1] != "Made from"):
        made_from = "" if cells[1] == "–" else cells[1]
        rows = rows_where(fitted.scores, model=cells[0], calibrated_on=made_from)
        expected = [_mean(rows, name) for name in (*names, "true_tip_mean_mm")]
        if cells[0] in ("paper-fig4", "true-skeleton"):  # never posed, so nothing was left out of a pose
            expected[2] = "–"
        assert cells[3:] == expected


def test_means_over_fewer_digits_say_so(fitted: StudyResults, fitted_page: str) -> None:
    """The left ring finger has no number under any model; the references have all ten digits."""
    assert "All models: 9 of 10 digits; joint ring_dip failed." in _text(fitted_page)
    trial = next(fitted.trials("S01"))
    right = rows_where(fitted.scores, hand="right")
    table = score_table(replace(fitted, scores=right), trial)
    assert table is not None
    assert table.notes == ("All rows: 5 of 10 digits.",)
    posed = [{**row, "posed_mean_mm": None} if row["digit"] == "index" else row for row in fitted.scores]
    fewer = [row for row in posed if row["reference"] or row["hand"] == "right"]
    table = score_table(replace(fitted, scores=fewer), trial)
    assert table is not None
    assert table.notes == (
        "paper-fig4 (from rom); paper-fig4 (from opposition): 5 of 10 digits.",
        "whole-hand (from rom); whole-hand (from opposition): 4 of 10 digits.",
        "prior-only: 8 of 10 digits.",
    )
    nothing = {score.name: None for score in OF_A_DIGIT} | {"message": "no skeleton."}
    gone = [row | nothing if row["model"] == "prior-only" else row for row in right]
    table = score_table(replace(fitted, scores=gone), trial)
    assert table is not None
    assert "prior-only: 0 of 10 digits; no skeleton." in table.notes


def test_scores_digit_by_digit(fitted: StudyResults, fitted_page: str) -> None:
    """Each row of skeleton_scores stands under its digit with its percentiles, frames and message."""
    caption = "Digit by digit: subject S01, left hand, opposition; p95: 95th percentile."
    table = table_called(fitted_page, caption)
    heads = [i for i, row in enumerate(table.rows) if row[1] == "Made from"]
    assert [table.rows[i][0] for i in heads] == ["Thumb", "Index", "Middle", "Ring", "Little"]
    rows = rows_where(fitted.scores, hand="left", digit="ring")
    block = table.rows[heads[3] + 1 : heads[4]]
    assert len(block) == len(rows) == 7
    for row in rows:
        seen = "–" if row["reference"] else "yes" if row["held_out"] else "○ no"
        (cells,) = [cells for cells in block if (cells[0], cells[2]) == (row["model"], seen)]
        posed = row["posed_mean_mm"] is not None
        numbers = [row[score.name] if posed or score.name not in LEFT_OUT else None for score in OF_A_DIGIT]
        assert cells[3:-2] == ["–" if n is None else f"{n:.2f}" for n in numbers]
        assert cells[-2:] == [str(row["n_frames"]), row["message"]]
    right = table_called(fitted_page, caption.replace("left", "right"))
    assert right.rows[0][-1] == "Frames"  # no message, no column for it
    assert {len(row) for row in right.rows} == {len(table.rows[0]) - 1}


def test_joints_against_the_truth(fitted: StudyResults, fitted_page: str) -> None:
    """Median, 90th percentile, worst, share far off, parts, axis, bones and coverage, a row a skeleton."""
    table = _truth_table(fitted_page)
    assert [row[0] for row in table.rows[1:]] == ["paper-fig4"] * 2 + ["whole-hand"] * 2 + [
        "Reference",
        "prior-only",
    ]
    for cells in (row for row in table.rows[1:] if row[0] != "Reference"):
        made_from = "" if cells[1] == "–" else cells[1]
        rows = rows_where(fitted.joint_errors, model=cells[0], calibrated_on=made_from)
        error = np.array([row["error_mm"] for row in rows if row["error_mm"] is not None])
        assert len(error) == 29
        axes = [row["axis_deg"] for row in rows if row["axis_deg"] is not None]
        within = [row["within_95"] for row in rows if row["within_95"] is not None]
        expected = [np.median(error), np.quantile(error, 0.9), error.max()]
        medians = [0.8 * np.median(error), 0.6 * np.median(error), np.median(axes), np.median(error)]
        assert cells[2:] == [
            "29 of 30",
            *(f"{value:.2f}" for value in expected),
            f"{100 * np.mean(error > 5):.0f}",
            *(f"{value:.2f}" for value in medians),
            f"{100 * np.mean(within):.0f}" if within else "–",
        ]


def test_joint_by_joint(fitted: StudyResults, fitted_page: str) -> None:
    """Every joint's error under every skeleton, a dash where it has none."""
    table = table_called(
        fitted_page, "Distance of each joint from the true one, in mm: subject S01, left hand."
    )
    assert len(table.rows) == 16
    for row in rows_where(fitted.joint_errors, hand="left"):
        title = f"{row['model']}, from {row['calibrated_on']}" if row["calibrated_on"] else row["model"]
        (cells,) = [cells for cells in table.rows if cells[0] == row["joint"]]
        cell = cells[table.rows[0].index(title)]
        assert cell == ("–" if row["error_mm"] is None else f"{row['error_mm']:.2f}")


def test_without_a_truth_nothing_is_said_of_it(page: str) -> None:
    """A real study has neither the truth's columns nor a word about its absence."""
    table = table_called(page, SCORES)
    assert not [cell for cell in table.rows[0] if cell.startswith(("Metacarpal", "True"))]
    assert not [table for table in read_page(page).tables if "true one" in table.caption]
    assert "compared with its truth" not in _text(page)


def test_advice_names_what_should_move(fitted_page: str) -> None:
    """Only joints that lack motion stand open; all of them, also the nearly enough, are folded away."""
    lacking = table_called(fitted_page, "Joints that should move more: subject S01, left hand.")
    advice = "move the little finger's fingertip joint alone through 40 deg"
    assert lacking.rows[1:] == [["little_dip", "8", "4.50", "2.00", advice]]
    every = table_called(fitted_page, "Motion of every joint: subject S01, left hand.")
    assert len(every.rows) == 16
    text = _text(fitted_page)
    assert "1 of 15 joints should move more." in text
    assert "All 15 joints move enough in the calibration recordings." in text


def test_joints_that_more_movement_does_not_help_are_not_told_to_move(fitted: StudyResults) -> None:
    hand = Hand("S01", "right")
    rows = [row | {"kind": GAP} if row["joint"] == "index_mcp" else row for row in fitted.advice]
    found = next_recording(replace(fitted, advice=rows), hand)
    assert found.remark.startswith("Of 1 of 15 joints more movement says nothing")
    assert found.to_move is None
    assert "move more" not in opening(replace(fitted, advice=[row for row in rows if hand_of(row) == hand]))


def test_the_best_gains_are_told_in_words(fitted_page: str) -> None:
    """What to measure, how well, and what that does; the other rows are left to the table."""
    text = _text(fitted_page)
    first = (
        "Measuring how far to the side of the middle finger's proximal phalanx its receiver sits to 0.4 mm "
        "would take its MCP from 1.9 to 1.0 mm (the mean of all joints from 1.26 to 1.21 mm)."
    )
    assert text.count(first) == 2
    assert text.count("would take its") == 6
    assert "What one more measurement on the hand would gain with whole-hand, the best 3 of 6:" in text
    assert "Fingertips are known to 2.57 mm. Where they matter, one touch of each on a known point" in text


def test_what_fewer_receivers_cost_is_a_table(fitted_page: str) -> None:
    table = table_called(fitted_page, "A task with fewer receivers, whole-hand: subject S01, left hand.")
    lost = "ring_pip: 2.72 mm, 7.10 deg"
    assert table.rows[1:] == [
        ["all of the calibration", "16", "1.51", "3.03", lost],
        ["without the ring finger's middle phalanx", "15", "1.61", "4.03", lost],
        ["layout tips-and-hand", "6", "1.71", "5.03", lost],
    ]


def test_receivers(fitted: StudyResults, fitted_page: str) -> None:
    """Place with its error, residuals, and the one that came loose, marked and counted."""
    caption = "Receivers of subject S01, left hand, model whole-hand, with 1-sigma errors."
    table = table_called(fitted_page, caption)
    assert len(table.rows) == len(rows_where(fitted.receivers, hand="left")) + 1
    place = ["12.34 ± 0.56"] * 3 + ["0.30", "0.40"]
    (loose,) = [row for row in table.rows if row[0] == "ring_middle"]
    moved = "◆ from frame 123 of opposition: moved 3.2 mm, turned 4.3 deg"
    assert loose[1:] == ["◆ weak", *place, moved, "it came loose"]
    (other,) = [row for row in table.rows if row[0] == "ring_distal"]
    assert other[1:] == ["ok", *place, "", ""]
    assert "Left hand, whole-hand: 17 receivers, 1 weak, 1 came loose" in _text(fitted_page)


def test_empty_tables_are_told_or_left_out(fitted: StudyResults, results: StudyResults, study: Study) -> None:
    """Each section says in a sentence that it has nothing; receivers only where a model fits the hand."""
    text = _text(whole_report(replace(fitted, **EMPTY), study))
    assert "No skeleton was scored in this task." in text
    assert "The recordings are simulated, but no joint was compared with its truth." in text
    assert text.count("Whether its joints move enough could not be computed") == 2
    assert text.count("would gain with whole-hand is not known.") == 2
    assert text.count("whole-hand: no hand was fitted") == 2
    page = whole_report(replace(results, **EMPTY), study)
    assert "No model of this study fits the whole hand, so what measuring would gain is not known." in _text(
        page
    )
    assert "receivers" not in [attributes.get("id") for _, attributes in read_page(page).tags]


def test_failed_tables_join_the_problems(tmp_path: Path) -> None:
    """A table whose making failed counts as empty, and its reason stands under what went wrong."""
    study, folder = make_study(tmp_path, n_frames=2, models=FITTED_MODELS, subjects=("A",), simulated=True)
    tables = (SKELETON_SCORES, JOINT_ERRORS, CALIBRATION_ADVICE, RECEIVERS, GAINS)
    for table in tables:
        write_failure(folder / f"{table.name}.parquet", table, f"no {table.name}", Provenance())
    results = read_results(read_study(study), folder)
    problems = table_called(
        whole_report(results, read_study(study)), "Everything that did not go as the study asked."
    )
    told = [["the study", "report", f"{table.name}.parquet: no {table.name}"] for table in tables]
    assert problems.rows[1:] == told
    assert "Skeletons, mean" not in terminal_tables(results)


def test_headline_leads_with_the_fitted_hand(fitted: StudyResults) -> None:
    """Recordings, held-out error, joints beside the paper's."""
    mine = rows_where(fitted.scores, model="whole-hand", held_out=True)
    joints = [
        [row["error_mm"] for row in rows_where(fitted.joint_errors, model=model, calibrated_on="rom")]
        for model in ("whole-hand", "paper-fig4")
    ]
    ours, theirs = ([error for error in errors if error is not None] for errors in joints)
    far = sum(error > 5 for error in theirs)
    assert far
    assert headline(fitted) == (
        "4 of 4 recordings were used; they are simulated, so no person's hand is behind these numbers. "
        "On recordings that it was not made from, whole-hand misses the distal receivers, whose positions it "
        f"was not told, by {_mean(mine, 'left_out_mean_mm')} mm on average (anatomy alone, without data: "
        f"6.72 mm). Made from rom, its joints are {np.median(ours):.1f} mm from the true ones in the median "
        f"and 0 of 29 are more than 5 mm off; those of paper-fig4 {np.median(theirs):.1f} mm and {far} of 29."
    )


def test_the_opening_says_which_how_good_and_what_next(fitted: StudyResults) -> None:
    """Every joint is in one of the three lists, and what to do next stands last."""
    text = opening(fitted)
    rows = rows_where(fitted.joints, model="whole-hand")
    believed = [row["sd_mm"] for row in rows if belief(row) == BELIEVED]
    beliefs = study_beliefs(fitted, "whole-hand")
    count = sum(each == BELIEVED for each in beliefs.values())
    assert text.startswith(
        f"{count} of {len(beliefs)} joints can be believed in both hands, as whole-hand places them, "
        f"typically to {np.median(believed):.1f} mm: "
    )
    assert "Not: DIP of ring and little." in text
    assert text.endswith(next_step(fitted))


def _suspect(*hands: str) -> list[dict[str, str]]:
    row = {"subject": "S01", "session": "", "task": "rom", "model": "", "stage": STAGE, "kind": "units"}
    return [row | {"severity": "suspect", "message": "in m", "hand": hand} for hand in hands]


def test_a_hand_that_is_left_out_is_counted_out_aloud(fitted: StudyResults) -> None:
    """The joints that follow are of the other hand, and no headline is made of hands that are not judged."""
    text = opening(replace(fitted, problems=_suspect("left")))
    assert text.startswith("Judged: 1 of 2 hands. Left out for what was found in their recordings: 1. ")
    assert "can be believed, as whole-hand places them" in text
    assert "Next: settle what was found in the recordings of subject S01's left hand" in text


def test_with_every_hand_left_out_nothing_false_is_said(fitted: StudyResults) -> None:
    every = replace(fitted, problems=_suspect("left", "right"))
    assert opening(every).startswith(
        "Nothing is judged: what was found in the recordings leaves everything out (2 hands). Next: settle "
    )
    assert "tip error" not in headline(every)
    assert headline(every).endswith(
        "in their recordings: subject S01's right hand and subject S01's left hand."
    )


def test_one_hand_is_not_both(fitted: StudyResults) -> None:
    """Nor are an arm's sides hands."""
    one = replace(
        fitted,
        recordings=tuple(r for r in fitted.recordings if r.hand.hand == "right"),
        joints=[row for row in fitted.joints if row["hand"] == "right"],
    )
    assert re.match(r"\d+ of 20 joints can be believed, as whole-hand places them", opening(one))
    arms = replace(fitted, layouts=dict.fromkeys(fitted.layouts, read_layout("arm")))
    assert " joints can be believed on both sides, as " in opening(arms)


def test_a_study_without_a_joint_says_so(fitted: StudyResults) -> None:
    nothing = replace(fitted, joints=[], advice=[], gains=[])
    assert opening(nothing) == ("No joint was solved under whole-hand: 2 hands. Next: see “What went wrong”.")


def test_headline_without_truth_or_held_out_rows(fitted: StudyResults) -> None:
    """A fitted hand that is scored on its own recordings says so; without scores the replays are told."""
    seen = [row for row in fitted.scores if row["reference"] or not row["held_out"]]
    text = headline(replace(fitted, scores=seen, joint_errors=[]))
    assert "On the recordings that it was made from (nothing is held out), whole-hand misses" in text
    assert "from the true ones" not in text
    without_prior = [row for row in fitted.scores if row["model"] != "prior-only"]  # an arm has none
    text = headline(replace(fitted, scores=without_prior))
    assert re.search(r"by \d\.\d\d mm on average\. Made from rom", text)
    text = headline(replace(fitted, **EMPTY))
    assert re.search(r"misses its receiver by \d+\.\d\d mm \([a-z0-9-]+\) and ", text)
    assert "how well the joints close and not where they are" in text


def test_headline_says_what_the_papers_joints_were_made_from(fitted: StudyResults) -> None:
    """Joints that were made from other tasks than the fitted hand's are told apart."""
    kept = [row for row in fitted.scores if (row["model"], row["held_out"]) != ("paper-fig4", True)]
    assert "those of paper-fig4 (made from opposition)" in headline(replace(fitted, scores=kept))


def test_headline_stands_beside_joints_that_nobody_corrected(fitted: StudyResults) -> None:
    """Of the paper's models the one of the highest table that took no corrections by hand."""
    more = {name: read_model(name) for name in ("paper-fig4-corrected", "paper-fig3")}
    assert "those of paper-fig4 " in headline(replace(fitted, models=more | fitted.models))


def test_terminal_has_the_scores_after_the_papers_tables(fitted: StudyResults) -> None:
    """Held-out skeletons, in-sample ones, references; what each column is and what rows were made from."""
    text = terminal_tables(fitted)
    assert max(map(len, text.splitlines())) <= WIDTH
    start = text.index("Skeletons, mean over digits and hands: subject S01, opposition.")
    assert text.index("Table 3.") < start
    lines = [line.split() for line in text[start:].splitlines()]
    heads = [line[0] for line in lines if line[-8:] == COMPACT]
    assert heads == ["Held", "In-sample", "Reference"]
    mine = rows_where(fitted.scores, model="whole-hand", held_out=True)
    held_out = lines[lines.index(["Held", "out", *COMPACT]) + 2]
    assert held_out[:2] == ["whole-hand", _mean(mine, "replay_mean_mm")]
    assert held_out[3] == _mean(mine, "left_out_mean_mm")
    assert "Held out, made from rom: paper-fig4, whole-hand." in text


@pytest.mark.parametrize("name", ["page", "fitted_page"])
def test_contents_name_receivers_where_there_are_some(name: str, request: pytest.FixtureRequest) -> None:
    tags = read_page(request.getfixturevalue(name)).tags
    links = {attributes.get("href") for tag, attributes in tags if tag == "a"}
    assert {"#worth", "#next"} <= links
    assert ("#receivers" in links) == (name == "fitted_page")
