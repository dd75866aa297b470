"""How a verdict on a joint or a bone looks and reads: the tables have it, and nothing here decides."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import Any

from schemas import verdict
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

_SHOWN = {verdict.BELIEVE: BELIEVED, verdict.CARE: CARE, verdict.NO: NOT}
"""What is shown of the column `verdict`."""

_SAID: Mapping[str, str] = {
    verdict.SUSPECT: mark("what was found in its recording leaves it out of everything"),
    verdict.FAR: mark(
        "the hand that fits is far from any usual one ({what} is {sd:.0f} SD off): wrong units, swapped "
        "receivers, or a receiver far from the middle of its bone"
    ),
    verdict.HALVES: mark(
        "its receivers disagree by {gap_mm:.0f} mm, which the stated error does not know: a loose receiver, "
        "a wrong quaternion order or angle convention, or thick skin"
    ),
    verdict.UNCERTAIN: mark("known less well than to {wanted_mm:g} mm (1 sigma, 3-D)"),
    verdict.ONE_WAY: mark(
        "known less well than to {wanted_mm:g} mm (1 sigma, 3-D), nearly all of it in one direction"
    ),
    verdict.BY_ANATOMY: mark("anatomy places it rather than the recording"),
    verdict.MOVED_LITTLE: mark("moved only {range_deg:.0f} deg; skin alone can look like that"),
    verdict.NO_POSE: mark("no valid pose of {segments}: anatomy and the other receivers stand in for it"),
    verdict.ONE_RECEIVER: mark("no receiver on {segments}: lengths of bones stand in for it"),
    verdict.UNSETTLED: mark("the fit of the hand did not converge"),
    verdict.ACROSS: mark(
        "seen from {receiver} across {segment}, which moves and carries no receiver, so that nothing in the "
        "data shows how far it is off"
    ),
    verdict.AXIS_IN_PLANE: mark(
        "its axis is {axis_plane_deg:.0f} deg from the plane that cuts it, which moved the centre "
        "{slide_mm:.0f} mm along it"
    ),
    verdict.BY_HAND: mark("moved {correction_mm:.1f} mm by hand; the stated error is of the place before"),
    verdict.FROM_DOUBTFUL: mark("found from joints that are not to be believed: {joints}"),
    verdict.NO_ERROR: mark("no error is stated for its place"),
    verdict.AXIS: mark("its axis is uncertain by {axis_sd_deg:.0f} deg"),
}
"""What a kind of doubt says of a joint."""


def belief(row: Mapping[str, object]) -> str:
    """One of BELIEFS for a row of joint_centres or bone_lengths: what its column `verdict` says."""
    return _SHOWN[str(row["verdict"])]


def reasons_of(row: Mapping[str, Any]) -> list[str]:
    """Why a row of joint_centres is doubted and what else is known of it, sentences, the weightiest first.

    Its 1-sigma error stands beside it in a column of its own, so that joints with one reason share it.
    """
    doubts, message = verdict.doubts_of(row), told(str(row["message"]).rstrip("."))
    said = [_sentence(kind, values) for kind, values in doubts.items() if kind != verdict.NOT_SOLVED]
    if verdict.NOT_SOLVED in doubts:
        message = say("has no place: {message}", message=message)
    return [text for text in (*said, message) if text]


def _sentence(kind: str, values: Mapping[str, Any]) -> str:
    shown = {
        name: listed(map(word, own)) if isinstance(own, list) else word(own) if isinstance(own, str) else own
        for name, own in values.items()
    }
    return say(_SAID[kind], **shown) if kind in _SAID else ""


def wanted_text(layouts: Iterable[Layout], times: float = 1.0) -> str:
    """What a study asks of a centre, mm, or so many times that; of several layouts each: 2 or 10."""
    wanted = sorted({layout.wanted_mm for layout in layouts})
    return say(" or ").join(f"{times * own:g}" for own in wanted)


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
