"""A picture of each movement of a calibration: the hand moves in a loop, the joints that it is for marked."""

from __future__ import annotations

import numpy as np

from guide.average_joints import posed
from guide.flesh import flesh_of
from guide.hand_drawing import HandDrawing
from guide.movements import movements
from guide.picture_card import CARD, Drawing
from guide.picture_words import label
from guide.views import View, whole

_HEIGHT, _MARGIN, _FOOT = 370.0, 18.0, 36.0
_LEAST_WIDTHS = {1: 300.0, 2: 440.0}
"""By number of views."""
_SCALE = 1.55
_FOREARM_MM = 45.0
"""Of the forearm, which runs out of the picture, that is to be seen."""


def movement_picture(name: str, language: str) -> str:
    """The picture's file: views side by side, as large in all pictures."""
    movement = movements()[name]
    title, description = (label(f"movement-{name}{end}", language) for end in ("", "-how"))
    hand = flesh_of(*posed(movement.frames))
    views = [View.seen(towards, (1.0, 0.0, 0.0), _SCALE, (0.0, 0.0)) for towards in movement.towards]
    boxes = [whole(view, hand) for view in views]
    widths = [float(np.ceil(high[0] - low[0])) + _MARGIN for low, high in boxes]
    width = max(_LEAST_WIDTHS[len(views)], sum(widths) + _MARGIN)
    room = (width - sum(widths)) / len(views)
    drawing = Drawing(f"movement-{name}", title, description, width, _HEIGHT, language)
    foot, left = _HEIGHT - _FOOT, 0.0
    middles = []
    with drawing.clipped():
        for towards, (low, high), own in zip(movement.towards, boxes, widths, strict=True):
            middles.append(left + (own + room) / 2)
            y = _MARGIN - low[1]
            y += 0.6 * max(foot - y - _FOREARM_MM * _SCALE, 0.0)
            at = middles[-1] - (low[0] + high[0]) / 2, y
            view = View.seen(towards, (1.0, 0.0, 0.0), _SCALE, at)
            HandDrawing(drawing, view, hand, movement.seconds, movement.joints).draw()
            left += own + room
        drawing.fade(0, foot - 34, width, 36)
        drawing.rectangle(0, foot, width, _FOOT, f'fill="{CARD}"')
    for middle, seen in zip(middles, movement.seen, strict=True):
        drawing.text(middle, foot + 19, label(seen, language), "middle", "s")
    return drawing.svg()
