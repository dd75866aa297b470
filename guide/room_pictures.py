"""The room of a recording: where transmitter and hand are, what stays away, and how to try it."""

from __future__ import annotations

import math

import numpy as np

from guide.hand_drawing import HandDrawing
from guide.picture_card import ACCENT, CABLE, CARD, EDGE, INK, METAL, RECEIVER, SOFT, X_AXIS, Drawing
from guide.picture_words import label
from guide.receiver_pictures import flat_hand
from guide.views import View, number

RANGE_CM, HAND_CM = 90.0, 30.0
"""A LIBERTY is specified to 36 inches; the simulator's hand is about 30 cm away."""

_WIDTH = 420.0
_PX_PER_CM = 1.95
_WOOD, _WOOD_LINE, _TRANSMITTER = "#ead9bd", "#b99b6b", "#3b4a58"


def room_picture(language: str) -> str:
    """A plan of the room."""
    name, height = "room", 410.0
    drawing = Drawing(name, label(name, language), label(f"{name}-how", language), _WIDTH, height, language)
    x, y = 196.0, 210.0
    reach = RANGE_CM * _PX_PER_CM
    with drawing.clipped():
        drawing.circle(
            x, y, reach, f'fill="#eef4f4" stroke="{SOFT}" stroke-width="1.6" stroke-dasharray="2 7"'
        )
        wood = f'rx="8" fill="{_WOOD}" stroke="{_WOOD_LINE}" stroke-width="1.8"'
        drawing.rectangle(84, 138, 232, 136, wood)
        hand_x = x + HAND_CM * _PX_PER_CM
        view = View.seen((0, 0, 1), (1, 0, 0), 0.1 * _PX_PER_CM * 1.6, (hand_x + 8, 250.0))
        HandDrawing(drawing, view, flat_hand(), bones=False, line_px=1.2).draw()
    _transmitter(drawing, x, y, 11)
    drawing.arrow((x + 14, y), (hand_x - 14, y), X_AXIS, 2.2)
    drawing.text((x + hand_x) / 2 - 1, y - 15, label("about-30", language), "middle", "m h")
    drawing.text(x - 4, y + 30, label("transmitter", language), "middle", "m")
    drawing.text(96, 158, label("wooden-table", language), css="s")
    angle = math.radians(-72)
    edge = (x + reach * math.cos(angle), y + reach * math.sin(angle))
    drawing.arrow((x + 16 * math.cos(angle), y + 16 * math.sin(angle)), edge, SOFT, 1.4)
    drawing.text(edge[0] - 10, edge[1] + 44, label("as-specified", language), "start", "m h")
    _away(drawing, 364, 18, 40, 96, label("steel", language))
    _away(drawing, 362, 330, 40, 34, label("computer", language))
    _away(drawing, 18, 352, 40, 26, label("motor", language))
    return drawing.svg()


def _transmitter(drawing: Drawing, x: float, y: float, half: float) -> None:
    drawing.rectangle(
        x - half,
        y - half,
        2 * half,
        2 * half,
        f'rx="3" fill="{_TRANSMITTER}" stroke="{CARD}" stroke-width="1.5"',
    )


def _away(drawing: Drawing, x: float, y: float, width: float, height: float, words: str) -> None:
    """Something that must stay away."""
    drawing.rectangle(x, y, width, height, f'rx="3" fill="{METAL}" stroke="{INK}" stroke-width="1.6"')
    drawing.line([(x + 6, y + 6), (x + width - 6, y + height - 6)], EDGE, 2)
    drawing.text(min(x + width / 2, _WIDTH - 36), y + height + 16, words, "middle", "m")


