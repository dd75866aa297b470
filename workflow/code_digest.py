"""A digest of the code that a command runs, for the workflow to know when results are out of date.

It covers the command's module and every module of this project that it imports, as syntax trees without
docstrings: a comment, a docstring or a new line changes nothing, code reruns just what it touches.
"""

from __future__ import annotations

import ast
import hashlib
import json
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from schemas.errors import InputError
from schemas.files import write_text

ROOT = Path(__file__).resolve().parent.parent
ROOMS = (
    "stages",
    "subject_statistics",
    "checks",
    "trackers",
    "skeleton",
    "anatomy",
    "schemas",
    "workflow",
)
CACHE = Path(".snakemake", f"shukotsu-{sys.implementation.cache_tag}.json")
"""Digest and imports of every module, by the digest of its bytes: reading all syntax trees takes seconds."""


@cache
def code_digest(module: str, root: Path = ROOT) -> str:
    """Give the digest of a module, e.g. stages.solve_joints, and of everything in-house that it imports.

    Raises ModuleNotFoundError where there is no such module: its digest would never change.
    """
    digest = hashlib.sha256()
    if _file(module, root) is None:
        raise ModuleNotFoundError(module)
    for path in sorted(files_of(module, root)):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(_read(path)[0].encode())
    return digest.hexdigest()[:16]


def files_of(module: str, root: Path = ROOT) -> set[Path]:
    """Files of a module and of every in-house module reached from it, and data beside a package's modules."""
    files: set[Path] = set()
    names = {module, f"{module}.__main__"}
    waiting = list(names)
    while waiting:
        path = _file(waiting.pop(), root)
        if path is not None and path not in files:
            files |= {path, *_data_in(path.parent)}
            new = set(_read(path)[1]) - names
            names |= new
            waiting += new
    return files


def _data_in(folder: Path) -> Iterator[Path]:
    """Files beside modules that are no modules, also in folders that are no packages: templates, schemas."""
    for path in folder.iterdir():
        if path.is_dir() and path.name != "__pycache__" and not (path / "__init__.py").is_file():
            yield from _data_in(path)
        elif path.is_file() and path.suffix != ".py":
            yield path


def _file(name: str, root: Path) -> Path | None:
    """The file behind a dotted name: a module, or a package's `__init__`; None for a name within a module."""
    path = root.joinpath(*name.split("."))
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def write_cache() -> None:
    """Write down what was read of the modules, for the next start from this folder."""
    text = json.dumps(_known(), sort_keys=True)
    with suppress(OSError, InputError):  # a folder that cannot be written to costs time, and no more
        if not CACHE.is_file() or CACHE.read_text("utf-8") != text:
            write_text(CACHE, text)


@cache
def _known() -> dict[str, tuple[str, list[str]]]:
    """What is known of modules, by the digest of their bytes; grows as they are read."""
    with suppress(OSError, ValueError):
        known: dict[str, tuple[str, list[str]]] = json.loads(CACHE.read_text("utf-8"))
        return known
    return {}


def _read(path: Path) -> tuple[str, list[str]]:
    """The digest of what a file does, and the in-house modules that it names; of data, of every byte."""
    content = path.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    if path.suffix != ".py":
        return digest, []
    if digest not in _known():
        tree = ast.parse(content)
        _known()[digest] = hashlib.sha256(_without_docstrings(tree)).hexdigest(), _modules_named(tree)
    return _known()[digest]


def _modules_named(tree: ast.Module) -> list[str]:
    """In-house modules that a file imports, anywhere in it, or names in a text, as tables of readers do.

    Such a text is a module's whole name, or `module:attribute`.
    """
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names.add(node.value.partition(":")[0])
    return sorted(
        name for name in names if name.split(".")[0] in ROOMS and name.replace(".", "_").isidentifier()
    )


def _without_docstrings(tree: ast.Module) -> bytes:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [part for part in node.body if not _is_text(part)]
    return ast.dump(tree).encode()


def _is_text(node: ast.stmt) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
