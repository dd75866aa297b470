"""Where the receivers sit on a hand, which way round, and how their cables leave it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from anatomy import average_hand as average
from anatomy import drawn_hands as drawn
from guide.average_joints import posed
from guide.flesh import Flesh, flesh_of
from guide.hand_drawing import HandDrawing
from guide.movements import movements
from guide.picture_card import (
    ACCENT,
    CABLE,
    CARD,
    EDGE,
    RECEIVER,
    SOFT,
    X_AXIS,
    Y_AXIS,
    Z_AXIS,
    Drawing,
)
from guide.picture_words import label
from guide.views import View, number
from schemas.layout import Layout, read_layout
from skeleton.rotations import Array, about_axis, matrix
from stages.simulate.task_motion import posture

LAYOUT = "liberty16"
RECEIVER_MM = (9.0, 6.4, 4.0)
"""Of a small receiver, along, across and in height: by eye."""

_WIDTH = 420.0


def flat_hand() -> Flesh:
    """The average right hand, flat, the fingers a little apart."""
    return flesh_of(*posed(movements()["flat"].postures))


def place_mm(segment: str) -> Array:
    """Where a receiver sits in its bone's frame, (3,) mm: the middle of its back, or the nail."""
    if segment == "hand":
        return np.array(drawn.HAND_MOUNT_MM)
    digit, _, kind = segment.partition("_")
    kinds = ("metacarpal", "proximal", "distal") if digit == "thumb" else average.BONE_KINDS
    return np.asarray(average.DIGITS[digit].mounts_mm()[kinds.index(kind)])


def receivers() -> dict[str, int]:
    """Station numbers of the layout's receivers that are not optional, by segment."""
    layout: Layout = read_layout(LAYOUT)
    worn = {name: layout.segments[name] for name in layout.measured}
    return {name: int(one.receiver) for name, one in worn.items() if not one.optional and one.receiver}


def box(
    drawing: Drawing, view: View, hand: Flesh, segment: str, turned_deg: float = 0.0, along_mm: float = 0.0
) -> None:
    """A receiver as it looks from far away: the sides that face the viewer.

    turned_deg : about the normal of the skin. along_mm : by which it sits distally of its place.
    """
    half = np.array(RECEIVER_MM) / 2
    at = place_mm(segment) + np.array([along_mm, 0.0, 0.0])
    turn = matrix(about_axis(np.array([0.0, 0.0, 1.0]), np.radians(turned_deg)))
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.eye(3)[axis] * sign
            faced = hand.at(segment, turn @ normal)[0] - hand.at(segment, np.zeros(3))[0]
            if faced @ view.towards <= 0.02:
                continue
            one, other = np.delete(np.eye(3), axis, 0)
            signs = ((-1, -1), (-1, 1), (1, 1), (1, -1))
            corners = [at + turn @ (half * (normal + a * one + b * other)) for a, b in signs]
            places = [view.px(hand.at(segment, corner)[0]) for corner in corners]
            data = "M" + "L".join(f"{number(x)} {number(y)}" for x, y in places) + "Z"
            shade = ' fill-opacity=".85"' if axis != 2 else ""
            drawing.path([data], f'fill="{RECEIVER}"{shade} stroke="{CARD}" stroke-width="1.2"')


def receivers_picture(language: str) -> str:
    """The back of a right hand with all receivers, their station numbers, segments and cables."""
    name, height = "receivers", 690.0
    drawing = Drawing(
        name, label("receivers", language), label("receivers-how", language), _WIDTH, height, language
    )
    hand, view = flat_hand(), View.seen((0, 0, 1), (1, 0, 0), 2.04, (238.0, 402.0))
    stations = receivers()
    with drawing.clipped():
        HandDrawing(drawing, view, hand, bones=False).draw()
        for index, segment in enumerate(stations):
            _cable(drawing, view, hand, segment, index)
        drawing.fade(0, 452, _WIDTH, 34)
        drawing.rectangle(0, 484, _WIDTH, height, f'fill="{CARD}"')
    for segment, station in stations.items():
        box(drawing, view, hand, segment)
        _badge_beside(drawing, view, hand, segment, station)
    _axes_inset(drawing)
    _stations_list(drawing, stations, 508.0, language)
    return drawing.svg()


def _cable(drawing: Drawing, view: View, hand: Flesh, segment: str, index: int) -> None:
    """From the receiver's proximal end along the back of its digit to the forearm."""
    x, y, z = place_mm(segment)
    half = RECEIVER_MM[0] / 2
    points = [view.px(hand.at(segment, np.array([x - half, y, z]))[0])]
    digit, _, kind = segment.partition("_")
    aside = {"distal": -1.2, "middle": 1.2, "proximal": 0.0, "metacarpal": 1.5}.get(kind, 0.0)
    below = {"distal": ("middle", "proximal"), "middle": ("proximal",)}.get(kind, ())
    if digit == "thumb":
        below = {"distal": ("proximal", "metacarpal"), "proximal": ("metacarpal",)}.get(kind, ())
    for other in below:
        side = aside * 3.4
        at = place_mm(f"{digit}_{other}") + np.array([0.0, side, 0.0])
        points.append(view.px(hand.at(f"{digit}_{other}", at)[0]))
    if segment != "hand" and digit != "thumb":
        points.append(view.px(hand.at(f"{digit}_metacarpal", np.array([38.0, aside, 8.0]))[0]))
    spread = (index - 7.5) * 0.75
    points.append(view.px(np.array([-8.0, -spread, 15.0])))
    points.append(view.px(np.array([-70.0, -spread, 15.0])))
    drawing.path([_smooth(points)], f'fill="none" stroke="{CABLE}" stroke-width="1.5"')


