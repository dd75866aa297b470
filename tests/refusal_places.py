"""Every place in the code that refuses bad input, with its sentence as it stands there."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
ROOMS = ("schemas", "anatomy", "skeleton", "checks", "trackers", "stages", "workflow", "shukotsu")
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
