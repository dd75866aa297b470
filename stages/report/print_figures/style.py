"""How every figure looks: sizes, fonts, lines, and the marks that several have.

A journal that wants it otherwise changes this and the palette.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from string import ascii_lowercase
from textwrap import wrap
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from schemas.errors import InputError
from stages.report.palette import INK, RULE, SOFT, Look
from stages.report.pictures.scale import Scale, plain
from stages.report.pictures.word_places import width_in_letters
from stages.report.wording import ENGLISH, catalogue_of, language

Array = npt.NDArray[np.float64]

_LOG_RATIO = 20.0
_GOLDEN = (5**0.5 - 1) / 2
FEWEST_FOR_QUARTILES = 4
MANY = 40

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
        all_settings: Any = {**STYLE, **_fonts(), **(settings or {})}
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
        axes.set_title(letter, loc="left", fontweight="bold" if language() == ENGLISH else "normal")
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
    known = _characters(language())
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


def wrapped(text: str, width: int) -> list[str]:
    """Lines of at most so many Latin letters, as the fonts at hand can write them."""
    return wrap(label(text), width if width_in_letters(text) < 1.5 * len(text) else width // 2)


def font_of(own: str) -> Path | None:
    """The file of the first installed font that writes a language; None where there is none."""
    found = _first_font(catalogue_of(own).fonts)
    if found is None and _seek_fonts():
        found = _first_font(catalogue_of(own).fonts)
    return found


def _first_font(names: Sequence[str]) -> Path | None:
    files = {entry.name: Path(entry.fname) for entry in reversed(font_manager.fontManager.ttflist)}
    return next((files[name] for name in names if name in files), None)


@cache
def _seek_fonts() -> int:
    """Add fonts that were installed after matplotlib wrote down its list; how many."""
    known = {entry.fname for entry in font_manager.fontManager.ttflist}
    new = [path for path in font_manager.findSystemFonts() if path not in known]
    for path in new:
        with suppress(OSError, RuntimeError):  # a file that is no font that can be drawn
            font_manager.fontManager.addfont(path)
    return len(new)


def check_font(own: str) -> None:
    """Raise InputError where no font is installed that writes the language of the figures."""
    if own == ENGLISH or font_of(own) is not None:
        return
    raise InputError(
        f"language: {own}: its figures need a font, and none of {', '.join(catalogue_of(own).fonts)} is "
        "installed; install one (on Debian and Ubuntu: sudo apt-get install fonts-ipaexfont-gothic) or leave "
        "the key language out of the study file"
    )


def _fonts() -> dict[str, Any]:
    """Settings of fonts: first that of the language spoken. Only a TrueType file goes into a PDF as such."""
    font = None if language() == ENGLISH else font_of(language())
    if font is None:
        return {"font.family": [FONT, *_installed()]}
    name = font_manager.get_font(font).family_name
    return {"font.family": [name, FONT, *_installed()], "pdf.fonttype": 42 if font.suffix == ".ttf" else 3}


@cache
def _installed() -> tuple[str, ...]:
    """Fonts for other scripts that are there as TrueType files; others cannot go into a PDF as TrueType."""
    fonts = font_manager.fontManager.ttflist
    names = {entry.name for entry in fonts if Path(entry.fname).suffix.lower() == ".ttf"}
    return tuple(name for name in FONTS_FOR_OTHER_SCRIPTS if name in names)


@cache
def _characters(own: str) -> frozenset[int]:
    """Code points that some font in use has."""
    found: set[int] = set()
    files = [Path(font_manager.findfont(name)) for name in (FONT, *_installed())]
    for file in (*files, *([] if own == ENGLISH else filter(None, [font_of(own)]))):
        found |= font_manager.get_font(file).get_charmap().keys()
    return frozenset(found)


def dots(axes: Axes, x: Array, y: Array, colour: str) -> None:
    """Translucent round dots at x, y, each (n,), smaller where they are many."""
    size = 3.4 if len(x) <= MANY else 2.0
    axes.plot(x, y, "o", color=colour, alpha=0.6, markersize=size, markeredgewidth=0.0, clip_on=False)


def scattered(n: int, width: float) -> Array:
    """Steps aside (n,) within `width`, even and the same every time."""
    return np.asarray(((np.arange(n) * _GOLDEN) % 1.0 - 0.5) * width)


def summary(axes: Axes, x: float, values: Array, look: Look, width: float) -> None:
    """The median as the model's mark and, from FEWEST_FOR_QUARTILES on, the quartiles as a bar."""
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
    if len(values) >= FEWEST_FOR_QUARTILES:
        axes.plot([x, x], [low, high], color=look.colour, linewidth=1.4, solid_capstyle="butt")
    axes.plot(
        [x], [middle], look.marker, color=look.colour, markersize=width, markeredgecolor="white",
        markeredgewidth=0.5, linestyle="none",
    )  # fmt: skip


def error_axis(axes: Axes, values: Iterable[Array]) -> None:
    """The vertical axis from zero, or logarithmic where the largest would flatten a group of the others."""
    groups = [part for part in values if part.size]
    low, high = min(float(part.min()) for part in groups), max(float(part.max()) for part in groups)
    dwarfed = low > 0 and high > _LOG_RATIO * min(float(np.median(part)) for part in groups)
    scale = Scale(low / 1.25, high * 1.25, "log") if dwarfed else Scale(0.0, high * 1.06 or 1.0)
    vertical_axis(axes, scale, 6)


def vertical_axis(axes: Axes, scale: Scale, most_ticks: int) -> None:
    """Give the vertical axis the scale, with ticks at plain numbers and a grid."""
    axes.set_yscale(scale.kind)
    axes.set_ylim(scale.low, scale.high)
    ticks = scale.ticks(most_ticks)
    axes.set_yticks(ticks, [plain(tick) for tick in ticks])
    axes.yaxis.set_minor_locator(NullLocator())
    axes.grid(axis="y", clip_on=False)


def model_handles(looks: Mapping[str, Look], names: Sequence[str]) -> list[Line2D]:
    """Entries of a legend: a mark a model."""
    return [
        Line2D(
            [], [], color=looks[name].colour, marker=looks[name].marker, linestyle="none", label=label(name)
        )
        for name in names
    ]


def columns_for(n_lines: int) -> int:
    """Pixel columns that each of so many lines may take, so that the file stays small."""
    return max(90, min(420, 5500 // max(1, n_lines)))
