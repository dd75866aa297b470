"""The study's subjects: where each is shown, and how well its hands came out."""

from __future__ import annotations

from collections import Counter

from markupsafe import Markup

from schemas.study import Hand
from stages.report.links import anchor, link, recording_links
from stages.report.score_tables import mean
from stages.report.study_results import Row, StudyResults
from stages.report.table_cells import DASH, Block, DataTable, counted, number
from stages.report.trust import believed_text


def subjects_table(results: StudyResults) -> DataTable:
    """A row for every hand, with links to the subject's page and to those of its recordings."""
    model = results.leading
    scores: dict[Hand, list[Row]] = {}
    for row in results.scores:
        if row["model"] == model:
            scores.setdefault(Hand(row["subject"], row["hand"]), []).append(row)
    truth = any(row["true_tip_mean_mm"] is not None for rows in scores.values() for row in rows)
    fitted = model in results.fitted
    header: tuple[str, ...] = ("Subject", "Hand", "See it move", "Recordings", "Joints to believe")
    header += ("Distal receivers left out [mm]",) if fitted else ()
    header += ("Fingertip against the truth [mm]",) if truth else ()
    rows = tuple(
        (*_who(results, hand), believed_text(results, hand, model))
        + ((_score(scores.get(hand, []), "left_out_mean_mm"),) if fitted else ())
        + ((_score(scores.get(hand, []), "true_tip_mean_mm"),) if truth else ())
        for hand in results.hands
    )
    return DataTable(
        f"Every hand of the study; the numbers are those of {model}, means over digits"
        " (held-out scores where there are any).",
        (Block(header, rows),),
        (),
        frozenset(range(4)),
    )


def _who(results: StudyResults, hand: Hand) -> tuple[str, ...]:
    page = results.paths.report
    links = recording_links(results.shown, results.paths, page, hand.subject, hand.hand)
    return (
        anchor(link(hand.subject, page, results.paths.subject_page(hand.subject))),
        hand.hand,
        Markup(", ").join(anchor(each) for each in links) if links else DASH,
        _recordings(results, hand),
    )


def _recordings(results: StudyResults, hand: Hand) -> str:
    """How many of the hand's recordings were used, and why the others were not."""
    mine = [recording for recording in results.recordings if recording.hand == hand]
    statuses = [results.status_of(recording) for recording in mine]
    used = sum(status == "used" for status, _ in statuses)
    if used == len(mine):
        return counted(used, "recording")
    reasons = Counter(": ".join(filter(None, each)) for each in statuses if each[0] != "used")
    texts = "; ".join(f"{why} ({count}×)" if count > 1 else why for why, count in reasons.items())
    return f"◆ {used} of {counted(len(mine), 'recording')}; {texts}"


def _score(rows: list[Row], name: str) -> str:
    fresh = [row for row in rows if row["held_out"]] or rows
    return number(mean(row[name] for row in fresh))
