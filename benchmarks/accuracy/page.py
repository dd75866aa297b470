"""docs/accuracy.md: prose that stays, tables between two marks that the command makes anew."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.text_table import TextTable
from schemas.errors import InputError
from schemas.files import write_text

PAGE = Path(__file__).parents[2] / "docs" / "accuracy.md"
START, END = "<!-- tables: start -->", "<!-- tables: end -->"


def write_tables(made: Sequence[TextTable], seeds: Sequence[int]) -> None:
    """Put the tables into the page, with the command that makes them."""
    command = f"python -m benchmarks accuracy --seeds {min(seeds)}-{max(seeds)} --write"
    blocks = [f"```text\n{table}\n```" for table in made]
    write_text(
        PAGE, with_tables(PAGE.read_text("utf-8"), "\n\n".join([f"As printed by `{command}`:", *blocks]))
    )


def with_tables(page: str, tables: str) -> str:
    """The page with what stands between its marks replaced; InputError where it lacks a mark."""
    before, start, rest = page.partition(START)
    _, end, after = rest.partition(END)
    if not (start and end):
        raise InputError(f"{PAGE}: lacks {START} or {END}; put the marks where the tables are to be")
    return f"{before}{start}\n\n{tables}\n\n{end}{after}"
