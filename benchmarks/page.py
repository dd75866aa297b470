"""Pages of the guide: prose that stays, tables between two marks that a command makes anew."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.text_table import TextTable
from schemas.errors import InputError
from schemas.files import write_text

DOCS = Path(__file__).resolve().parents[1] / "docs"
START, END = "<!-- tables: start -->", "<!-- tables: end -->"


def write_tables(name: str, made: Sequence[TextTable], heads: Sequence[str]) -> None:
    """Put the tables into docs/NAME, after paragraphs that say which command made them, and where."""
    page = DOCS / name
    blocks = [f"```text\n{table}\n```" for table in made]
    write_text(page, with_tables(page.read_text("utf-8"), "\n\n".join([*heads, *blocks])))


def with_tables(page: str, tables: str) -> str:
    """The page with what stands between its marks replaced; InputError where it lacks a mark."""
    before, start, rest = page.partition(START)
    _, end, after = rest.partition(END)
    if not (start and end):
        raise InputError(f"the page lacks {START} or {END}; put the marks where the tables are to be")
    return f"{before}{start}\n\n{tables}\n\n{end}{after}"
