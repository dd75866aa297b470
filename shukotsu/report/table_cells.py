"""Tables of formatted cells for pages and the terminal, and relative links between pages.

All pages are in one folder, which can be copied anywhere.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from markupsafe import Markup

from shukotsu.scores.paired_statistics import LEVEL
from shukotsu.translation import N_, language, tr, translated, word

DASH = "–"


class Quantity(NamedTuple):
    """A column of numbers: its label on pages, its unit, and its number of decimals."""

    label: str
    unit: str
    decimals: int


QUANTITIES: Mapping[str, Quantity] = {
    "sd_mm": Quantity(N_("SD of the centre"), "mm", 1),
    "range_deg": Quantity(N_("Range moved"), "deg", 1),
    "gap_rms_mm": Quantity(N_("Gap (RMS)"), "mm", 2),
    "gap_rms_free_mm": Quantity(N_("Gap without plane (RMS)"), "mm", 2),
    "axis_plane_deg": Quantity(N_("Axis to plane"), "deg", 1),
    "correction_mm": Quantity(N_("Correction"), "mm", 1),
    "error_mm": Quantity(N_("True joint error"), "mm", 1),
    "true_tip_mean_mm": Quantity(N_("True fingertip error"), "mm", 1),
    "metacarpal_deg": Quantity(N_("True metacarpal direction error"), "deg", 2),
    "left_out_mean_mm": Quantity(N_("Error at left-out receivers"), "mm", 2),
    "posed_mean_mm": Quantity(N_("Posed hand to distal receivers"), "mm", 2),
    "replay_mean_mm": Quantity(N_("Tip error of the replay"), "mm", 2),
    "wrist_mcp_sd_mm": Quantity(N_("SD of wrist to MCP"), "mm", 2),
    "low_deg": Quantity(N_("2.5th percentile"), "deg", 1),
    "high_deg": Quantity(N_("97.5th percentile"), "deg", 1),
    "full_range_deg": Quantity(N_("Full range"), "deg", 1),
    "speed_median_deg_s": Quantity(N_("Median speed"), "deg/s", 1),
    "length_mm": Quantity(N_("Bone length"), "mm", 1),
    "bone_error_percent": Quantity(N_("Bone length"), "%", 2),
    "residual_mm": Quantity(N_("Residual"), "mm", 2),
    "residual_deg": Quantity(N_("Residual"), "deg", 2),
    "mean_mm": Quantity(N_("Mean"), "mm", 2),
    "median_mm": Quantity(N_("Median"), "mm", 2),
    "p95_mm": Quantity(N_("95th percentile"), "mm", 2),
    "max_mm": Quantity(N_("Max"), "mm", 2),
    "min_mm": Quantity(N_("Min"), "mm", 2),
    "n_effective": Quantity(N_("Independent samples"), "", 1),
    "speed_p95_deg_s": Quantity(N_("Speed, 95th percentile"), "deg/s", 1),
    "valid_percent": Quantity(N_("Valid"), "%", 1),
    "duration_s": Quantity(N_("Duration"), "s", 2),
    "n_frames": Quantity(N_("Frames"), "", 0),
}
"""How pages, figures and the terminal format numbers, by a table's column; it is defined only here."""


MEANINGS: Mapping[str, str] = {
    "sd_mm": N_("1-sigma error of the joint's centre in three dimensions, including skin motion"),
    "range_deg": N_("angle moved in the calibration; below 10 deg the position is poorly determined"),
    "gap_rms_mm": N_("distance between the two estimates of the centre, from the receivers on either side"),
    "gap_rms_free_mm": N_(
        "gap of the best fit without plane and correction; if far below the gap, these displaced the joint"
    ),
    "axis_plane_deg": N_("angle between axis and plane; near 0 the centre can slide along the axis"),
    "correction_mm": N_("distance by which the centre was moved by hand"),
    "replay_mean_mm": N_("distance from the replayed fingertip to its receiver; no criterion for a skeleton"),
    "posed_mean_mm": N_("distance of the fitted hand from its fingertip receivers, which the fit used"),
    "left_out_mean_mm": N_(
        "distance from a fingertip receiver left out of the fit to its position predicted by the others"
    ),
    "wrist_mcp_sd_mm": N_("variation of the length from wrist to MCP joint; constant in the true skeleton"),
    "n_effective": N_("number of independent frames that the recording provides for this joint"),
    "residual_mm": N_("distance between a receiver's measured and fitted position"),
    "residual_deg": N_("angle between a receiver's measured and fitted orientation"),
}
_TERMS: Mapping[str, str] = {
    "prior-only": N_("the hand expected from anatomy alone; a skeleton should be more accurate"),
    "distal-receiver": N_("the fingertip assumed to be at its receiver; a skeleton should be more accurate"),
    "true-skeleton": N_("the true skeleton of the simulated hand; its errors are those of skin and tracker"),
    N_("Held out"): N_("whether the skeleton was made without the scored task; compare models by these rows"),
    N_("Came loose"): N_("frame from which on the receiver was displaced on its bone"),
}
"""Meanings of quantities and of other words in tables, in one sentence each."""


@lru_cache
def _meanings(_: str) -> Mapping[str, str]:
    """Return the English meanings of headings and other words by their form in the language in use."""
    of_headings = {heading(name): text for name, text in MEANINGS.items()}
    return of_headings | {tr(name): text for name, text in _TERMS.items()}


