"""The second drawing of hands knows nothing of what it is to judge."""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[3] / "benchmarks" / "other_hands"
ALLOWED = (
    "numpy",
    "scipy",
    "shukotsu.schemas.poses",
    "benchmarks.other_hands",
    "collections",
    "dataclasses",
    "itertools",
    "typing",
)


def test_nothing_of_the_project_is_imported_but_the_poses_table() -> None:
    modules = list(PACKAGE.glob("*.py"))
    assert len(modules) > 4
    for module in modules:
        for node in ast.walk(ast.parse(module.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [one.name for one in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                assert name.startswith((*ALLOWED, "__future__")), f"{module.name} imports {name}"