def _smooth(points: list[Array]) -> str:
    """A curve through points (Catmull and Rom's, as Bezier pieces)."""
    data = "M" + _place(points[0])
    for i in range(len(points) - 1):
        before, here, there = points[max(i - 1, 0)], points[i], points[i + 1]
        after = points[min(i + 2, len(points) - 1)]
        data += f"C{_place(here + (there - before) / 6)} {_place(there - (after - here) / 6)} {_place(there)}"
    return data


def _place(point: Array) -> str:
    return f"{number(point[0])} {number(point[1])}"


def _badge_beside(drawing: Drawing, view: View, hand: Flesh, segment: str, station: int) -> None:
    """The station number on its receiver's thumb side."""
    at = place_mm(segment)
    x, y = view.px(hand.at(segment, at)[0])
    digit = segment.split("_")[0]
    side = 0.0 if segment == "hand" else 1.0 if digit == "little" else -1.0
    drawing.badge(x + side * 17.0, y + (20.0 if segment == "hand" else 0.0), str(station))


def _axes_inset(drawing: Drawing) -> None:
    """One receiver, enlarged, with its axes."""
    x, y = 76.0, 410.0
    drawing.circle(x, y, 60, f'fill="{CARD}" stroke="{SOFT}" stroke-width="1.5"')
    _enlarged_box(drawing, x, y + 8)
    drawing.arrow((x, y + 2), (x, y - 36), X_AXIS, 3)
    drawing.arrow((x, y + 2), (x - 36, y + 2), Y_AXIS, 3)
    drawing.circle(x, y + 2, 7, f'fill="{CARD}" stroke="{Z_AXIS}" stroke-width="3"')
    drawing.circle(x, y + 2, 2.4, f'fill="{Z_AXIS}"')
    for words, dx, dy, anchor, colour in (
        ("x", 10, -28, "start", X_AXIS),
        ("y", -40, -8, "middle", Y_AXIS),
        ("z", 27, 7, "start", Z_AXIS),
    ):
        drawing.text(x + dx, y + dy, words, anchor, "h", f'style="fill:{colour}"')


def _enlarged_box(drawing: Drawing, x: float, y: float) -> None:
    drawing.path([f"M{number(x)} {number(y + 24)}v28"], f'fill="none" stroke="{CABLE}" stroke-width="6"')
    drawing.rectangle(
        x - 19,
        y - 30,
        38,
        54,
        f'rx="5" fill="{RECEIVER}" fill-opacity=".22" stroke="{RECEIVER}" stroke-width="2"',
    )