def heading(name: str) -> str:
    """Return a quantity's label with its unit."""
    quantity = QUANTITIES[name]
    return tr(quantity.label) + (f" [{quantity.unit}]" if quantity.unit else "")


def format_value(name: str, value: float | None) -> str:
    """Return a quantity's value with its number of decimals, or a dash if it is None or NaN."""
    return number(value, QUANTITIES[name].decimals)


@dataclass(frozen=True)
class RowBlock:
    """Rows with a common header; the first column contains the rows' headings."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class DataTable:
    """A captioned table of one or more blocks.

    text_columns : indices of columns with text; the others contain numbers. source : the table of the results
    that it is made from, if there is one.
    """

    caption: str
    blocks: tuple[RowBlock, ...]
    notes: tuple[str, ...] = ()
    text_columns: frozenset[int] = frozenset({0})
    source: str = ""

    @property
    def meanings(self) -> dict[str, str]:
        """Meanings of those headings and row headings that need explanation."""
        cells = [cell for block in self.blocks for cell in (*block.header, *(row[0] for row in block.rows))]
        texts = _meanings(language())
        return {cell: tr(texts[cell]) for cell in dict.fromkeys(cells) if cell in texts}


@dataclass(frozen=True)
class Folded:
    """A table that is folded under a summary line."""

    summary: str
    table: DataTable


class PageColumn(NamedTuple):
    """A column of a table: its heading, and the function that returns a row's cell as text."""

    heading: str
    cell: Callable[[Any], str]
    is_text: bool = False


def quantity_column(name: str) -> PageColumn:
    """Return the column of a quantity."""
    return PageColumn(heading(name), lambda row: format_value(name, row.get(name)))


def number_column(heading: str, name: str, decimals: int = 2) -> PageColumn:
    """Return the column of the numbers `name` in the rows, with a dash if a row has none."""
    return PageColumn(heading, lambda row: number(row.get(name), decimals))


def error_column(heading: str, name: str, unit: str, decimals: int = 1) -> PageColumn:
    """Return the column of the numbers `name_unit` with their 1-sigma errors, `name_sd_unit`."""
    return PageColumn(
        heading, lambda row: with_error(row[f"{name}_{unit}"], row[f"{name}_sd_{unit}"], decimals)
    )


def text_column(heading: str, name: str) -> PageColumn:
    """Return the column of the texts `name` in the rows; sentences and the project's words are translated."""
    in_words = _TRANSLATIONS.get(name, str)
    return PageColumn(heading, lambda row: in_words(row[name]), is_text=True)


_TRANSLATIONS: Mapping[str, Callable[[str], str]] = {
    "message": translated,
    **dict.fromkeys(("hand", "digit", "angle", "binding"), word),
}
"""Translations of columns that contain sentences or words of this project."""


def table_of(
    caption: str,
    columns: Sequence[PageColumn],
    rows: Iterable[Any] | Mapping[str, Sequence[Any]],
    if_empty: str = "",
    notes: Iterable[str] = (),
    source: str = "",
) -> DataTable:
    """Return a table of one block, or, if `rows` is a mapping, of one block per heading that has rows.

    if_empty : note for a table without rows.
    """
    groups = rows if isinstance(rows, Mapping) else {columns[0].heading: list(rows)}
    blocks = tuple(
        RowBlock(
            (heading, *(column.heading for column in columns[1:])),
            tuple(tuple(column.cell(row) for column in columns) for row in group),
        )
        for heading, group in groups.items()
        if group or groups is not rows
    )
    empty = (if_empty,) if if_empty and not any(groups.values()) else ()
    texts = frozenset(index for index, column in enumerate(columns) if column.is_text)
    return DataTable(caption, blocks, (*empty, *notes), texts, source)


def number(value: float | None, decimals: int = 2) -> str:
    """Return a number with a fixed number of decimals, or a dash if it is None or NaN."""
    if value is None or value != value:
        return DASH
    return f"{value:z.{decimals}f}"


def with_error(value: float | None, sd: float | None, decimals: int = 2) -> str:
    """Return a number, with its 1-sigma error if both are known."""
    error = f" ± {number(sd, decimals)}" if value is not None and sd is not None else ""
    return number(value, decimals) + error


def p_text(p: float) -> str:
    """Return p with two digits, or as many as needed to stay on the same side of LEVEL."""
    if p < 0.0001:
        return "p < 0.0001"
    texts = (f"{p:.{digits}g}" for digits in range(2, 17))
    return "p = " + next(text for text in texts if (float(text) <= LEVEL) == (p <= LEVEL))


def alike(values: Mapping[str, object]) -> list[list[str]]:
    """Group names with equal values, in order."""
    groups: list[list[str]] = []
    for name, value in values.items():
        same = next((group for group in groups if values[group[0]] == value), None)
        groups.append([name]) if same is None else same.append(name)
    return groups


def capital(text: str) -> str:
    """Return text with a capital first letter."""
    return text[:1].upper() + text[1:]


def title(name: str) -> str:
    """Return the name of a digit or hand as a heading."""
    return capital(word(name).replace("_", " "))


class Link(NamedTuple):
    """A link's text, and its target relative to the page."""

    words: str
    href: str


def link(words: str, page: Path, target: Path) -> Link:
    """Return a link on a page to another page of the report."""
    return Link(words, quote(Path(os.path.relpath(target, page.parent)).as_posix()))


def anchor(to: Link) -> Markup:
    """Return the link as HTML with its text escaped."""
    return Markup('<a href="{}">{}</a>').format(to.href, to.words)
