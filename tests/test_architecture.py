"""The package's architecture: layered imports, no import cycles, flat folders and portable file names."""

from __future__ import annotations

import ast
import re
import subprocess
from collections import Counter
from functools import cache
from graphlib import TopologicalSorter
from itertools import pairwise
from pathlib import Path, PurePosixPath

import pytest
from program_files import REPOSITORY

ROOMS = (
    *("commands", "workflow", "coach", "report", "export", "movement", "scores", "checks", "fit", "paper"),
    *("readers", "simulate", "tracker", "hand", "study", "command_line", "tables"),
)
"""The rooms, each of which imports only itself and those after it; `command_line` is one module."""
GROUND = ("arrays", "errors", "job", "resources", "translation")
"""Modules below all rooms, which import only each other."""
OF_WINDOWS = re.compile(r'(?i)(con|prn|aux|nul|com\d|lpt\d)(\..*)?|.*[<>:"|?*\\].*|.*[. ]')
"""File names that Windows does not allow."""


@cache
def tracked_files() -> list[str]:
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=REPOSITORY, capture_output=True, text=True, check=False
    ).stdout.split("\0")[:-1]
    if not listed:
        pytest.skip("no git repository: its files cannot be listed")
    return listed


@cache
def modules() -> dict[str, Path]:
    """Return every module of the package by its dotted name; a subpackage by its own name."""
    paths = {}
    for path in sorted((REPOSITORY / "shukotsu").rglob("*.py")):
        parts = path.relative_to(REPOSITORY).with_suffix("").parts
        paths[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return paths


@cache
def imports_of(path: Path) -> list[tuple[str, bool]]:
    """Return the package's modules that a file imports, and whether the import runs when the file is
    imported.

    A string that is a module's full name, `module` or `module:object`, counts as an import inside a function.
    """
    imports, nodes = [], [(ast.parse(path.read_text("utf-8")), True)]
    while nodes:
        node, at_once = nodes.pop()
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [name if name in modules() else str(node.module) for name in names]
        elif isinstance(node, ast.Constant):
            names, at_once = [str(node.value).partition(":")[0]], False
        imports += [(name, at_once) for name in names if name in modules()]
        inside = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        is_for_types = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        children = node.orelse if is_for_types else ast.iter_child_nodes(node)
        nodes += [(child, at_once and not inside) for child in children]
    return imports


def room(module: str) -> str:
    """Return the room of a module, empty for the package itself."""
    return [*module.split("."), ""][1]


def test_rooms_import_downwards_only() -> None:
    names = {room(module) for module in modules()}
    assert names == {*ROOMS, *GROUND, "", "__main__"}
    depth = {name: at for at, name in enumerate(("__main__", "", *ROOMS))} | dict.fromkeys(GROUND, 99)
    assert [
        f"{module} imports {target}"
        for module, path in modules().items()
        for target, _ in imports_of(path)
        if room(target) and depth[room(target)] < depth[room(module)]
    ] == []


def test_there_are_no_import_cycles() -> None:
    graph = {
        module: {target for target, at_once in imports_of(path) if at_once} - {module}
        for module, path in modules().items()
    }
    TopologicalSorter(graph).prepare()  # raises CycleError with the cycle


def test_stages_are_scripts_that_nothing_imports() -> None:
    scripts = sorted((REPOSITORY / "stages").iterdir())
    rules = re.findall(r"\{params\.stages\}/(\w+\.py)", (REPOSITORY / "Snakefile").read_text("utf-8"))
    assert {path.name for path in scripts if path.name != "__pycache__"} == {*rules}
    sources = [*modules().values(), *scripts, *(REPOSITORY / "tests").rglob("*.py")]
    imported = [
        line for path in sources if path.suffix == ".py" for line in path.read_text("utf-8").split("\n")
    ]
    assert not [line for line in imported if re.match(r"\s*(from|import) stages\b", line)]


def test_rooms_are_small_and_flat() -> None:
    files = [PurePosixPath(name) for name in tracked_files() if name.startswith("shukotsu/")]
    assert max(len(file.parts) for file in files) <= 4  # no folder deeper than two below shukotsu/
    assert {name for name, n in Counter(file.parts[1] for file in files).items() if n > 45} == set()


def test_the_snakefile_imports_only_wiring() -> None:
    lines = (REPOSITORY / "Snakefile").read_text("utf-8").splitlines()
    targets = [name for line in lines for name in re.findall(r"^from (shukotsu[\w.]*)", line)]
    assert {room(target) for target in targets} <= {"workflow", "study", "tables", *GROUND}


def test_file_names_work_on_every_file_system() -> None:
    """There are no links, no names that differ in case only, and none that Windows does not allow."""
    names = tracked_files()
    assert [name for name in names if (REPOSITORY / name).is_symlink()] == []
    assert [name for name, n in Counter(name.casefold() for name in names).items() if n > 1] == []
    assert [name for name in names if any(OF_WINDOWS.fullmatch(part) for part in name.split("/"))] == []
    assert max(map(len, names)) < 150


NOUNS = re.compile(
    r" (subject|recording|row|model|hand|joint|receiver|frame|file|session|segment|point|column|cell|job)s\b"
)


def test_sentences_use_singular_and_plural_correctly() -> None:
    """A number before a noun is formatted by `count_of` ("1 row") or is a constant."""
    told = []
    for name, path in modules().items():
        for text in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not isinstance(text, ast.JoinedStr):
                continue
            for number, after in pairwise(text.values):
                if not isinstance(number, ast.FormattedValue) or number.format_spec:
                    continue
                is_constant = isinstance(number.value, ast.BoolOp) or ast.unparse(number.value).isupper()
                noun = isinstance(after, ast.Constant) and NOUNS.match(str(after.value))
                if noun and not is_constant:
                    told.append(f"{name}: {ast.unparse(number.value)}{noun[0]}")
    assert not told
