"""Sentences of the summary: which joints to take with care and why, and which action would help most."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from typing import TYPE_CHECKING, Any

from shukotsu.report.belief import gain_lines, reasons_of
from shukotsu.report.study_results import StudyResults, hand_of
from shukotsu.study import verdict
from shukotsu.study.plan_file import read_plan
from shukotsu.translation import N_, listed, tr, word

if TYPE_CHECKING:
    from shukotsu.tables.rows import JointCentresRow

MOST_REASONS = 3
"""Largest number of reasons in a sentence."""

_MOVEMENTS = {
    "thumb_cmc": N_("record large circles of the thumb, from its base, for 10 s"),
    "thumb_(mcp|ip)": N_("bend and straighten the thumb alone for 10 s"),
    "(index|middle|ring|little)_(mcp|pip|dip)": N_("bend and straighten the {digit} finger alone for 10 s"),
}
"""Movement to record to determine joints better, by a pattern of the joints' names."""
_MOVED_MORE = (verdict.MOVED_LITTLE, verdict.UNCERTAIN, verdict.ONE_WAY, verdict.AXIS)
_WORN_MORE = (verdict.NO_POSE, verdict.ONE_RECEIVER)


def doubted_joints(results: StudyResults) -> list[JointCentresRow]:
    """Return the rows of joints that are not believed, under the leading model.

    Joints without a receiver and joints of suspect hands are left out.
    """
    rows = (row for row in results.judging.rows.joint_centres if row["model"] == results.leading)
    return [row for row in rows if row["verdict"] != verdict.BELIEVE and row["reason"] != verdict.NOT_WORN]


def care_line(results: StudyResults) -> str:
    """Return a sentence on the joints to take with care and why, the most frequent reason first, or ""."""
    of_reason: dict[str, list[JointCentresRow]] = defaultdict(list)
    for row in doubted_joints(results):
        of_reason[row["reason"]].append(row)
    n_hands = len({hand_of(row) for row in results.judging.rows.joint_centres})
    parts = []
    for rows in sorted(of_reason.values(), key=len, reverse=True)[:MOST_REASONS]:
        counts = Counter(row["joint"] for row in rows)
        joints = [
            word(joint) if n == n_hands else tr("{joint} (in {n} of {all})", joint=joint, n=n, all=n_hands)
            for joint, n in counts.items()
        ]
        worst = max(rows, key=lambda row: row["sd_mm"] or 0.0)
        parts.append(": ".join([listed(joints), *reasons_of(worst)[:1]]))
    return tr("Use with care: {joints}.", joints="; ".join(parts)) if parts else ""


def next_step(results: StudyResults) -> str:
    """Return a sentence on the action that would improve the joints most, or an empty string.

    Actions are ranked by the sum, over the joints that they improve, of the error in excess of `wanted_mm`.
    """
    if results.suspect:
        return tr("Next: correct the mistakes found in the recordings, and run again.")
    missed_mm: dict[str, float] = defaultdict(float)
    served: dict[str, dict[str, None]] = defaultdict(dict)
    doubted = doubted_joints(results)
    plans = {hand: results.paths.plan(*hand.who) for hand in map(hand_of, doubted)}
    measured = {
        hand
        for hand, plan in plans.items()
        if not plan.is_file() or read_plan(plan).sizes_mm["hand_length_mm"] is not None
    }
    for row in doubted:
        hand = hand_of(row)
        wanted_mm = results.layouts[hand].wanted_mm
        if action := _action(row, is_measured=hand in measured):
            missed_mm[action] += max((row["sd_mm"] or 2 * wanted_mm) - wanted_mm, 0.0)
            served[action][row["joint"]] = None
    if missed_mm:
        action = max(missed_mm, key=lambda each: missed_mm[each])
        joints = [*served[action]]
        return tr("Next: {action}; this would improve {joints}.", action=action, joints=joints)
    gains = [row for row in results.rows.gains if row["model"] == results.leading and hand_of(row) in plans]
    best = sorted(gains, key=lambda row: row["mean_sd_after_mm"] - row["mean_sd_before_mm"])[:1]
    return tr("Next: {action}", action=gain_lines(best)[0]) if best else ""


def _action(row: JointCentresRow, *, is_measured: bool) -> str:
    """Return the remedy for a joint's doubts, or an empty string if none is known.

    is_measured : whether the length of its hand is.
    """
    for kind, values in verdict.doubts_of(row).items():
        segments: Any = values.get("segments")
        if kind in _WORN_MORE and segments:
            return tr("wear a receiver on {segments}, and record again", segments=segments)
        if kind == verdict.HALVES:
            return tr(
                "tape the receivers on both sides of {joint} firmly, and record again", joint=row["joint"]
            )
        if kind == verdict.BY_ANATOMY and not is_measured:
            return tr("measure the hand's length (participants.tsv, column hand_length_mm)")
        if kind in _MOVED_MORE:
            for joints, sentence in _MOVEMENTS.items():
                if re.fullmatch(joints, row["joint"]):
                    return tr(sentence, digit=row["joint"].partition("_")[0])
    return ""