def _stations_list(drawing: Drawing, stations: Mapping[str, int], top: float, language: str) -> None:
    """Station numbers with their segments, in two columns."""
    for place, (segment, station) in enumerate(stations.items()):
        x, y = (18.0, 218.0)[place // 8], top + 22.0 * (place % 8)
        drawing.badge(x + 8, y, str(station))
        size = "12.5px" if language == "en" else "10.5px"
        drawing.text(x + 25, y + 4.5, segment, more=f'style="font-size:{size}"')
        if language != "en":
            words = label(f"segment-{segment}", language)
            drawing.text(x + 125, y + 4.5, words, more=f'style="font-size:11px;fill:{SOFT}"')


def which_way_picture(language: str) -> str:
    """One receiver the right way round, and three ways that are wrong."""
    name, height = "which-way-round", 262.0
    title, how = label(name, language), label(f"{name}-how", language)
    drawing = Drawing(name, title, how, _WIDTH, height, language)
    cases = (("right", 0.0, 0.0), ("turned", 180.0, 0.0), ("sideways", 90.0, 0.0), ("on-joint", 0.0, 21.0))
    width = _WIDTH / len(cases)
    for place, (_, turned_deg, along_mm) in enumerate(cases):
        middle = (place + 0.5) * width
        with drawing.clipped():
            _finger_with_receiver(drawing, middle, turned_deg, along_mm)
    with drawing.clipped():
        drawing.fade(0, 2, _WIDTH, 26, upward=True)
        drawing.fade(0, 158, _WIDTH, 26)
        drawing.rectangle(0, 183, _WIDTH, height - 183, f'fill="{CARD}"')
    for place, (case, _, _) in enumerate(cases):
        middle = (place + 0.5) * width
        drawing.tick(middle, 207, right=case == "right")
        drawing.text(middle, 238, label(f"way-{case}", language), "middle", "m")
    for place in range(1, len(cases)):
        drawing.line([(place * width, 22), (place * width, height - 22)], EDGE, 1.2)
    return drawing.svg()


def _finger_with_receiver(drawing: Drawing, middle: float, turned_deg: float, along_mm: float) -> None:
    """An index finger upright, seen from its back, with a receiver on its proximal phalanx."""
    segment = "index_proximal"
    whole = flesh_of(*posed(movements()["flat"].postures), digits=("index",))
    hand = replace(whole, parts=whole.parts[1:], joined=whole.joined[1:])
    bone = hand.at(segment, np.array([1.0, 0.0, 0.0]))[0] - hand.at(segment, np.zeros(3))[0]
    back = hand.at(segment, np.array([0.0, 0.0, 1.0]))[0] - hand.at(segment, np.zeros(3))[0]
    turned = View.seen(tuple(back), tuple(bone), 2.9, (0.0, 0.0))
    x, y = turned.px(hand.at(segment, place_mm(segment))[0])
    view = View.seen(tuple(back), tuple(bone), 2.9, (middle - x, 128.0 - y))
    HandDrawing(drawing, view, hand).draw()
    way = matrix(about_axis(np.array([0.0, 0.0, 1.0]), np.radians(turned_deg)))
    at = place_mm(segment) + np.array([along_mm, 0.0, 0.0])
    start, on = (at + way @ np.array([-d, 0.0, 0.0]) for d in (RECEIVER_MM[0] / 2, 11.0))
    if turned_deg == 0.0:
        points = [start, on, np.array([-40.0, 0.0, 8.0])]
    else:  # the cable must come back to the wrist
        points = [
            start,
            on,
            on + np.array([-7.0, 9.0, 0.0]),
            np.array([-2.0, 8.5, 8.0]),
            np.array([-40.0, 3.0, 8.0]),
        ]
    places = [view.px(hand.at(segment, point)[0]) for point in points]
    drawing.path([_smooth(places)], f'fill="none" stroke="{CABLE}" stroke-width="3"')
    box(drawing, view, hand, segment, turned_deg, along_mm)
    head, tail = (view.px(hand.at(segment, at + way @ np.array([d, 0.0, 3.0]))[0]) for d in (12.5, 0.0))
    drawing.arrow((tail[0], tail[1]), (head[0], head[1]), X_AXIS, 2.6)
    side = view.px(hand.at(segment, at + way @ np.array([0.0, 9.5, 3.0]))[0])
    drawing.arrow((tail[0], tail[1]), (side[0], side[1]), Y_AXIS, 2.6)


def side_picture(language: str) -> str:
    """A finger from its side: receivers on the bones' backs, cables with slack over the joints."""
    name, height = "receivers-from-the-side", 236.0
    title, how = label(name, language), label(f"{name}-how", language)
    drawing = Drawing(name, title, how, _WIDTH, height, language)
    bent = posture(index_mcp=16.0, index_pip=20.0, index_dip=10.0)
    hand = flesh_of(*posed(bent[None]), digits=("index",))
    view = View.seen((0, 1, 0), (0, 0, 1), 2.35, (395.0, 118.0))
    segments = ("hand", "index_proximal", "index_middle", "index_distal")
    with drawing.clipped():
        HandDrawing(drawing, view, hand, marked=[f"index_{kind}" for kind in ("mcp", "pip", "dip")]).draw()
        _slack_cables(drawing, view, hand, segments)
    for segment in segments:
        box(drawing, view, hand, segment)
    for joint, segment in (("MCP", segments[1]), ("PIP", segments[2]), ("DIP", segments[3])):
        x, y = view.px(hand.at(segment, np.array([0.0, 0.0, -22.0]))[0])
        drawing.text(x, y + 4, joint, "middle", "s")
    drawing.badge(30, height - 26, "!", ACCENT)
    drawing.text(48, height - 21, label("joint-free", language), css="m")
    drawing.text(24, 30, label("slack", language), css="m")
    return drawing.svg()


def _slack_cables(drawing: Drawing, view: View, hand: Flesh, segments: tuple[str, ...]) -> None:
    """Each receiver's cable: an arc over the joint behind it, then down to the next receiver's bone."""
    for index, segment in enumerate(segments[1:], start=1):
        x, y, z = place_mm(segment)
        points = [view.px(hand.at(segment, np.array([x - RECEIVER_MM[0] / 2, y, z]))[0])]
        for other, before in zip(segments[index:0:-1], segments[index - 1 :: -1], strict=True):
            over = hand.at(other, np.array([0.0, 0.0, 17.0 + 1.5 * index]))[0]
            points.append(view.px(over))
            end = place_mm(before) + np.array([0.0, 0.0, 1.0 + 0.9 * index])
            points.append(view.px(hand.at(before, end)[0]))
        points.append(view.px(np.array([-40.0, 0.0, 19.0 + index])))
        drawing.path([_smooth(points)], f'fill="none" stroke="{CABLE}" stroke-width="2"')
    x, y, z = place_mm("hand")
    ends = [hand.at("hand", np.array([x - RECEIVER_MM[0] / 2, y, z]))[0], np.array([-40.0, 0.0, 19.0])]
    drawing.path([_smooth([view.px(end) for end in ends])], f'fill="none" stroke="{CABLE}" stroke-width="2"')
