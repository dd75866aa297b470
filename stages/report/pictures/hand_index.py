"""A hand from its back as an index: every joint where it is, marked by whether to believe it, and a link."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from stages.report.belief import BELIEF_MARKS, BELIEVED
from stages.report.hand_motion import Chain
from stages.report.palette import BONE, SOFT
from stages.report.pictures.hand_views import Window, views_of
from stages.report.pictures.picture import Picture
from stages.report.pictures.word_places import Labels, width_in_letters
from stages.report.wording import say, word

Array = npt.NDArray[np.float64]

_WIDTH_PX, _HEIGHT_PX, _HEAD_PX, _FOOT_PX = 420.0, 400.0, 16.0, 44.0
_MARK_PX, _REACH_PX, _BONE_PX = 11.0, 9.0, 7.0


class IndexEntry(NamedTuple):
    """A joint of the index: one of BELIEFS, where its mark leads to, and what is said of it."""

    believed: str
    href: str
    words: str


def hand_index(
    title: str, hand: str, chains: Sequence[Chain], window: Window, entries: Mapping[str, IndexEntry]
) -> Markup:
    """The picture. Joints outside of the window, and those without a place, stand in a row below it."""
    view, _ = views_of(window, hand)
    scale = min(_WIDTH_PX / view.width, (_HEIGHT_PX - _HEAD_PX - _FOOT_PX) / view.height)
    foot, spare = _HEAD_PX + view.height * scale, (_WIDTH_PX - view.width * scale) / 2
    picture = Picture(title, _WIDTH_PX, foot + _FOOT_PX, role="group")
    labels = Labels(0.0, _WIDTH_PX)

    def px(places_mm: Array) -> Array:
        return np.asarray(places_mm * (scale, -scale) + (spare, foot))

    places: dict[str, tuple[float, float]] = {}
    for chain in chains:
        line = px(view.chain(chain))
        with picture.window(0.0, 0.0, _WIDTH_PX, foot):
            picture.line(line, BONE, _BONE_PX, "stroke-linecap:round")
        ends = zip(chain.names, chain.points, line.tolist(), strict=True)
        places |= {name: (x, y) for name, p, (x, y) in ends if name in entries and p and window.holds(p)}
    absent = [name for name in entries if name not in places]
    for place, name in enumerate(absent):
        places[name] = (20.0 + 24.0 * place, foot + 6.0)
    for name, (x, y) in places.items():
        entry = entries[name]
        shape, face, edge = BELIEF_MARKS[entry.believed]
        with picture.link(entry.href, entry.words):
            picture.marks(np.array([[x, y]]), "o", 2 * _REACH_PX, "transparent")
            picture.marks(np.array([[x, y]]), shape, _MARK_PX, face, edge)
    labels.avoid(places.values(), _MARK_PX / 2)
    for chain in chains:
        end = chain.points[-1]
        if end is not None and window.holds(end):
            x, y = px(view.places(end.position_mm)).tolist()
            x, y = labels.place(word(chain.digit), x, y - 12)
            picture.text(x, y, word(chain.digit), "middle", middle=True, css_class="label")
    if absent:
        words, x = say("outside the picture, or without a place"), 24.0 * len(absent) + 16
        picture.text(x, foot + 6, words, colour=SOFT, middle=True)
    _legend(picture, foot + _FOOT_PX - 12)
    return picture.markup()


def _legend(picture: Picture, y: float) -> None:
    x = 12.0
    picture.text(x, y, say("believe it?"), colour=SOFT, middle=True)
    x += 72
    for belief, (shape, face, edge) in BELIEF_MARKS.items():
        words = say(belief)[2:] + (say(", its place is known") if belief == BELIEVED else "")
        picture.marks(np.array([[x, y]]), shape, _MARK_PX, face, edge)
        picture.text(x + 10, y, words, middle=True)
        x += 32 + 5.4 * width_in_letters(words)
