"""Messages quoted in docs/what-went-wrong.md are those of the program."""

import re

import pytest
from program_files import REPOSITORY, program_files

PAGE = (REPOSITORY / "docs" / "what-went-wrong.md").read_text("utf-8")
FILLED_IN = re.compile(
    r"\d[\d.]*|'[^']*'|\.\.\.|[{}<>]|\b(?:index_distal|little_metacarpal|liberty16|arm|x_mm|frame)\b"
    r"|expected (?=a whole)"
)
"""Parts of a sentence that depend on the recording: numbers, names and quoted texts."""


def section(head: str) -> str:
    """Return the section of the page below a heading."""
    return PAGE.partition(f"## {head}\n")[2].partition("\n## ")[0]


def first_cells(head: str) -> list[str]:
    """Return the first cell of every row of a section's table except the header."""
    rows = [line.split(" | ")[0].strip("| ") for line in section(head).splitlines() if line.startswith("|")]
    return rows[2:]


QUOTED = [cell.strip("*") for cell in first_cells("Joints are weak or failed")]
QUOTED += [quote for cell in first_cells("An error is printed") for quote in re.findall(r"`([^`]+)`", cell)]


CODE = "\n".join(path.read_text("utf-8") for path in program_files(suffix=".py"))
CODE = re.sub(r'"\s*\n\s*f?"', "", CODE)
"""The program's code with string literals over several lines joined."""


def longest_part(quote: str) -> str:
    """Return the longest part of a sentence that is the same for every recording."""
    return max((part.strip(" ;:,") for part in FILLED_IN.split(quote)), key=len)


@pytest.mark.parametrize("quote", QUOTED)
def test_quoted_messages_are_in_the_code(quote: str) -> None:
    assert len(longest_part(quote)) >= len("is empty")
    assert longest_part(quote) in CODE
