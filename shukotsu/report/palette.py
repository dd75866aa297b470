"""The report's colours: one list for digits and one for models, in pages, plots, the 3-D view and print.

The digits' hues follow M. Okabe and K. Ito, Color Universal Design (2008), without the yellow, too pale on
white; the models' were searched to be far from each other and from those; a test says how far apart they are
to colour-blind readers. Every hue has a value for a light and one for a
dark page. Print figures and page pictures are drawn with the light values; in a page every light value
becomes the CSS custom property of its hue, so a picture follows the theme.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

HUES: dict[str, tuple[str, str]] = {
    "blue": ("#0072b2", "#4b9fea"),
    "vermilion": ("#d55e00", "#f0803c"),
    "green": ("#009e73", "#2fc79a"),
    "pink": ("#cc79a7", "#e39ac4"),
    "sky": ("#56b4e9", "#b4e2ff"),
    "umber": ("#4c4135", "#7f6c33"),
    "indigo": ("#543d99", "#ad8ecc"),
    "moss": ("#54993d", "#2b9a10"),
    "rose": ("#996b82", "#b24762"),
    "violet": ("#d000d8", "#b01ee8"),
    "forest": ("#004c00", "#00e500"),
    "amber": ("#e69f00", "#e69f00"),
    "no": ("#a3123a", "#ff7d92"),
    "ink": ("#1c1d20", "#e8e8e6"),
    "soft": ("#5d6068", "#a3a7af"),
    "rule": ("#d4d5d9", "#3a3d44"),
    "shade": ("#f1f1ef", "#1f2226"),
    "paper": ("#fdfdfc", "#15171a"),
    "weak-line": ("#8a5a00", "#ffd27a"),
    "plain": ("#85888f", "#9a9da5"),
    "bone": ("#cfc9b8", "#746f63"),
    "error0": ("#1d5fa8", "#2f7fd0"),
    "error1": ("#4f97cd", "#4f98cd"),
    "error2": ("#a3c4d8", "#a3c5d8"),
    "error3": ("#f2b87c", "#f2b97c"),
    "error4": ("#dd7730", "#dd7830"),
    "error5": ("#a63a0a", "#c4501c"),
    "error6": ("#8a8d94", "#8b8d94"),
}
"""By name: the colour on a light page and in print, and on a dark page. error0 to error6: classes of mm."""

DIGIT_HUES = ("vermilion", "blue", "green", "pink", "sky")
MODEL_HUES = ("umber", "indigo", "moss", "rose", "violet", "ink", "forest")
"""Colours of models; none is a digit's colour."""
AXIS_HUES = ("vermilion", "green", "blue")
"""Colours of a receiver's x, y and z."""

MARK_PATHS = {
    "o": "M-3.2 0a3.2 3.2 0 1 0 6.4 0a3.2 3.2 0 1 0-6.4 0z",
    "s": "M-2.9-2.9h5.8v5.8h-5.8z",
    "^": "M0-3.8 3.6 2.8h-7.2z",
    "D": "M0-4.2 4.2 0 0 4.2-4.2 0z",
    "v": "M0 3.8 3.6-2.8h-7.2z",
    "P": "M-4-1h3v-3h2v3h3v2h-3v3h-2v-3h-3z",
    "X": "M-3.5-2.1-2.1-3.5 0-1.4 2.1-3.5 3.5-2.1 1.4 0 3.5 2.1 2.1 3.5 0 1.4-2.1 3.5-3.5 2.1-1.4 0z",
    "<": "M-3.8 0 2.8-3.6v7.2z",
    ">": "M3.8 0-2.8-3.6v7.2z",
    "*": "M0 -4.4L1.1 -1.5L4.2 -1.4L1.8 0.6L2.6 3.6L0 1.9L-2.6 3.6L-1.8 0.6L-4.2 -1.4L-1.1 -1.5z",
    "p": "M0 -3.8L3.6 -1.2L2.2 3.1L-2.2 3.1L-3.6 -1.2z",
}
"""Marks of models and digits, the commonest first: matplotlib's letter, and the outline of the linked plots'.
With 7 hues, 77 models differ in one or the other.
"""
MARKERS = tuple(MARK_PATHS)

INK, SOFT, RULE, PAPER, BONE, AMBER, WEAK_LINE, NO = (
    HUES[name][0] for name in ("ink", "soft", "rule", "paper", "bone", "amber", "weak-line", "no")
)
DIGITS = tuple(HUES[name][0] for name in DIGIT_HUES)
MODELS = tuple(HUES[name][0] for name in MODEL_HUES)

PRINT_ON_PAPER = {
    "paper": "#ffffff",
    "ink": "#000000",
    "soft": "#444444",
    "rule": "#bbbbbb",
    "shade": "#f4f4f4",
}
"""What a page changes on top of the light values when it is printed."""


class PlotMark(NamedTuple):
    """A shape (a key of MARK_PATHS) with the colours of its face and its edge."""

    shape: str
    face: str
    edge: str


class Look(NamedTuple):
    """One model's (or digit's) colour and marker; the markers are distinct in grey too."""

    colour: str
    marker: str

    @property
    def size(self) -> float:
        """The marker's size in pt: those with thin arms are drawn larger."""
        return 5.5 if self.marker in "PX*" else 4.0


def model_looks(names: Sequence[str]) -> dict[str, Look]:
    """Every model's look by its place in the study, the same in all pictures of it."""
    return _looks(names, MODELS)


def digit_looks(names: Sequence[str]) -> dict[str, Look]:
    """Every digit's look by its place in the layout."""
    return _looks(names, DIGITS)


def level_looks(levels: Iterable[str]) -> dict[str, Look]:
    """Every level's look by its place among a factor's."""
    return {level: Look(look.colour, "D") for level, look in digit_looks([*levels][::-1]).items()}


def css() -> str:
    """The custom properties of every page, six hexadecimal digits each (viewer.js reads them)."""
    light, dark = ({name: pair[theme] for name, pair in HUES.items()} for theme in (0, 1))
    lists = {
        f"{kind}{index}": f"var(--{hue})"
        for kind, hues in (("digit", DIGIT_HUES), ("model", MODEL_HUES), ("axis", AXIS_HUES))
        for index, hue in enumerate(hues)
    }
    return (
        f":root {{ color-scheme: light dark; {_properties(light | lists | {'accent': 'var(--blue)'})} }}\n"
        f"@media (prefers-color-scheme: dark) {{ :root {{ {_properties(dark)} }} }}\n"
        f"@media print {{ :root {{ {_properties(light | PRINT_ON_PAPER)} }} }}\n"
    )


def as_custom_property(colour: str) -> str:
    """A light value as the custom property of its hue; other colours unchanged."""
    name = _NAMES.get(colour.lower())
    return f"var(--{name})" if name else colour


_NAMES = {light: name for name, (light, _) in HUES.items()}


def _looks(names: Sequence[str], colours: Sequence[str]) -> dict[str, Look]:
    return {
        name: Look(colours[index % len(colours)], MARKERS[index % len(MARKERS)])
        for index, name in enumerate(names)
    }


def _properties(values: dict[str, str]) -> str:
    return " ".join(f"--{name}: {value};" for name, value in values.items())
