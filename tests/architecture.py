"""Rules of dependency between the project's modules, checked from the source text; for the test of them."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

_OF_WORKFLOW = ("stages", "subject_statistics", "checks", "trackers", "anatomy", "skeleton", "schemas")

BELOW: Mapping[str, Sequence[str]] = {
    "schemas": (),
    "subject_statistics": (),
    "skeleton": ("schemas",),
    "anatomy": ("skeleton", "schemas"),
    "checks": ("anatomy", "skeleton", "schemas"),
    "trackers": ("anatomy", "skeleton", "schemas"),
    "stages": ("subject_statistics", "checks", "trackers", "anatomy", "skeleton", "schemas"),
    "workflow": _OF_WORKFLOW,
    "guide": ("stages", "anatomy", "skeleton", "schemas"),
    "shukotsu": ("workflow", *_OF_WORKFLOW),
    "benchmarks": ("workflow", *_OF_WORKFLOW),
}
"""Each room with the rooms that it may import."""

IMPORTED_BY_SNAKEFILE = ("workflow", "schemas")

SHARED_BY_STAGES = ("stages.command_line",)

OF_A_FAMILY = {"binary_decoder", "decoder", "driver", "emulated_device", "items", "text_decoder"}
"""What each family of trackers has of its own, by the same names (`trackers.families`)."""

REPEATED_NAMES = {"__init__", "__main__", "findings", *OF_A_FAMILY}
"""Names that modules of several packages may have."""

EMPTY_NAMES = re.compile(r"(utils?|helpers?|common|misc|tools?|stuff)")
"""Names that do not say what a module holds."""


@dataclass(frozen=True)
class Import:
    """A line of a module that imports another of the project; whether it runs when the module is imported."""

    module: str
    line: int
    target: str
    at_once: bool

    def __str__(self) -> str:
        return f"{self.module}:{self.line} imports {self.target}"


def modules(root: Path, rooms: Sequence[str] = tuple(BELOW)) -> dict[str, Path]:
    """Every module of the rooms by its dotted name; a package by its own."""
    found = {}
    for room in rooms:
        for path in sorted((root / room).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def imports(root: Path) -> list[Import]:
    """Imports of the project's own modules, those inside functions too; none for type checking alone.

    A text that is a module's whole name counts as an import inside a function, unless it is a room's alone.
    """
    known = modules(root)
    return [
        Import(name, node.lineno, target, at_once)
        for name, path in known.items()
        for node, at_once in _import_nodes(ast.parse(path.read_text("utf-8")).body, at_once=True)
        for target in _targets(node, name, path, known)
        if target != name and not (isinstance(node, ast.Constant) and "." not in target)
    ]


def _import_nodes(body: Sequence[ast.AST], *, at_once: bool) -> Iterator[tuple[ast.AST, bool]]:
    for node in body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node, at_once
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node, False
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            yield from _import_nodes(node.orelse, at_once=at_once)
        else:
            inside = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            yield from _import_nodes(list(ast.iter_child_nodes(node)), at_once=at_once and not inside)


def _targets(node: ast.AST, name: str, path: Path, known: Mapping[str, Path]) -> Iterator[str]:
    if isinstance(node, ast.Constant):  # a module named for importlib, as "module" or "module:object"
        yield from {str(node.value).partition(":")[0]} & set(known)
    elif isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names if alias.name in known)
    elif isinstance(node, ast.ImportFrom):
        base = node.module or ""
        if node.level:
            package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
            above = package[: len(package) - node.level + 1]
            base = ".".join([*above, *filter(None, [node.module])])
        wholes = {f"{base}.{alias.name}" for alias in node.names}
        yield from sorted(wholes & set(known))
        if base in known and wholes - set(known):
            yield base


def wrong_rooms(found: Sequence[Import]) -> list[str]:
    """Imports against the arrow between rooms."""
    rooms = [(one, one.module.partition(".")[0], one.target.partition(".")[0]) for one in found]
    return [
        f"{one}, but {room} may import only {', '.join(BELOW[room]) or 'nothing'}"
        for one, room, other in rooms
        if other not in (room, *BELOW[room])
    ]


def stages_in_stages(found: Sequence[Import]) -> list[str]:
    """Imports of one stage by another."""
    return [
        str(one)
        for one in found
        if one.module.startswith("stages.")
        and one.target.startswith("stages.")
        and one.target not in SHARED_BY_STAGES
        and one.module.split(".")[1] != one.target.split(".")[1]
    ]


def cycles(found: Sequence[Import]) -> list[str]:
    """Circles of modules that import each other as they are imported, each once."""
    graph: dict[str, set[str]] = defaultdict(set)
    for one in found:
        if one.at_once:
            graph[one.module].add(one.target)
    circles = []
    while True:
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            circle = error.args[1][::-1]  # in which each is imported by the one before
            circles.append(" imports ".join(circle))
            graph[circle[0]].discard(circle[1])
        else:
            return circles


def repeated_names(paths: Mapping[str, Path]) -> list[str]:
    """Modules of different packages with the same name."""
    by_name: dict[str, list[str]] = defaultdict(list)
    for module, path in paths.items():
        by_name[path.stem].append(module)
    return [
        f"{name}: {', '.join(own)}"
        for name, own in sorted(by_name.items())
        if len(own) > 1 and name not in REPEATED_NAMES
    ]


def empty_names(paths: Mapping[str, Path]) -> list[str]:
    """Modules and packages whose name does not say what they hold."""
    return [module for module in paths if EMPTY_NAMES.fullmatch(module.rpartition(".")[2])]


def snakefile_rooms(text: str) -> list[str]:
    """Rooms that a Snakefile imports and should not."""
    rooms = re.findall(r"^\s*(?:from|import)\s+(\w+)", text, re.MULTILINE)
    return [room for room in dict.fromkeys(rooms) if room in BELOW and room not in IMPORTED_BY_SNAKEFILE]
