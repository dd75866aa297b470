"""A digest of the code that a command runs, for the workflow to know when results are out of date.

It covers what the command's module defines and all that these definitions name, function by function through
every module of this project, as syntax trees without docstrings: a comment changes nothing, a new function
or another table's column reruns just what names it.
"""

from __future__ import annotations

import ast
import hashlib
import json
import re
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

from shukotsu.errors import InputError
from shukotsu.files.whole_files import write_text

ROOT = Path(__file__).resolve().parents[2]
CACHE = Path(".snakemake", f"shukotsu-code-{sys.implementation.cache_tag}.json")
"""Syntax of every module, by the digest of its bytes: reading all of them takes seconds."""

SCHEMAS = Path("shukotsu", "schemas", "json")
_MODULE = re.compile(r"shukotsu(\.\w+)+(:\w+)?")
_SCHEMA = ".schema.json"
_SCHEMA_READERS = ("read_config", "check_config", "json_schema")


class Statement(NamedTuple):
    """A statement at a module's top level.

    binds : names that it defines; none of one that does something whenever the module is imported. uses :
    names that stand in it, dotted where attributes are taken of them.
    """

    binds: list[str]
    digest: str
    uses: list[str]


class Module(NamedTuple):
    """Statements of a module, and what each name that is imported anywhere in it stands for.

    binding : places of the statements that define a name.
    """

    statements: list[Statement]
    imports: dict[str, list[str]]
    binding: dict[str, list[int]]


@cache
def code_digest(module: str, root: Path = ROOT) -> str:
    """Give the digest of a module, and of everything in-house that it names.

    Raises ModuleNotFoundError where there is no such module: its digest would never change.
    """
    if _file(module, root) is None:
        raise ModuleNotFoundError(module)
    reached = _Reached(root)
    for name in (module, f"{module}.__main__"):
        reached.name(name)
    digest = hashlib.sha256()
    for path, places in sorted(reached.places.items()):
        digest.update(path.relative_to(root).as_posix().encode())
        for place in sorted(places):
            digest.update(_read(path).statements[place].digest.encode())
    for path in sorted(reached.data):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


def files_of(module: str, root: Path = ROOT) -> set[Path]:
    """Give the files that a module's digest is of."""
    reached = _Reached(root)
    for name in (module, f"{module}.__main__"):
        reached.name(name)
    return {*reached.places, *reached.data}


class _Reached:
    """Statements that are reached by names, by file and place in it, and data beside them."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self.places: dict[Path, set[int]] = {}
        self.data: set[Path] = set()
        self._known: set[str] = set()

    def name(self, dotted: str) -> None:
        """Reach a module, or what is defined in one."""
        if dotted in self._known:
            return
        self._known.add(dotted)
        parts = dotted.split(".")
        for length in range(len(parts), 0, -1):
            path = _file(".".join(parts[:length]), self._root)
            if path is None:
                continue
            if length < len(parts):
                self._in_module(path, parts[length], parts[length + 1 :])
            else:
                self._statements(path, range(len(_read(path).statements)))
            for above in range(1, length):  # importing a module runs the packages that it is in
                if package := _file(".".join(parts[:above]), self._root):
                    self._statements(package, ())
            return

    def _in_module(self, path: Path, name: str, rest: list[str]) -> None:
        """Reach a name of a module; all of it where it is not clear what defines that."""
        module = _read(path)
        places, targets = module.binding.get(name, []), module.imports.get(name, [])
        if not places and not targets:
            places = list(range(len(module.statements)))
        self._statements(path, places)
        for target in targets:
            self.name(".".join((target, *rest)))

    def _statements(self, path: Path, places: range | list[int] | tuple[()]) -> None:
        """Reach some statements of a module, what it does when it is imported, and what they use."""
        module = _read(path)
        if path not in self.places:
            self.places[path] = set()
            if path.parent != self._root / "shukotsu":  # where links lead out of the package
                self.data |= _data_in(path.parent)
            self._statements(path, [at for at, own in enumerate(module.statements) if not own.binds])
        for place in set(places) - self.places[path]:
            self.places[path].add(place)
            for use in module.statements[place].uses:
                self._use(path, module, use)

    def _use(self, path: Path, module: Module, use: str) -> None:
        first, *rest = use.split(".")
        if use.endswith(_SCHEMA):
            self.data |= {path for path in [self._root / SCHEMAS / use] if path.is_file()}
        elif use.startswith("shukotsu."):
            self.name(use)
        elif first in module.imports or first in module.binding:
            self._in_module(path, first, rest)


@cache
def _data_in(folder: Path) -> frozenset[Path]:
    """Give files beside modules that are no modules, also in folders that are no packages: templates, styles.

    A JSON Schema counts where it is named alone: one of studies does not concern who reads a layout.
    """
    entries = [path for path in folder.iterdir() if path.name != "__pycache__"]
    files = {path for path in entries if path.is_file() and path.suffix != ".py"}
    folders = (path for path in entries if path.is_dir() and not (path / "__init__.py").is_file())
    return frozenset(path for path in files if not path.name.endswith(_SCHEMA)).union(*map(_data_in, folders))


@cache
def _file(name: str, root: Path) -> Path | None:
    """Give the file of a module or a package's `__init__`; None for a name within a module or of another."""
    path = root.joinpath(*name.split("."))
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def forget() -> None:
    """Forget what was read in this process: files may have changed since."""
    for cached in (code_digest, _read, _file, _data_in):
        cached.cache_clear()


