"""A table as the page and the terminal show it: text cells, ready to be laid out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

DASH = "–"


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


def number(value: float | None, decimals: int = 2) -> str:
    """The number with so many decimals; a dash where there is none."""
    if value is None or value != value:
        return DASH
    return f"{value:.{decimals}f}".replace("-0." + "0" * decimals, "0." + "0" * decimals)


def listed(words: Iterable[str]) -> str:
    """Words as a sentence lists them: a, b and c."""
    words = list(words)
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def counted(count: int, word: str) -> str:
    """The count with its word: 1 joint, 2 joints."""
    return f"{count} {word}{'' if count == 1 else 's'}"
