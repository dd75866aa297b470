"""A digest of the code that a stage runs, for the workflow to know when results are out of date.

It covers the stage's package and every module of this project that they import, as syntax trees without
docstrings: a comment, a docstring or a new line changes nothing, code reruns just what it touches.
"""

from __future__ import annotations

import ast
import hashlib
import json
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path

from schemas.errors import InputError
from schemas.files import write_text

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("stages", "kinematics", "schemas")
DATA_OF = {"schemas/config_files.py": "schemas/json"}
"""Folders of data that a module reads: the defaults of configuration files stand in their JSON Schemas."""
KEPT = Path(".snakemake", f"shukotsu-{sys.implementation.cache_tag}.json")
"""What was read of every module, by the digest of its bytes: reading all their syntax trees takes seconds."""


@cache
def code_digest(stage: str, root: Path = ROOT) -> str:
    """Give the digest of a stage, e.g. solve_joints, and of everything in-house that it imports."""
    digest = hashlib.sha256()
    for module in sorted(modules_of(f"stages.{stage}", root)):
        digest.update(module.relative_to(root).as_posix().encode())
        digest.update(_read(module)[0].encode())
    return digest.hexdigest()[:16]


def modules_of(name: str, root: Path = ROOT) -> set[Path]:
    """Files of a module or of a whole package, and of every in-house module reached from them."""
    found: set[Path] = set()
    names = {name}
    waiting = list(_files(name, root))
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += (root / DATA_OF.get(path.relative_to(root).as_posix(), "none")).glob("*")
            if path.suffix == ".py":
                new = [module for module in _read(path)[1] if module not in names]
                names.update(new)
                waiting += [file for module in new for file in _files(module, root)]
    return found


def _files(name: str, root: Path) -> list[Path]:
    """Files behind a dotted name: a module, all of a stage's package, or a package's own `__init__`."""
    path = root.joinpath(*name.split("."))
    if path.with_suffix(".py").is_file():
        return [path.with_suffix(".py")]
    if not path.is_dir():
        return []
    if name.count(".") == 1 and name.startswith("stages."):
        return [
            file for file in sorted(path.rglob("*")) if file.is_file() and "__pycache__" not in file.parts
        ]
    return [path / "__init__.py"]


def keep() -> None:
    """Write down what was read of the modules, for the next start from this folder."""
    text = json.dumps(_known(), sort_keys=True)
    with suppress(OSError, InputError):  # a folder that cannot be written to costs time, and no more
        if not KEPT.is_file() or KEPT.read_text("utf-8") != text:
            write_text(KEPT, text)


@cache
def _known() -> dict[str, tuple[str, list[str]]]:
    """What is known of modules, by the digest of their bytes; grows as they are read."""
    with suppress(OSError, ValueError):
        known: dict[str, tuple[str, list[str]]] = json.loads(KEPT.read_text("utf-8"))
        return known
    return {}


def _read(path: Path) -> tuple[str, list[str]]:
    """The digest of what a file does, and the in-house names that it imports; of data, of every byte."""
    content = path.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    if path.suffix != ".py":
        return digest, []
    if digest not in _known():
        tree = ast.parse(content)
        imports = _imports(tree)
        _known()[digest] = hashlib.sha256(_without_text(tree)).hexdigest(), imports
    return _known()[digest]


def _imports(tree: ast.Module) -> list[str]:
    """In-house names that a file imports, anywhere in it: stages import the heavy ones inside functions."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return sorted(name for name in names if name.split(".")[0] in PACKAGES)


def _without_text(tree: ast.Module) -> bytes:
    """The code without its docstrings."""
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
