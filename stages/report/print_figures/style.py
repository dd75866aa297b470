"""How every picture looks: sizes, fonts, lines. A journal that wants it otherwise changes this and the
palette.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import matplotlib
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stages.report.palette import INK, RULE, SOFT

ONE_COLUMN_MM, TWO_COLUMNS_MM = 85.0, 175.0
LARGE_PT, SMALL_PT = 8.0, 7.0

FONT = "DejaVu Sans"
FONTS_FOR_OTHER_SCRIPTS = (
    "Noto Sans CJK JP",
    "Noto Sans JP",
    "IPAexGothic",
    "IPAGothic",
    "Source Han Sans JP",
    "Yu Gothic",
    "Hiragino Sans",
    "MS Gothic",
    "Noto Sans CJK SC",
    "Microsoft YaHei",
    "WenQuanYi Zen Hei",
)
"""Used where they are installed, for characters that FONT does not have."""

STYLE: dict[str, Any] = {
    "font.size": LARGE_PT,
    "axes.labelsize": LARGE_PT,
    "axes.titlesize": LARGE_PT,
    "axes.titlepad": 3.0,
    "axes.labelpad": 2.0,
    "axes.linewidth": 0.6,
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": RULE,
    "grid.linewidth": 0.5,
    "xtick.labelsize": SMALL_PT,
    "ytick.labelsize": SMALL_PT,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.minor.size": 0.0,
    "ytick.minor.size": 0.0,
    "lines.linewidth": 0.8,
    "lines.markersize": 4.0,
    "legend.fontsize": SMALL_PT,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "legend.columnspacing": 1.2,
    "figure.constrained_layout.h_pad": 0.03,
    "figure.constrained_layout.w_pad": 0.03,
    "hatch.linewidth": 0.6,
    "path.simplify_threshold": 0.1,  # pt
    "text.parse_math": False,  # a name may hold $, \ and _
    "svg.fonttype": "none",
    "svg.hashsalt": "shukotsu",
    "pdf.fonttype": 42,
}
"""Settings of matplotlib, on top of its own defaults; a user's matplotlibrc has no say."""


@contextmanager
def applied(settings: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Draw and save in this style, `settings` on top, and leave matplotlib's settings as they were."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        all_settings: Any = {**STYLE, "font.family": [FONT, *_installed()], **(settings or {})}
        matplotlib.rcParams.update(all_settings)
        yield


def new_figure(width_mm: float, height_mm: float) -> Figure:
    """An empty figure of exactly that size, which makes room for its labels itself."""
    return Figure(figsize=(width_mm / 25.4, height_mm / 25.4), layout="constrained")


def stacked(figure: Figure, n: int, **settings: Any) -> list[Axes]:
    """That many panels, one above the other."""
    return list(figure.subplots(n, 1, squeeze=False, **settings)[:, 0])


def headings(panels: Sequence[Axes], words: Sequence[str]) -> None:
    """Every panel's letter, where there are several, and at its right end what is to be said of it."""
    for axes, letter, own in zip(panels, letters(len(panels)), words, strict=True):
        axes.set_title(letter, loc="left", fontweight="bold")
        axes.set_title(own, loc="right", fontsize=SMALL_PT)


def letters(n: int) -> list[str]:
    """What n panels are called: a to z, then aa and on; one alone has no name."""
    names = [*ascii_lowercase, *(a + b for a in ascii_lowercase for b in ascii_lowercase)]
    return names[:n] if n > 1 else [""]


def lettered(sentences: Sequence[str]) -> str:
    """A caption's sentences about the panels, each after its panel's letter."""
    names = letters(len(sentences))
    return " ".join(f"({name}) {own}" if name else own for name, own in zip(names, sentences, strict=True))


def label(text: str) -> str:
    """The text as the fonts at hand can write it; a character that none has becomes its code in ASCII."""
    known = _characters()
    return "".join(c if c.isprintable() and ord(c) in known else _code(c) for c in text)


def _code(character: str) -> str:
    number = ord(character)
    return (
        f"\\x{number:02x}"
        if number < 0x100
        else f"\\u{number:04x}"
        if number < 0x10000
        else f"\\U{number:08x}"
    )


@cache
def _installed() -> tuple[str, ...]:
    """Fonts for other scripts that are there as TrueType files; others cannot go into a PDF as TrueType."""
    fonts = font_manager.fontManager.ttflist
    names = {entry.name for entry in fonts if Path(entry.fname).suffix.lower() == ".ttf"}
    return tuple(name for name in FONTS_FOR_OTHER_SCRIPTS if name in names)


@cache
def _characters() -> frozenset[int]:
    """Code points that some font in use has."""
    found: set[int] = set()
    for name in (FONT, *_installed()):
        found |= font_manager.get_font(font_manager.findfont(name)).get_charmap().keys()
    return frozenset(found)
