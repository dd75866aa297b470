"""Imports between the rooms point one way, no stage imports another, and no modules import in a circle."""

from __future__ import annotations

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
    """Return every module by its dotted name; a package by its own."""
    paths = {}
    for path in (*package_files(suffix=".py"), *(REPOSITORY / "guide").rglob("*.py")):
        parts = path.relative_to(REPOSITORY).with_suffix("").parts
        paths[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return paths


IMPORT = re.compile(
    r"^(\s*)(?:from ([\w.]+) import (\([^)]*\)|[^(\n]*)|import ([\w.]+))"
    r"""|["'](shukotsu\.[\w.]+)(?::\w+)?["']""",
    re.MULTILINE,
)
"""An import, by its indent; or a text that is a module's whole name, `module` or `module:object`."""


def imports(text: str) -> Iterator[tuple[str, bool]]:
    """Return modules of the project that a text imports; whether it does when it is imported itself."""
    for match in IMPORT.finditer(text):
        indent, parent, children, module, quoted = match.groups()
        names = (
            [f"{parent}.{child}" for child in re.findall(r"\w+", children)] if parent else [module or quoted]
        )
        for name in {name if name in modules() else str(parent) for name in names}:
            if name in modules():
                yield name, quoted is None and not indent.strip("\n")


def room(module: str) -> str:
    """Return the room of a module."""
    parts = module.split(".")
    return parts[1] if parts[0] == "shukotsu" and len(parts) > 1 else parts[0]


def offence(module: str, target: str) -> str:
    """Return what is wrong with an import; empty where nothing is."""
    importer, other = room(module), room(target)
    if other not in (importer, "shukotsu", *BELOW.get(importer, [other])):
        return f"{module} imports {target}, but {importer} may import only {', '.join(BELOW[importer])}"
    if importer == other == "stages":
        stages = {name.split(".")[2] for name in (module, target) if name.count(".") > 1}
        if len(stages - {"command_line", "subject_stage"}) > 1:
            return f"{module} imports {target}, a module of another stage"
    return ""


@cache
def imports_of(module: str) -> list[tuple[str, bool]]:
    """Return modules of the project that a module imports, and whether at once."""
    return list(imports(modules()[module].read_text("utf-8")))


def test_the_snakefile_wires_and_holds_no_logic() -> None:
    text = (REPOSITORY / "Snakefile").read_text("utf-8")
    lines = "\n".join(re.findall(r"^(?:from|import) .*$", text, re.MULTILINE))
    targets = [target for target, _ in imports(lines)]
    assert len(targets) > 1
    assert {room(target) for target in targets} <= {"workflow", *_LOW}


def test_imports_point_one_way_and_no_stage_imports_another() -> None:
    assert [
        text for module in modules() for target, _ in imports_of(module) if (text := offence(module, target))
    ] == []


def test_no_modules_import_in_a_circle() -> None:
    graph = {
        module: {target for target, at_once in imports_of(module) if at_once} - {module}
        for module in modules()
    }
    TopologicalSorter(graph).prepare()  # raises CycleError with the circle