def write_cache() -> None:
    """Write down what was read of the modules, for the next start from this folder."""
    text = json.dumps(_cached(), sort_keys=True)
    with suppress(OSError, InputError):  # a folder that cannot be written to costs time, and no more
        if not CACHE.is_file() or CACHE.read_text("utf-8") != text:
            write_text(CACHE, text)


@cache
def _cached() -> dict[str, tuple[list[Statement], dict[str, list[str]]]]:
    """Read the cached statements of modules, by the digest of their bytes; it grows as they are read."""
    with suppress(OSError, ValueError):
        known = json.loads(CACHE.read_text("utf-8"))
        return dict(known)
    return {}


@cache
def _read(path: Path) -> Module:
    content = path.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    if digest not in _cached():
        _cached()[digest] = _parsed(ast.parse(content))
    statements, imports = _cached()[digest]
    binding: dict[str, list[int]] = {}
    for place, (binds, *_) in enumerate(statements):
        for name in binds:
            binding.setdefault(name, []).append(place)
    return Module([Statement(*own) for own in statements], imports, binding)


def _parsed(tree: ast.Module) -> tuple[list[Statement], dict[str, list[str]]]:
    imports: dict[str, list[str]] = {}
    statements = []
    for node in tree.body:
        if not _is_unused(node):
            uses: set[str] = set()
            _collect(node, uses, imports)
            _strip(node)
            digest = hashlib.sha256(ast.dump(node).encode()).hexdigest()
            statements.append(Statement(_bound(node), digest, sorted(uses)))
    return statements, imports


def _is_unused(node: ast.stmt) -> bool:
    """Whether nothing of a statement runs: docstrings, imports for types; other imports count when used."""
    if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
        return True
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _bound(node: ast.stmt) -> list[str]:
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [node.name]
    if isinstance(node, ast.Import | ast.ImportFrom):
        return [alias.asname or alias.name.partition(".")[0] for alias in node.names]
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", node)]
    names = [name for target in targets for name in getattr(target, "elts", [target])]
    return [name.id for name in names] if all(isinstance(name, ast.Name) for name in names) else []


def _collect(node: ast.AST, uses: set[str], imports: dict[str, list[str]]) -> None:
    """Collect names that a statement uses, and imports in it. Annotations are not evaluated, and left out."""
    if isinstance(node, ast.Import | ast.ImportFrom):
        for alias in node.names:
            whole = f"{node.module}.{alias.name}" if isinstance(node, ast.ImportFrom) else alias.name
            own = alias.asname or alias.name if isinstance(node, ast.ImportFrom) or alias.asname else ""
            if whole.startswith("shukotsu"):
                imports.setdefault(own or "shukotsu", []).append(whole if own else "shukotsu")
        return
    if isinstance(node, ast.Name | ast.Attribute):
        parts: list[str] = []
        while isinstance(node, ast.Attribute):
            parts, node = [node.attr, *parts], node.value
        if isinstance(node, ast.Name):
            uses.add(".".join([node.id, *parts]))
            return
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and _MODULE.fullmatch(node.value):
        uses.add(node.value.replace(":", "."))  # as tables of readers name what is imported later
    if isinstance(node, ast.Call):
        uses |= {f"{kind}{_SCHEMA}" for kind in _schema_kinds(node)}
    for field, child in ast.iter_fields(node):
        if field not in ("annotation", "returns"):
            for each in child if isinstance(child, list) else [child]:
                if isinstance(each, ast.AST):
                    _collect(each, uses, imports)


def _schema_kinds(call: ast.Call) -> list[str]:
    """Give the kind of configuration file that a call reads or checks by its JSON Schema."""
    name = getattr(call.func, "id", getattr(call.func, "attr", ""))
    values = [argument.value for argument in call.args if isinstance(argument, ast.Constant)]
    return [value for value in values if isinstance(value, str)] if name in _SCHEMA_READERS else []


def _strip(tree: ast.AST) -> None:
    """Take the docstrings out of a statement."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [part for part in node.body if not _is_unused(part)]
