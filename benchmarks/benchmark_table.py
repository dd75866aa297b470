"""A small table in plain text, and the pages of the guide that hold such tables."""

from __future__ import annotations

import os
import platform
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from schemas.files import write_text
from schemas.marked_text import replaced_between

Cell = str | float | int | None

DOCS = Path(__file__).resolve().parents[1] / "docs"
START, END = "<!-- tables: start -->", "<!-- tables: end -->"
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
        aligns = ["<" if form == "" else ">" for _, form in self.columns]
        lines = [
            "  ".join(f"{c:{a}{w}}" for c, a, w in zip(cells, aligns, widths, strict=True)).rstrip()
            for cells in [head, ["-" * width for width in widths], *body]
        ]
        return "\n".join([self.title, *lines, *textwrap.wrap(self.meaning, _WIDTH)])


def _text(cell: Cell, form: str) -> str:
    if cell is None:
        return "-"
    return cell if isinstance(cell, str) else format(cell, form)


def write_tables(page: str, tables: Sequence[TextTable], command: str) -> None:
    """Put the tables of a command into docs/PAGE between its marks, with the machine that they are of."""
    path = DOCS / page
    blocks = [f"As printed by `{command}` on {machine()}."]
    blocks += [f"```text\n{table}\n```" for table in tables]
    write_text(path, replaced_between(path.read_text("utf-8"), START, END, "\n\n".join(blocks)))


def machine() -> str:
    """Name this machine: cores, processor, memory, system, Python and packages."""
    memory_kb = _entry("/proc/meminfo", "MemTotal").removesuffix(" kB")
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "pyarrow", "scipy", "snakemake"))
    return (
        f"{os.cpu_count()} cores of {_entry('/proc/cpuinfo', 'model name') or platform.processor()}, "
        f"{round(int(memory_kb or 0) / 1e6) or '?'} GB, {platform.system()} {platform.release()}, "
        f"Python {platform.python_version()}, {packages}"
    )


def _entry(file: str, name: str) -> str:
    """The first value of that name in a file of `name : value` lines; empty where there is none."""
    path = Path(file)
    lines = path.read_text("utf-8").splitlines() if path.is_file() else []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(name)), "")
