"""Advice on a joint's calibration: its kinds, and the message that is made of a kind and its values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from shukotsu.sentences.messages import MESSAGES, Message, message_of

Values = Mapping[str, Any]
"""By name: numbers and words, as JSON has them."""

ENOUGH = "enough"
ON_SKIN = "enough-on-skin"
MOVE = "move-more"
GAP = "receivers-disagree"
OPEN_AXIS = "open-along-axis"
UNCERTAIN = "uncertain"
UNSEEN = "never-seen"
UNSETTLED = "finding-stands"

KINDS = (ENOUGH, ON_SKIN, MOVE, GAP, OPEN_AXIS, UNCERTAIN, UNSEEN, UNSETTLED)
NOTHING_TO_DO = (ENOUGH, ON_SKIN)
"""Kinds that ask for nothing."""


def advice_text(joint: str, kind: str, values: Values) -> Message:
    """Give the sentence on a joint, by what people call it. It has no number that stands beside it."""
    if kind == MOVE:
        digit, _, place = joint.rpartition("_")
        named = f"move-{joint if digit == 'thumb' else place}"
        return message_of(named if digit and named in MESSAGES else MOVE, digit=digit, **values)
    return message_of(kind, **values)
