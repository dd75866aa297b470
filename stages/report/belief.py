"""Whether to believe a joint: one decision, which every page, picture and figure shows."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping

from schemas.catalogue import DISTAL_RECEIVER
from schemas.layout import Layout
from stages.report.palette import AMBER, INK, NO, WEAK_LINE, Mark
from stages.report.table_cells import alike, listed
from stages.report.wording import mark, say, told, word

BELIEVED, CARE, NOT = mark("✓ yes"), mark("◆ with care"), mark("✕ no")
BELIEFS = (BELIEVED, CARE, NOT)
"""From good to bad; a picture marks them by shape and colour, see BELIEF_MARKS."""

BELIEF_MARKS: Mapping[str, Mark] = {
    BELIEVED: Mark("o", INK, INK),
    CARE: Mark("D", AMBER, WEAK_LINE),
    NOT: Mark("X", NO, NO),
}

SMALL_SD_MM = 2.0
"""A centre known better than this, 1 sigma in 3-D, is placed within a fifth of a finger's thickness."""

LARGE_GAP_MM = 5.0
"""On a hand, two receivers have their joint's centre 1 mm apart, rms, and hardly ever 4. Thicker skin moves
them with posture, so that more frames make the centre no surer."""


def belief(row: Mapping[str, object]) -> str:
    """One of BELIEFS for a row of joint_centres."""
    sd = row["sd_mm"]
    if row["status"] in ("weak", "failed"):
        return NOT
    return BELIEVED if isinstance(sd, float) and sd <= SMALL_SD_MM and not _apart_mm(row) else CARE


def length_belief(
    bone: Mapping[str, object], joints: Mapping[str, Mapping[str, object]], *, is_whole: bool
) -> str:
    """One of BELIEFS for a row of bone_lengths: the worst of the joints at its ends and of its own error.

    joints : rows of joint_centres by joint. is_whole : whether it is the bone itself, see `is_whole_bone`.
    """
    sd = bone["sd_mm"]
    if bone["length_mm"] is None:
        return NOT
    known = is_whole and isinstance(sd, float) and sd <= SMALL_SD_MM
    ends = (belief(joints[str(bone[end])]) for end in ("starts_at", "ends_at") if bone[end] in joints)
    return max([BELIEVED if known else CARE, *ends], key=BELIEFS.index)


def is_whole_bone(bone: Mapping[str, object], layout: Layout) -> bool:
    """Whether a row of bone_lengths is of the bone itself: not one from the wrist, or to a receiver."""
    own = {joint.child: name for name, joint in layout.joints.items()}
    return bone["starts_at"] == own.get(str(bone["bone"])) and bone["ends_at"] != DISTAL_RECEIVER


def _apart_mm(row: Mapping[str, object]) -> float:
    """How far apart a joint's receivers have its centre, rms, where that is more than skin on a hand does."""
    gap = row.get("gap_rms_mm")
    return gap if isinstance(gap, float) and gap > LARGE_GAP_MM else 0.0


def reason(row: Mapping[str, object]) -> str:
    """Why a row of joint_centres is not believed, or what else is known of it; empty without either.

    Its 1-sigma error stands beside it in a column of its own, so that joints with one reason share it.
    """
    message = str(row["message"]).rstrip(".")
    if row["status"] == "failed":
        return say("has no place: {message}", message=message)
    if row["status"] == "weak":
        return told(message) or say("marked weak, no reason given")
    if apart := _apart_mm(row):
        wide = say(
            "its receivers have it {apart:.0f} mm apart, more than skin on a hand moves, which the "
            "stated error does not know",
            apart=apart,
        )
        return "; ".join(filter(None, [wide, told(message)]))
    if row["sd_mm"] is None:
        return "; ".join(filter(None, [say("no error is stated for its place"), told(message)]))
    return told(message)


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
        listed(map(word, own))
        if kinds[own[0]] == [""]
        else say("{kinds} of {own}", kinds=listed(kinds[own[0]]), own=listed(map(word, own)))
        for own in groups
    )
    return "; ".join(texts)
