"""A digest of the code that a stage runs, for the workflow to know when results are out of date.

It covers the stage's package and every module of this project that they import, as syntax trees without
docstrings: a comment, a docstring or a new line changes nothing, code reruns just what it touches.
"""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("stages", "kinematics", "schemas")
DATA_OF = {"schemas/config_files.py": "schemas/json"}
"""Folders of data that a module reads: the defaults of configuration files stand in their JSON Schemas."""


@cache
def code_digest(stage: str, root: Path = ROOT) -> str:
    """Give the digest of a stage, e.g. solve_joints, and of everything in-house that it imports."""
    digest = hashlib.sha256()
    for module in sorted(modules_of(f"stages.{stage}", root)):
        digest.update(module.relative_to(root).as_posix().encode())
        digest.update(_content(module))
    return digest.hexdigest()[:16]


def modules_of(name: str, root: Path = ROOT) -> set[Path]:
    """Files of a module or of a whole package, and of every in-house module reached from them."""
    found: set[Path] = set()
    waiting = list(_files(name, root))
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += (root / DATA_OF.get(path.relative_to(root).as_posix(), "none")).glob("*")
            if path.suffix == ".py":
                waiting += [file for module in _imports(path) for file in _files(module, root)]
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


def _imports(path: Path) -> set[str]:
    """In-house names that a file imports, anywhere in it: stages import the heavy ones inside functions."""
    names: set[str] = set()
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return {name for name in names if name.split(".")[0] in PACKAGES}


def _content(path: Path) -> bytes:
    """What of a file counts: code without docstrings and comments, or, where it is not code, every byte."""
    if path.suffix != ".py":
        return path.read_bytes()
    tree = _tree(path)
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


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"))
