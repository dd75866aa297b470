"""A small table in plain text: a title, columns with units in their names, and what it means."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

Cell = str | float | int | None

_WIDTH = 110


@dataclass(frozen=True)
class TextTable:
    """columns : name and format (as in an f-string) of each; a cell of None prints as a dash.

    meaning : what the numbers are and what they say.
    """

    title: str
    columns: tuple[tuple[str, str], ...]
    rows: Sequence[tuple[Cell, ...]]
    meaning: str

    def __str__(self) -> str:
        head = [name for name, _ in self.columns]
        body = [
            [_text(cell, form) for cell, (_, form) in zip(row, self.columns, strict=True)]
            for row in self.rows
        ]
        widths = [max(map(len, column)) for column in zip(head, *body, strict=True)]
        left = [form == "" for _, form in self.columns]
        lines = [_line(cells, widths, left) for cells in [head, ["-" * width for width in widths], *body]]
        return "\n".join([self.title, *lines, *textwrap.wrap(self.meaning, _WIDTH)])


def _text(cell: Cell, form: str) -> str:
    if cell is None:
        return "-"
    return cell if isinstance(cell, str) else format(cell, form)


def _line(cells: Sequence[str], widths: Sequence[int], left: Sequence[bool]) -> str:
    padded = [
        cell.ljust(width) if to_left else cell.rjust(width)
        for cell, width, to_left in zip(cells, widths, left, strict=True)
    ]
    return "  ".join(padded).rstrip()
