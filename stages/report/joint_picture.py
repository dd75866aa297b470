"""The study at a glance: every joint of every hand, its error as colour and number, its verdict as mark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from statistics import median

from shukotsu.schemas.verdict import BELIEVE, CARE, NO
from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.belief import reasons_of
from shukotsu.stages.report.links import Link, link
from shukotsu.stages.report.print_figures.study_figures import joints_in_order
from shukotsu.stages.report.study_results import Row, StudyResults
from shukotsu.stages.report.table_cells import shown

CLASSES_MM = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Upper ends of the classes of colour; the last class is open."""
MARKS = {BELIEVE: "", CARE: "◆", NO: "✕"}
FEW_HANDS = 3
"""With more hands a row of medians stands on top."""


@dataclass(frozen=True)
class JointCell:
    """A joint of a hand. level : class of colour, -1 without a stated error. why : what a pointer is told."""

    sd: str
    level: int
    mark: str
    why: str = ""


@dataclass(frozen=True)
class JointRow:
    """A hand's joints in the columns' order, None where the model has no such; how many are believed."""

    who: Link
    hand: str
    cells: tuple[JointCell | None, ...]
    believed: str


@dataclass(frozen=True)
class JointPicture:
    """Digits with how many columns each has, joints (their part of the name), and the rows."""

    digits: list[tuple[str, int]]
    joints: tuple[str, ...]
    rows: tuple[JointRow, ...]
    medians: tuple[JointCell | None, ...]


def joint_picture(results: StudyResults) -> JointPicture | None:
    """Return the picture under the leading model; None where no hand has a joint."""
    model, page = results.leading, results.paths.report
    of_hand = {
        hand: {row["joint"]: row for row in results.joints_of.get((hand, model), [])}
        for hand in results.hands
    }
    joints = joints_in_order(results, {joint for rows in of_hand.values() for joint in rows})
    if not joints:
        return None
    rows = []
    for hand, known in of_hand.items():
        believed = sum(row["verdict"] == BELIEVE for row in known.values())
        to = link(hand.who.label, page, results.paths.subject_page(*hand.who))
        cells = tuple(_cell(known[joint]) if joint in known else None for joint in joints)
        rows.append(JointRow(to, word(hand.hand), cells, f"{believed}/{len(known)}"))
    parts = [joint.rpartition("_") for joint in joints]
    digits = [(word(digit), len(list(own))) for digit, own in groupby(digit for digit, _, _ in parts)]
    names = tuple(part.upper() if digit else word(part) for digit, _, part in parts)
    judged = [rows for hand, rows in of_hand.items() if hand not in results.suspect and rows]
    medians = tuple(_median([rows[joint] for rows in judged if joint in rows]) for joint in joints)
    return JointPicture(digits, names, tuple(rows), medians if len(judged) > FEW_HANDS else ())


def _cell(row: Row) -> JointCell:
    why = "; ".join(reasons_of(row)) if row["verdict"] != BELIEVE else ""
    return JointCell(shown("sd_mm", row["sd_mm"]), _level(row["sd_mm"]), MARKS[row["verdict"]], why)


def _median(rows: Sequence[Row]) -> JointCell | None:
    """The middle one of the stated errors and of the verdicts of a joint, of two verdicts the worse."""
    if not rows:
        return None
    sds = [row["sd_mm"] for row in rows if row["sd_mm"] is not None]
    sd = median(sds) if sds else None
    verdicts = sorted((row["verdict"] for row in rows), key=list(MARKS).index)
    return JointCell(shown("sd_mm", sd), _level(sd), MARKS[verdicts[len(verdicts) // 2]])


def _level(sd_mm: float | None) -> int:
    return -1 if sd_mm is None else sum(sd_mm >= end for end in CLASSES_MM)


def class_texts() -> list[str]:
    """Return the classes of colour in words, mm."""
    low, *middle, high = [f"{end:g}" for end in CLASSES_MM]
    first, last = tr("below {low}", low=low), tr("above {high}", high=high)
    return [first, *(tr("to {end}", end=end) for end in (*middle, high)), last]
