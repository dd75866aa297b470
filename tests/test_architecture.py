"""Imports between the rooms point one way, no stage imports another, and no modules import in a circle."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

from program_files import REPOSITORY, package_files

_LOW = ("schemas", "files", "errors", "sentences")
_OF_STAGES = ("statistics", "checks", "trackers", "anatomy", "skeleton", *_LOW)
BELOW: Mapping[str, Sequence[str]] = {
    "sentences": (),
    "errors": ("sentences",),
    "files": ("errors", "sentences"),
    "schemas": ("files", "errors", "sentences"),
    "statistics": ("errors", "sentences"),
    "skeleton": _LOW,
    "anatomy": ("skeleton", *_LOW),
    "checks": ("anatomy", "skeleton", *_LOW),
    "trackers": ("anatomy", "skeleton", *_LOW),
    "stages": _OF_STAGES,
    "coach": ("stages", *_OF_STAGES),
    "workflow": ("stages", *_OF_STAGES),
    "guide": ("stages", "anatomy", "skeleton", *_LOW),
}
"""Each room with the rooms that it may import; one that is not here may import all."""


@cache
def modules() -> dict[str, Path]:
    """Every module by its dotted name; a package by its own."""
    found = {}
    for path in (*package_files(suffix=".py"), *(REPOSITORY / "guide").rglob("*.py")):
        parts = path.relative_to(REPOSITORY).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports(text: str) -> Iterator[tuple[str, bool]]:
    """Modules of the project that a text imports; whether it does when it is imported itself.

    A text that is a module's whole name, `module` or `module:object`, counts as an import inside a function.
    """
    waiting: list[tuple[ast.AST, bool]] = [(ast.parse(text), True)]
    while waiting:
        node, at_once = waiting.pop()
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [name if name in modules() else str(node.module) for name in names]
        elif isinstance(node, ast.Constant):
            names, at_once = [str(node.value).partition(":")[0]], False
        yield from ((name, at_once) for name in names if name in modules())
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            waiting += [(child, at_once) for child in node.orelse]
        else:
            inside = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            waiting += [(child, at_once and not inside) for child in ast.iter_child_nodes(node)]


def room(module: str) -> str:
    """The room of a module."""
    parts = module.split(".")
    return parts[1] if parts[0] == "shukotsu" and len(parts) > 1 else parts[0]


def offence(module: str, target: str) -> str:
    """Return what is wrong with an import; empty where nothing is."""
    own, other = room(module), room(target)
    if other not in (own, "shukotsu", *BELOW.get(own, [other])):
        return f"{module} imports {target}, but {own} may import only {', '.join(BELOW[own]) or 'nothing'}"
    if own == other == "stages":
        stages = {name.split(".")[2] for name in (module, target) if name.count(".") > 1}
        if len(stages - {"command_line", "subject_stage"}) > 1:
            return f"{module} imports {target}, a module of another stage"
    return ""


@cache
def imports_of(module: str) -> list[tuple[str, bool]]:
    """Modules of the project that a module imports, and whether at once."""
    return list(imports(modules()[module].read_text("utf-8")))


def test_the_snakefile_wires_and_holds_no_logic() -> None:
    text = (REPOSITORY / "Snakefile").read_text("utf-8")
    lines = "\n".join(re.findall(r"^(?:from|import) .*$", text, re.MULTILINE))
    targets = [target for target, _ in imports(lines)]
    assert len(targets) > 3
    assert {room(target) for target in targets} <= {"workflow", *_LOW}


def test_imports_point_one_way_and_no_stage_imports_another() -> None:
    assert [
        said for module in modules() for target, _ in imports_of(module) if (said := offence(module, target))
    ] == []


def test_no_modules_import_in_a_circle() -> None:
    graph = {
        module: {target for target, at_once in imports_of(module) if at_once} - {module}
        for module in modules()
    }
    TopologicalSorter(graph).prepare()  # raises CycleError with the circle
