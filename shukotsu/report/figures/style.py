"""Style of all pictures: sizes, fonts and lines.

To follow a journal's style, change this module and the palette.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from textwrap import wrap
from typing import Any
from unicodedata import category, east_asian_width

import matplotlib
from matplotlib import font_manager
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter

from shukotsu.report.palette import INK, RULE, SOFT
from shukotsu.report.templates import translations_of
from shukotsu.translation import ENGLISH, N_, language, punctuated

ONE_COLUMN_MM, TWO_COLUMNS_MM = 85.0, 175.0
SMALL_PT = 7.0

FONT = N_("DejaVu Sans")
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
"""Fonts that are used, if installed, for characters that FONT lacks."""

STYLE: dict[str, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.titlepad": 3.0,
    "axes.titley": 1.0,  # avoids measuring all tick labels to place the title
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
    "axes.facecolor": "none",
    "grid.color": RULE,
    "grid.linewidth": 0.5,
    "xtick.labelsize": SMALL_PT,
    "ytick.labelsize": SMALL_PT,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "lines.linewidth": 0.8,
    "lines.markersize": 4.0,
    "legend.fontsize": SMALL_PT,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "legend.columnspacing": 1.2,
    "hatch.linewidth": 0.6,
    "path.simplify_threshold": 0.1,  # pt
    "text.parse_math": False,  # a name may hold $, \ and _
    "svg.fonttype": "none",
    "svg.hashsalt": "shukotsu",
}
"""Changes to matplotlib's default settings; a user's matplotlibrc is ignored."""


@contextmanager
def apply_style(settings: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Use this style with additional `settings` in the block; restore matplotlib's settings afterwards."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        all_settings: Any = {**STYLE, **_fonts(), **(settings or {})}
        matplotlib.rcParams.update(all_settings)
        yield


def label(text: str) -> str:
    """Return text with each character that no available font has replaced by its code in ASCII.

    Text in a language without an available font is drawn only on pages, where the reader's browser has a
    font, and is left unchanged.
    """
    text = punctuated(text)
    if print_language(language()) != language():
        return without_controls(text)
    drawable = _characters(language())
    return "".join(c if c.isprintable() and ord(c) in drawable else _code(c) for c in text)


def without_controls(text: str) -> str:
    """Return text with control characters, which XML does not allow, replaced by their codes."""
    return "".join(_code(c) if category(c) in ("Cc", "Cs") else c for c in text)


def rewrite(figure: Figure, writable: Callable[[str], str]) -> None:
    """Apply `writable` to each line of every text in a figure."""
    children = [part for axes in figure.axes for part in axes.get_children()]
    artists = [*figure.texts, *figure.legends, *children]
    for axis in [artist for artist in artists if isinstance(artist, Axis)]:
        artists.remove(axis)  # its ticks are made by the formatter when drawn
        artists.append(axis.label)
        formatter = axis.get_major_formatter()
        if isinstance(formatter, FixedFormatter):
            formatter.seq = [_by_line(words, writable) for words in formatter.seq]
    for text in (text for artist in artists for text in artist.findobj(Text)):
        assert isinstance(text, Text)
        text.set_text(_by_line(text.get_text(), writable))


def _by_line(text: str, writable: Callable[[str], str]) -> str:
    return "\n".join(map(writable, text.split("\n")))


def _code(character: str) -> str:
    return (
        character.encode("unicode_escape").decode() if ord(character) > 0x7F else f"\\x{ord(character):02x}"
    )


def width_mm(words: str) -> float:
    """Return the approximate width of text in the small font; East Asian characters are twice as wide."""
    return 0.22 * SMALL_PT * sum(2 if east_asian_width(letter) in "WF" else 1 for letter in words)


def wrap_text(text: str, width: int) -> list[str]:
    """Wrap text, with characters that no font has replaced, to lines of at most `width` Latin letters."""
    latin = width_mm(text) < 1.5 * width_mm("m") * len(text)
    return wrap(label(text), width if latin else width // 2, break_on_hyphens=False)


def _fonts_of(name: str) -> list[str]:
    """Return the fonts for a language, best first, from its catalogue's translation of DejaVu Sans."""
    return translations_of(name).gettext(FONT).split(", ")


def font_of(name: str) -> Path | None:
    """Return the file of the first installed font for a language, or None."""

    def first() -> Path | None:
        files = {entry.name: Path(entry.fname) for entry in reversed(font_manager.fontManager.ttflist)}
        return next((files[font] for font in _fonts_of(name) if font in files), None)

    return first() or (first() if _seek_fonts() else None)


@cache
def _seek_fonts() -> int:
    """Add fonts that were installed after matplotlib cached its list; return how many."""
    listed = {entry.fname for entry in font_manager.fontManager.ttflist}
    new = [path for path in font_manager.findSystemFonts() if path not in listed]
    for path in new:
        with suppress(OSError, RuntimeError):  # not a usable font file
            font_manager.fontManager.addfont(path)
    return len(new)


def print_language(name: str) -> str:
    """Return the language of figures for print: English if no font for the study's language is installed."""
    return ENGLISH if name == ENGLISH or font_of(name) is None else name


def font_note(name: str) -> str:
    """Return a sentence that states why figures for print are in English, or an empty string."""
    if print_language(name) == name:
        return ""
    return (
        f"language: {name}: none of the fonts {', '.join(_fonts_of(name))} is installed, so figures for "
        "print are in English; install one (on Debian and Ubuntu: sudo apt-get install "
        "fonts-ipaexfont-gothic)"
    )


def _fonts() -> dict[str, Any]:
    """Return settings of fonts, those for the page's language first; PDFs can embed only TrueType files."""
    font = None if language() == ENGLISH else font_of(language())
    names = [] if font is None else [font_manager.get_font(font).family_name]
    embedded = font is None or font.suffix == ".ttf"
    return {"font.family": [*names, FONT, *_installed_fonts()], "pdf.fonttype": 42 if embedded else 3}


@cache
def _installed_fonts() -> tuple[str, ...]:
    """Return fonts for other scripts that are installed as TrueType files, which PDFs can embed."""
    fonts = font_manager.fontManager.ttflist
    names = {entry.name for entry in fonts if Path(entry.fname).suffix.lower() == ".ttf"}
    return tuple(name for name in FONTS_FOR_OTHER_SCRIPTS if name in names)


@cache
def _characters(name: str) -> frozenset[int]:
    """Return the code points that are in any of the fonts in use."""
    files = [Path(font_manager.findfont(font)) for font in (FONT, *_installed_fonts())]
    if name != ENGLISH and (font := font_of(name)):
        files.append(font)
    return frozenset[int]().union(*(font_manager.get_font(file).get_charmap().keys() for file in files))
