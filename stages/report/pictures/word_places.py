"""Words in a picture, placed so that none lies on another."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from unicodedata import east_asian_width

LETTER_PX, LINE_PX = 6.2, 12.0
"""About as large as a letter and a line of a picture's text are."""

_STEPS = tuple(
    sorted(
        ((dx * 8.0, dy * 6.0) for dx in range(-3, 4) for dy in range(-6, 3)),
        key=lambda step: (abs(step[0]) + abs(step[1]), step[1], step[0]),
    )
)
"""How far words may be moved from where they are wanted: the nearest first, up before down."""

Box = tuple[float, float, float, float]
"""Left, top, right and lower edge, px."""


@dataclass
class Labels:
    """The places taken in a picture between `left` and `right`, below `top`, px."""

    left: float
    right: float
    top: float = 0.0
    taken: list[Box] = field(default_factory=list)

    def avoid(self, points: Iterable[tuple[float, float]], reach: float) -> None:
        """Keep words off marks that reach so far about these points."""
        self.taken += [(x - reach, y - reach, x + reach, y + reach) for x, y in points]

    def place(self, words: str, x: float, y: float, anchor: str = "middle") -> tuple[float, float]:
        """The nearest free place to (x, y), the middle of the words' line; where none is free, (x, y)."""
        width = LETTER_PX * width_in_letters(words)
        start = {"start": 0.0, "middle": -width / 2, "end": -width}[anchor]
        for dx, dy in _STEPS:
            box = (x + dx + start, y + dy - LINE_PX / 2, x + dx + start + width, y + dy + LINE_PX / 2)
            inside = box[0] >= self.left and box[2] <= self.right and box[1] >= self.top
            if inside and not any(_overlap(box, other) for other in self.taken):
                self.taken.append(box)
                return x + dx, y + dy
        return x, y


def width_in_letters(words: str) -> int:
    """How many Latin letters a text is wide: a Chinese or Japanese one is twice as wide."""
    return sum(2 if east_asian_width(letter) in "WF" else 1 for letter in words)


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
