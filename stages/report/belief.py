"""Show verdicts on joints and bones in signs and words: the tables have them, and nothing here decides."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from shukotsu.schemas import verdict
from shukotsu.schemas.layout import Layout
from shukotsu.sentences.translation import N_, listed, tr, translated, word
from shukotsu.stages.report.palette import AMBER, INK, NO, WEAK_LINE, Mark

BELIEVED, CARE, NOT = N_("✓ yes"), N_("◆ with care"), N_("✕ no")
BELIEFS = (BELIEVED, CARE, NOT)
"""From good to bad; a picture marks them by shape and colour, see BELIEF_MARKS."""

BELIEF_MARKS: Mapping[str, Mark] = {
    BELIEVED: Mark("o", INK, INK),
    CARE: Mark("D", AMBER, WEAK_LINE),
    NOT: Mark("X", NO, NO),
}

_SHOWN = {verdict.BELIEVE: BELIEVED, verdict.CARE: CARE, verdict.NO: NOT}
"""What is shown of the column `verdict`."""

_DOUBT_TEXTS: Mapping[str, str] = {
    verdict.SUSPECT: N_("what was found in its recording leaves it out of everything"),
    verdict.FAR: N_(
        "the hand that fits is far from any usual one ({what} is {sd:.0f} SD off): wrong units, swapped "
        "receivers, or a receiver far from the middle of its bone"
    ),
    verdict.HALVES: N_(
        "its receivers disagree by {gap_mm:.0f} mm, which the stated error does not know: a loose receiver, "
        "a wrong quaternion order or angle convention, or thick skin"
    ),
    verdict.TOO_CLOSE: N_(
        "{joints} lie {mm:.1f} mm apart, nearer than in any hand: look at the receivers on these fingers"
    ),
    verdict.UNCERTAIN: N_("known less well than to {wanted_mm:g} mm (1 sigma, 3-D)"),
    verdict.ONE_WAY: N_(
        "known less well than to {wanted_mm:g} mm (1 sigma, 3-D), nearly all of it in one direction"
    ),
    verdict.BY_ANATOMY: N_("anatomy places it rather than the recording"),
    verdict.MOVED_LITTLE: N_("moved only {range_deg:.0f} deg; skin alone can look like that"),
    verdict.NO_POSE: N_("no valid pose of {segments}: anatomy and the other receivers stand in for it"),
    verdict.ONE_RECEIVER: N_("no receiver on {segments}: lengths of bones stand in for it"),
    verdict.UNSETTLED: N_("the fit of the hand did not converge"),
    verdict.ACROSS: N_(
        "seen from {receiver} across {segment}, which moves and carries no receiver, so that nothing in the "
        "data shows how far it is off"
    ),
    verdict.AXIS_IN_PLANE: N_(
        "its axis is {axis_plane_deg:.0f} deg from the plane that cuts it, which moved the centre "
        "{slide_mm:.0f} mm along it"
    ),
    verdict.BY_HAND: N_("moved {correction_mm:.1f} mm by hand; the stated error is of the place before"),
    verdict.FROM_DOUBTFUL: N_("found from joints that are not to be believed: {joints}"),
    verdict.NO_ERROR: N_("no error is stated for its place"),
    verdict.AXIS: N_("its axis is uncertain by {axis_sd_deg:.0f} deg"),
}
"""What a kind of doubt says of a joint."""


def belief(row: Mapping[str, object]) -> str:
    """One of BELIEFS for a row of joint_centres or bone_lengths: what its column `verdict` says."""
    return _SHOWN[str(row["verdict"])]


def reasons_of(row: Mapping[str, Any]) -> list[str]:
    """Why a row of joint_centres is doubted and what else is known of it, sentences, the weightiest first.

    Its 1-sigma error stands beside it in a column of its own, so that joints with one reason share it.
    """
    doubts, message = verdict.doubts_of(row), translated(row["message"]).rstrip(".。")
    reasons = [_sentence(kind, values) for kind, values in doubts.items() if kind != verdict.NOT_SOLVED]
    if verdict.NOT_SOLVED in doubts:
        message = tr("has no place: {message}", message=message)
    return [text for text in (*reasons, message) if text]


def _sentence(kind: str, values: Mapping[str, Any]) -> str:
    shown = {
        name: listed(map(word, own)) if isinstance(own, list) else word(own) if isinstance(own, str) else own
        for name, own in values.items()
    }
    return tr(_DOUBT_TEXTS[kind], **shown) if kind in _DOUBT_TEXTS else ""


def wanted_text(layouts: Iterable[Layout], times: float = 1.0) -> str:
    """Write the error wanted of a centre, mm, or so many times that; of several layouts each: 2 or 10."""
    wanted = sorted({layout.wanted_mm for layout in layouts})
    return tr(" or ").join(f"{times * own:g}" for own in wanted)


def commonest(beliefs: Iterable[str]) -> str:
    """Return the verdict of the middle one of several hands, of two middle ones the worse."""
    ordered = sorted(beliefs, key=BELIEFS.index)
    return ordered[len(ordered) // 2]
