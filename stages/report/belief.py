"""Whether to believe a joint: one decision, which every page, picture and figure shows."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping

from stages.report.palette import AMBER, INK, NO, WEAK_LINE, Mark
from stages.report.table_cells import alike, listed

BELIEVED, CARE, NOT = "✓ yes", "◆ with care", "✕ no"
BELIEFS = (BELIEVED, CARE, NOT)
"""From good to bad; a picture marks them by shape and colour, see BELIEF_MARKS."""

BELIEF_MARKS: Mapping[str, Mark] = {
    BELIEVED: Mark("o", INK, INK),
    CARE: Mark("D", AMBER, WEAK_LINE),
    NOT: Mark("X", NO, NO),
}

SMALL_SD_MM = 2.0
"""A centre known better than this, 1 sigma in 3-D, is placed within a fifth of a finger's thickness."""


def belief(row: Mapping[str, object]) -> str:
    """One of BELIEFS for a row of joint_centres."""
    sd = row["sd_mm"]
    if row["status"] in ("weak", "failed"):
        return NOT
    return BELIEVED if isinstance(sd, float) and sd <= SMALL_SD_MM else CARE


def reason(row: Mapping[str, object]) -> str:
    """Why a row of joint_centres is not believed, or what else is known of it; empty without either.

    Its 1-sigma error stands beside it in a column of its own, so that joints with one reason share it.
    """
    message = str(row["message"]).rstrip(".")
    if row["status"] == "failed":
        return f"has no place: {message}"
    if row["status"] == "weak":
        return message or "marked weak, no reason given"
    if row["sd_mm"] is None:
        return "; ".join(filter(None, ["no error is stated for its place", message]))
    return message


def commonest(beliefs: Iterable[str]) -> str:
    """What holds of the middle one of several hands, of two middle ones the worse."""
    ordered = sorted(beliefs, key=BELIEFS.index)
    return ordered[len(ordered) // 2]


def joints_text(joints: Iterable[str]) -> str:
    """Names of joints in words, digits with the same ones together: MCP and PIP of index and ring; wrist."""
    kinds: dict[str, list[str]] = defaultdict(list)
    for joint in joints:
        digit, _, kind = joint.rpartition("_")
        kinds[digit or joint].append(kind.upper() if digit else "")
    groups = alike(kinds)
    texts = (
        listed(own) if kinds[own[0]] == [""] else f"{listed(kinds[own[0]])} of {listed(own)}"
        for own in groups
    )
    return "; ".join(texts)
