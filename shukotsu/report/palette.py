"""The report's colours: one list for digits and one for models, in pages, plots, the 3-D view and print.

The digits' hues are those of M. Okabe and K. Ito, Color Universal Design (2008), without yellow, which is too
pale on white. The models' hues were chosen by a search to be distinct from each other and from the digits'; a
test checks how distinct they are for colour-blind readers. Every hue has a value for light pages and one for
dark pages. Figures are drawn with the light values; in a page each light value is replaced by the CSS custom
property of its hue, so that pictures follow the page's theme.
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
"""Colours by name, on light pages and in print, and on dark pages; error0 to error6 are classes of errors."""

DIGIT_HUES = ("vermilion", "blue", "green", "pink", "sky")
MODEL_HUES = ("umber", "indigo", "moss", "rose", "violet", "ink", "forest")
"""Colours of models, none of which is a digit's colour."""
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
"""Markers of models and digits in order of use: matplotlib's letter, and an SVG path for the linked plots.

Together with 7 hues they distinguish 77 models.
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
"""Colours that replace the light values when a page is printed."""


class PlotMark(NamedTuple):
    """A shape (a key of MARK_PATHS) with the colours of its face and its edge."""

    shape: str
    face: str
    edge: str


class Look(NamedTuple):
    """Colour and marker of a model or digit; markers are distinct even without colour."""

    colour: str
    marker: str

    @property
    def size(self) -> float:
        """The marker's size, pt; markers with thin arms are drawn larger."""
        return 5.5 if self.marker in "PX*" else 4.0


def looks(names: Sequence[str], colours: Sequence[str]) -> dict[str, Look]:
    """Return looks by position: of a study's models in MODELS, or of a layout's digits in DIGITS.

    A model or digit has the same look in all of the study's pictures.
    """
    return {
        name: Look(colours[index % len(colours)], MARKERS[index % len(MARKERS)])
        for index, name in enumerate(names)
    }


def level_looks(levels: Iterable[str]) -> dict[str, Look]:
    """Return each level's look by its position among a factor's levels."""
    return {level: Look(look.colour, "D") for level, look in looks([*levels][::-1], DIGITS).items()}


def css() -> str:
    """Return the CSS custom properties of every page; colours have six hex digits, for viewer.js."""
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
    """Return the custom property of the hue with this light value, or another colour unchanged."""
    name = _NAMES.get(colour.lower())
    return f"var(--{name})" if name else colour


_NAMES = {light: name for name, (light, _) in HUES.items()}


def _properties(values: dict[str, str]) -> str:
    return " ".join(f"--{name}: {value};" for name, value in values.items())
