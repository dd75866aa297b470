"""The page of refusals: every sentence in which bad input is refused, as it stands in the code.

A test holds the page in step, and `tests/refusals.py` that a test reaches every place.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from schemas.files import write_text

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "refusals.md"
ROOMS = ("schemas", "anatomy", "skeleton", "checks", "trackers", "stages", "workflow")
CLASSES = ("InputError", "TableError", "StorageError")


@dataclass(frozen=True)
class Place:
    """Where a sentence is made: its file from the repository's root, its line, and its pattern.

    pattern : `…` for what the code fills in; empty where another place makes the sentence.
    """

    file: str
    line: int
    pattern: str


@cache
def places() -> list[Place]:
    """Every place in the rooms, by file and line."""
    return [
        Place(path.relative_to(ROOT).as_posix(), call.lineno, _pattern(call.args[0]))
        for room in ROOMS
        for path in sorted((ROOT / room).rglob("*.py"))
        for call in _calls(ast.parse(path.read_text("utf-8")))
    ]


def _calls(tree: ast.AST) -> Iterator[ast.Call]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in CLASSES:
            yield node


def _pattern(node: ast.expr) -> str:
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(_pattern(part) for part in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _pattern(node.left) + _pattern(node.right)
    return "…"


HEAD = """# Refusals

Every sentence in which bad input is refused, with exit code 2, as it stands in the code; … is what it fills
in: a file, a row, a value. What to do stands at a sentence's end. `make docs` writes this page.
"""
GROUPS = (
    (
        "Studies, sheets, layouts and skeleton models",
        "schemas/(config_files|layout|model|study|sheets)|workflow/",
    ),
    ("Mappings", "schemas/mapping"),
    ("Any file", "schemas/(files|limits|text_files|marked_text)"),
    ("Recordings", "stages/capture/(formats|inspect|samples|poses_table)"),
    (
        "Raw captures, trackers and their emulator",
        "trackers/|stages/capture/(record|emulate|check|decode|tracker)",
    ),
    ("Tables and plans of a study", "schemas/|stages/command_line"),
    ("Exports", "stages/export|stages/capture/(export|motion)|schemas/bids"),
    ("Report and figures", "stages/report"),
    ("Simulation", "stages/simulate"),
    ("Solving and fitting", ""),
)
"""Kinds of files and commands, and the modules whose sentences are about them; the first that fits."""


def page() -> str:
    """The page."""
    groups: dict[str, dict[str, str]] = {title: {} for title, _ in GROUPS}
    for place in places():
        if re.search(r"\w{3}", place.pattern):
            title = next(title for title, modules in GROUPS if re.match(modules, place.file))
            groups[title].setdefault(place.pattern, place.file)
    parts = [HEAD]
    for title, sentences in groups.items():
        rows = [
            f"| {_cell(pattern)} | `{file}` |" for pattern, file in sorted(sentences.items(), key=_by_file)
        ]
        parts.append("\n".join([f"## {title}\n", "| sentence | said by |", "|---|---|", *rows, ""]))
    return "\n".join(parts)


def _by_file(entry: tuple[str, str]) -> tuple[str, str]:
    return entry[1], entry[0]


def _cell(text: str) -> str:
    one_line = re.sub("…{2,}", "…", " ".join(text.split()))
    return re.sub(r"([|<*_\[\]])", r"\\\1", one_line)


def main() -> int:
    """Write the page."""
    write_text(PAGE, page())
    return 0


if __name__ == "__main__":
    sys.exit(main())
