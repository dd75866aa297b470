"""Advice on a joint's calibration: its kinds, and the sentences that are made of a kind and its values.

`say` puts values into a template's placeholders; the report's does so in its language. Without one, English.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

Values = Mapping[str, Any]
"""By name: numbers and words, as JSON has them."""
Say = Callable[..., str]

ENOUGH = "enough"
ON_SKIN = "enough-on-skin"
MOVE = "move-more"
GAP = "receivers-disagree"
OPEN_AXIS = "open-along-axis"
UNCERTAIN = "uncertain"
UNSEEN = "never-seen"
UNSETTLED = "finding-stands"

NOTHING_TO_DO = (ENOUGH, ON_SKIN)
"""Kinds that ask for nothing."""

ADVICE: Mapping[str, str] = {
    ENOUGH: "enough",
    ON_SKIN: (
        "enough for a limb, whose skin moves: its receivers disagree by {gap_mm:.1f} mm at best, which is a "
        "fault where they sit on something rigid"
    ),
    MOVE: "move it alone through {wanted_deg:.0f} deg",
    GAP: (
        "its receivers disagree by {gap_mm:.1f} mm at best: more movement does not help; look at the "
        "receivers on {parent} and {child}, whether one is loose"
    ),
    OPEN_AXIS: (
        "it turned about one axis alone, which leaves open by {sd_mm:.0f} mm where on that axis its centre "
        "is (at best its receivers disagree by {gap_mm:.1f} mm): more of this movement does not help; turn "
        "it about another axis too, or take a model that cuts the axis with a plane"
    ),
    UNCERTAIN: (
        "known to {sd_mm:.1f} mm only, where {enough_mm:.1f} would do (at best its receivers disagree by "
        "{gap_mm:.1f} mm), and more of this movement gains little; look at the receivers on {parent} and "
        "{child}, and whether the layout is theirs"
    ),
    UNSEEN: "no frame in which {parent} and {child} are both valid; check these receivers",
    UNSETTLED: "nothing can be said before this is settled: {finding}",
}
"""What each kind advises. MOVE of a finger's joint has the words of `NAMED`."""

NAMED = "move the {owner} {place} alone through {wanted_deg:.0f} deg"
PLACES = {
    "mcp": "knuckle",
    "pip": "middle joint",
    "dip": "fingertip joint",
    "ip": "tip joint",
    "cmc": "base",
}
"""What people call a joint of a digit."""


def english(template: str, **values: Any) -> str:
    """The template with its values, in English."""
    return template.format(**values)


def advice_text(joint: str, kind: str, values: Values, say: Say = english) -> str:
    """The sentence on a joint. It has no number that stands beside it in the table."""
    digit, _, place = joint.rpartition("_")
    if kind == MOVE and place in PLACES:
        owner = "thumb's" if digit == "thumb" else f"{digit} finger's"
        return say(NAMED, owner=owner, place=PLACES[place], **values)
    return say(ADVICE[kind], **values)
