"""The study at a glance: every joint of every hand as a cell of a table, and every hand small."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from statistics import median

from markupsafe import Markup

from shukotsu.report.belief import reasons_of
from shukotsu.report.figures.study_figures import joints_in_order
from shukotsu.report.links import Link, link
from shukotsu.report.study_results import Row, StudyResults
from shukotsu.report.table_cells import shown
from shukotsu.study.verdict import BELIEVE, CARE, NO, VERDICTS
from shukotsu.tables.subjects import Hand
from shukotsu.translation import tr, word

CLASSES_MM = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Upper ends of the classes of colour; the last class is open."""
MARKS = {BELIEVE: "", CARE: "◆", NO: "✕"}
FEW_HANDS = 3
"""With more hands a row of medians stands on top."""
_FAN_DEG = {"thumb": 48.0, "index": 12.0, "middle": 2.0, "ring": -8.0, "little": -19.0}
"""Which way a digit of a right hand points from the wrist, from straight on towards the thumb."""
_WRIST_MM, _USUAL_MM = 30.0, 25.0
"""From the wrist to where a first bone starts, where no bone says it; a bone whose length is not known."""


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
    for hand, row_of in of_hand.items():
        to = link(hand.who.label, page, results.paths.subject_page(*hand.who))
        cells = tuple(_cell([row_of[joint]]) if joint in row_of else None for joint in joints)
        rows.append(JointRow(to, word(hand.hand), cells, believed_text([*row_of.values()])))
    parts = [joint.rpartition("_") for joint in joints]
    digits = [(word(digit), len(list(group))) for digit, group in groupby(digit for digit, _, _ in parts)]
    names = tuple(part.upper() if digit else word(part) for digit, _, part in parts)
    judged = [rows for hand, rows in of_hand.items() if hand not in results.suspect and rows]
    medians = tuple(_cell([rows[joint] for rows in judged if joint in rows]) for joint in joints)
    return JointPicture(digits, names, tuple(rows), medians if len(judged) > FEW_HANDS else ())


def believed_text(rows: Sequence[Row]) -> str:
    """Return how many joints of all are believed."""
    return f"{sum(row['verdict'] == BELIEVE for row in rows)}/{len(rows)}"


def _cell(rows: Sequence[Row]) -> JointCell | None:
    """A joint; of several hands the median error and the middle verdict, of two the worse."""
    if not rows:
        return None
    sds = [row["sd_mm"] for row in rows if row["sd_mm"] is not None]
    sd = median(sds) if sds else None
    verdict = sorted((row["verdict"] for row in rows), key=list(MARKS).index)[len(rows) // 2]
    level = -1 if sd is None else sum(sd >= end for end in CLASSES_MM)
    why = "; ".join(reasons_of(rows[0])) if verdict != BELIEVE and len(rows) == 1 else ""
    return JointCell(shown("sd_mm", sd), level, MARKS[verdict], why)


def class_texts() -> list[str]:
    """Return the classes of colour in words, mm."""
    ends = [f"{end:g}" for end in CLASSES_MM]
    return [
        f"< {ends[0]}",
        *(f"{low}–{high}" for low, high in pairwise(ends)),
        f"> {ends[-1]}",
    ]


def small_hand(results: StudyResults, hand: Hand, model: str) -> Markup:
    """Return the hand from its back as SVG: a schema, in which only lengths and verdicts are the tables'."""
    lengths = {(row["digit"], row["bone"]): row for row in results.bones_of.get((hand, model), [])}
    verdicts = {row["joint"]: row["verdict"] for row in results.joints_of.get((hand, model), [])}
    layout = results.layouts[hand]
    wrist = layout.wrist.joint if layout.wrist else None
    position: dict[str, tuple[float, float]] = {wrist: (0.0, 0.0)} if wrist else {}
    lines = []
    side = 1.0 if hand.hand == "right" else -1.0
    for index, (name, digit) in enumerate(layout.digits.items()):
        angle = math.radians(_FAN_DEG.get(name, 10.0 * index))
        right, up = -side * math.sin(angle), -math.cos(angle)
        bones = [lengths.get((name, bone), {}) for bone in digit.segments]
        starts = bones[0].get("starts_at", "") if layout.is_hand else wrist
        reach, line = 0.0 if starts == wrist else _WRIST_MM, [(0.0, 0.0)]
        for joint, bone in zip(digit.joints, bones, strict=True):
            line.append((right * reach, up * reach))
            position.setdefault(joint, line[-1])
            reach += bone.get("length_mm") or _USUAL_MM
        lines.append([*line, (right * reach, up * reach)])
    dots = defaultdict(list)
    for joint, point in position.items():
        if joint in verdicts:
            dots[verdicts[joint]].append(f"M{_point(point)}h0")
    paths = [("bones", "".join("M" + "L".join(map(_point, line)) for line in lines))]
    paths += [(verdict, "".join(dots[verdict])) for verdict in VERDICTS if dots[verdict]]
    title = tr("{hand} hand of {who}, joints by verdict", hand=word(hand.hand), who=hand.who.label)
    inside = Markup("").join(Markup('<path class="{}" d="{}"/>').format(*path) for path in paths)
    across, down = zip(*(point for line in lines for point in line), strict=True)
    box = (min(across) - 8, min(down) - 8, max(across) - min(across) + 16, max(down) - min(down) + 16)
    size = " ".join(f"{length:.0f}" for length in box)
    return Markup('<svg viewBox="{}" role="img"><title>{}</title>{}</svg>').format(size, title, inside)


def _point(point: tuple[float, float]) -> str:
    return f"{point[0]:.0f} {point[1]:.0f}"
