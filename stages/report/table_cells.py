"""A table as the page and the terminal show it: text cells, ready to be laid out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from shukotsu.sentences.translation import N_, tr, translated, word
from shukotsu.statistics.paired_statistics import LEVEL

DASH = "–"


class Quantity(NamedTuple):
    """What a column of numbers is called on pages, its unit, and with how many decimals it is shown."""

    label: str
    unit: str
    decimals: int


QUANTITIES: Mapping[str, Quantity] = {
    "sd_mm": Quantity(N_("SD of the centre"), "mm", 2),
    "range_deg": Quantity(N_("Moved"), "deg", 1),
    "gap_rms_mm": Quantity(N_("Gap rms"), "mm", 2),
    "gap_rms_free_mm": Quantity(N_("Free gap rms"), "mm", 2),
    "axis_plane_deg": Quantity(N_("Axis to plane"), "deg", 1),
    "correction_mm": Quantity(N_("Correction"), "mm", 1),
    "error_mm": Quantity(N_("Joint against the truth"), "mm", 2),
    "true_tip_mean_mm": Quantity(N_("Fingertip against the truth"), "mm", 2),
    "metacarpal_deg": Quantity(N_("Metacarpal direction against the truth"), "deg", 2),
    "left_out_mean_mm": Quantity(N_("Distal receivers left out"), "mm", 2),
    "posed_mean_mm": Quantity(N_("Posed hand to distal receivers"), "mm", 2),
    "replay_mean_mm": Quantity(N_("Tip error of the replay"), "mm", 2),
    "wrist_mcp_sd_mm": Quantity(N_("SD of wrist to MCP"), "mm", 2),
    "speed_p95_deg_s": Quantity(N_("Speed, 95 %"), "deg/s", 1),
    "valid_percent": Quantity(N_("Valid"), "%", 1),
    "duration_s": Quantity(N_("Duration"), "s", 2),
    "n_frames": Quantity(N_("Frames"), "", 0),
}
"""By the column of a table: the one place that says how pages, figures and the terminal write a number."""


def heading(name: str) -> str:
    """Return a quantity's label with its unit."""
    quantity = QUANTITIES[name]
    return tr(quantity.label) + (f" [{quantity.unit}]" if quantity.unit else "")


def shown(name: str, value: float | None) -> str:
    """Return a value of a quantity with its decimals; a dash where there is none."""
    return number(value, QUANTITIES[name].decimals)


@dataclass(frozen=True)
class Block:
    """Rows under one header; the first cell of the header and of every row is their heading."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class DataTable:
    """A captioned table of one block or more; columns are numbers except those named in text_columns."""

    caption: str
    blocks: tuple[Block, ...]
    notes: tuple[str, ...] = ()
    text_columns: frozenset[int] = frozenset({0})


@dataclass(frozen=True)
class Folded:
    """A table that is folded away under a summary line."""

    summary: str
    table: DataTable


class Column(NamedTuple):
    """A column of a table made row by row: its heading, and the text of its cell in a row."""

    heading: str
    cell: Callable[[Any], str]
    is_text: bool = False


def quantity_column(name: str) -> Column:
    """The numbers of a quantity under its heading."""
    return Column(heading(name), lambda row: shown(name, row.get(name)))


def number_column(heading: str, name: str, decimals: int = 2) -> Column:
    """The numbers of that name in the rows; a dash where there is none."""
    return Column(heading, lambda row: number(row.get(name), decimals))


def text_column(heading: str, name: str) -> Column:
    """The text of that name in the rows."""
    return Column(heading, lambda row: _text(name, row[name]), is_text=True)


def _text(column: str, text: str) -> str:
    """A table's text as a page shows it: what is a name stays."""
    if column in _SENTENCES:
        return translated(text)
    return word(text) if column in _NAMES else text


_SENTENCES = frozenset({"message", "question", "test"})
_NAMES = frozenset({"hand", "digit", "angle", "binding", "across", "Hand"})
"""Columns of tables whose texts are sentences, and whose texts are names of the project."""


def table_of(caption: str, columns: Sequence[Column], rows: Iterable[Any], if_empty: str = "") -> DataTable:
    """A table of one block; a note says what `if_empty` says where there is no row."""
    rows = list(rows)
    notes = (if_empty,) if if_empty and not rows else ()
    return DataTable(caption, (_block(columns[0].heading, columns, rows),), notes, _texts(columns))


def table_of_blocks(
    caption: str, columns: Sequence[Column], blocks: Mapping[str, Sequence[Any]], notes: Iterable[str] = ()
) -> DataTable:
    """A table of a block for each heading that has rows; the heading stands over the first column."""
    made = (_block(heading, columns, rows) for heading, rows in blocks.items() if rows)
    return DataTable(caption, tuple(made), tuple(notes), _texts(columns))


def _block(heading: str, columns: Sequence[Column], rows: Iterable[Any]) -> Block:
    header = (heading, *(column.heading for column in columns[1:]))
    return Block(header, tuple(tuple(column.cell(row) for column in columns) for row in rows))


def _texts(columns: Sequence[Column]) -> frozenset[int]:
    return frozenset(place for place, column in enumerate(columns) if column.is_text)


def number(value: float | None, decimals: int = 2) -> str:
    """The number with so many decimals; a dash where there is none."""
    if value is None or value != value:
        return DASH
    return f"{value:.{decimals}f}".replace("-0." + "0" * decimals, "0." + "0" * decimals)


def p_text(p: float) -> str:
    """The test's p with two digits, or as many as it takes to stay on its side of LEVEL."""
    if p < 0.0001:
        return "p < 0.0001"
    texts = (f"{p:.{digits}g}" for digits in range(2, 17))
    return "p = " + next(text for text in texts if (float(text) <= LEVEL) == (p <= LEVEL))


def alike(values: Mapping[str, object]) -> list[list[str]]:
    """Names in groups of equal values, in their order."""
    groups: list[list[str]] = []
    for name, value in values.items():
        same = next((group for group in groups if values[group[0]] == value), None)
        groups.append([name]) if same is None else same.append(name)
    return groups


def capital(text: str) -> str:
    """The text with a capital first letter."""
    return text[:1].upper() + text[1:]


def title(name: str) -> str:
    """The name of a digit or a hand as a heading."""
    return capital(word(name).replace("_", " "))