def hemisphere_picture(language: str) -> str:
    """The half of space in which the hand stays, and where a flip puts it."""
    name, height = "hemisphere", 300.0
    drawing = Drawing(name, label(name, language), label(f"{name}-how", language), _WIDTH, height, language)
    x, y = 206.0, 132.0
    with drawing.clipped():
        drawing.rectangle(x, 0, _WIDTH - x, height, 'fill="#e8f1ec"')
        drawing.line([(x, 16), (x, height - 16)], SOFT, 1.8, 'stroke-dasharray="2 7"')
        off = (104.0, 36.0)
        for sign, opacity in ((1.0, 1.0), (-1.0, 0.38)):
            at = (x + sign * off[0], y + sign * off[1] + 34)
            view = View.seen((0, 0, 1), (1, 0, 0), 0.62, at)
            with drawing.group(f'opacity="{opacity}"'):
                HandDrawing(drawing, view, flat_hand(), bones=False, line_px=1.4).draw()
    for sign in (1.0, -1.0):
        end = (x + sign * (off[0] - 14), y + sign * (off[1] - 5))
        drawing.line([(x, y), end], ACCENT, 1.8, 'stroke-dasharray="5 6"')
    _transmitter(drawing, x, y, 14)
    drawing.arrow((x + 17, y), (x + 62, y), X_AXIS, 3)
    drawing.text(x + 60, y - 9, "+x", "middle", "h", f'style="fill:{X_AXIS}"')
    drawing.tick(x + 104, 264, right=True)
    drawing.tick(x - 104, 264, right=False)
    drawing.text(x + 104, 291, label("here", language), "middle", "m")
    drawing.text(x - 104, 291, label("not-here", language), "middle", "m")
    drawing.text(
        x,
        y + 32,
        label("transmitter", language),
        "middle",
        "m",
        f'stroke="{CARD}" stroke-width="3" paint-order="stroke"',
    )
    return drawing.svg()


def rigid_pair_picture(language: str) -> str:
    """Two receivers on a stick, which is moved about: their distance tells of metal."""
    name, height, seconds = "rigid-pair", 220.0, 8.0
    drawing = Drawing(name, label(name, language), label(f"{name}-how", language), _WIDTH, height, language)
    time = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    middle = np.stack([246 + 74 * np.sin(time), 118 + 22 * np.sin(2 * time)], -1)
    turn = np.radians(24) * np.sin(time + 0.6)
    way = np.stack([np.cos(turn), np.sin(turn)], -1)
    ends = [middle - 62 * way, middle + 62 * way]
    across = np.stack([-way[:, 1], way[:, 0]], -1)
    stick = _frames(np.stack([middle - 80 * way, middle + 80 * way], 1))
    drawing.path(stick, f'fill="none" stroke="{_WOOD_LINE}" stroke-width="15"', seconds)
    drawing.path(stick, f'fill="none" stroke="{_WOOD}" stroke-width="12"', seconds)
    for end in ends:
        cable = [f"M{_at(a)}Q{number(a[0])} {number(a[1] + 70)} 60 206" for a in end]
        drawing.path(cable, f'fill="none" stroke="{CABLE}" stroke-width="2"', seconds)
        box = np.stack([end - 10 * way, end + 10 * way], 1)
        drawing.path(
            _frames(box),
            f'fill="none" stroke="{RECEIVER}" stroke-width="13" style="stroke-linecap:butt"',
            seconds,
        )
    above = [end - 24 * across for end in ends]
    drawing.path(_frames(np.stack(above, 1)), f'fill="none" stroke="{ACCENT}" stroke-width="2.2"', seconds)
    for line in above:
        mark = np.stack([line - 5 * across, line + 5 * across], 1)
        drawing.path(_frames(mark), f'fill="none" stroke="{ACCENT}" stroke-width="2.2"', seconds)
    _transmitter(drawing, 50, 104, 14)
    drawing.text(50, 138, label("transmitter", language), "middle", "m")
    drawing.text(246, 30, label("same-distance", language), "middle", "m h", f'style="fill:{ACCENT}"')
    return drawing.svg()


def _at(place: np.ndarray) -> str:
    return f"{number(place[0])} {number(place[1])}"


def _frames(lines: np.ndarray) -> list[str]:
    return ["M" + "L".join(_at(place) for place in line) for line in lines]
