"""Whether to believe a joint, why not, and what would help: hand by hand, and over the whole study."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from statistics import median

from schemas.study import Hand
from stages.report.skeleton_tables import NO_JOINT
from stages.report.study_results import Row, StudyResults, hand_of
from stages.report.table_cells import DASH, Block, DataTable, number

BELIEVED, CARE, NOT = "✓ yes", "◆ with care", "✕ no"

SMALL_SD_MM = 2.0
"""A centre known better than this, 1 sigma in 3-D, is placed within a fifth of a finger's thickness."""

APART_MM = 5.0
"""Models that put a joint farther apart than this cannot both be right: it is half a bone's breadth."""


@dataclass(frozen=True)
class Verdict:
    """One joint of one hand under one model: one of BELIEVED, CARE, NOT, and why.

    apart_mm : how far from it the farthest other model puts the joint, and apart_model which; None where no
    other model has it.
    """

    joint: str
    believed: str
    why: str
    sd_mm: float | None
    apart_mm: float | None
    apart_model: str


def verdicts(results: StudyResults, hand: Hand, model: str) -> list[Verdict]:
    """What to think of every joint of a hand under one model."""
    others = {
        name: {row["joint"]: row for row in results.joints_of.get((hand, name), [])}
        for name in results.models
        if name != model
    }
    found = []
    for row in results.joints_of.get((hand, model), []):
        apart = {
            name: distance
            for name, rows in others.items()
            if (distance := _apart_mm(row, rows.get(row["joint"]))) is not None
        }
        farthest = max(apart, key=lambda name: apart[name], default="")
        believed, why = _judged(row)
        found.append(Verdict(row["joint"], believed, why, row["sd_mm"], apart.get(farthest), farthest))
    return found


def trust_table(results: StudyResults, hand: Hand, model: str) -> DataTable:
    """Every joint of a hand in words, and what to record or measure again."""
    advice = {row["joint"]: row["advice"] for row in results.advice if hand_of(row) == hand}
    rows = tuple(
        (v.joint, v.believed, v.why, _apart_in_words(v), _help(advice.get(v.joint, "")))
        for v in verdicts(results, hand, model)
    )
    return DataTable(
        f"Whether to believe the joints of {model}: {hand}.",
        (Block(("Joint", "Believe it?", "Why", "Farthest other model", "What would help"), rows),),
        () if rows else (NO_JOINT,),
        frozenset(range(5)),
    )


def study_trust_table(results: StudyResults, model: str) -> DataTable:
    """Every joint over all hands of the study, with the reason that is most often given for doubt."""
    by_joint: dict[str, list[Verdict]] = defaultdict(list)
    for hand in results.hands:
        for verdict in verdicts(results, hand, model):
            by_joint[verdict.joint].append(verdict)
    rows = tuple((joint, *_over_hands(found)) for joint, found in by_joint.items())
    header = (
        "Joint",
        "Hands",
        "Believed",
        "With care",
        "Not",
        "Median SD [mm]",
        "Median to the farthest model [mm]",
        "Most frequent doubt",
    )
    return DataTable(
        f"Whether to believe the joints of {model}, all hands of the study.",
        (Block(header, rows),),
        () if rows else (NO_JOINT,),
        frozenset({0, 7}),
    )


def believed_text(results: StudyResults, hand: Hand, model: str) -> str:
    """How many of a hand's joints to believe."""
    found = verdicts(results, hand, model)
    return f"{sum(v.believed == BELIEVED for v in found)} of {len(found)}" if found else DASH


def _judged(row: Row) -> tuple[str, str]:
    """The verdict on a row of joint_centres and the reason."""
    message = row["message"].rstrip(".")
    if row["status"] == "failed":
        return NOT, f"It has no place: {message}."
    if row["status"] == "weak":
        return NOT, f"Marked doubtful: {message or 'no reason given'}."
    sd = row["sd_mm"]
    if sd is None:
        return CARE, "No error is stated for its place."
    words = f"Its place is known to {number(sd)} mm (1 sigma, 3-D)"
    remark = f"; {message}." if message else "."
    if sd > SMALL_SD_MM:
        return CARE, f"{words}, more than {SMALL_SD_MM:g} mm{remark}"
    return BELIEVED, words + remark


def _apart_mm(row: Row, other: Row | None) -> float | None:
    """Distance between two models' places of a joint in the frame of a receiver that both name."""
    if other is None or "failed" in (row["status"], other["status"]):
        return None
    for side in ("child", "parent"):
        if row[f"{side}_segment"] and row[f"{side}_segment"] == other[f"{side}_segment"]:
            places = [[each[f"{side}_{axis}_mm"] for axis in "xyz"] for each in (row, other)]
            if None in places[0] or None in places[1]:
                continue
            return math.dist(places[0], places[1])
    return None


def _apart_in_words(verdict: Verdict) -> str:
    if verdict.apart_mm is None:
        return DASH
    mark = "◆ " if verdict.apart_mm > APART_MM else ""
    return f"{mark}{number(verdict.apart_mm, 1)} mm, {verdict.apart_model}"


def _help(advice: str) -> str:
    return "" if advice.startswith("enough") else advice


def _over_hands(found: list[Verdict]) -> tuple[str, ...]:
    counts = Counter(verdict.believed for verdict in found)
    doubts = Counter(v.why for v in found if v.believed != BELIEVED)
    return (
        str(len(found)),
        *(str(counts[word]) for word in (BELIEVED, CARE, NOT)),
        number(_median(v.sd_mm for v in found)),
        number(_median(v.apart_mm for v in found), 1),
        _most_frequent(doubts),
    )


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return median(known) if known else None


def _most_frequent(doubts: Counter[str]) -> str:
    """The commonest reason, numbers in it aside, with how often it is given."""
    kinds: dict[str, list[str]] = defaultdict(list)
    for why, count in doubts.items():
        kinds["".join("#" if c.isdigit() else c for c in why)] += [why] * count
    if not kinds:
        return ""
    most = max(kinds.values(), key=len)
    return f"{most[0]} ({len(most)} of {doubts.total()})" if doubts.total() > 1 else most[0]
