"""Catalogue of tables: `TABLES["poses"]` or POSES, read from `schemas/tables/poses.yaml` on first use.

docs/tables.md is generated from these files. Conventions: mm, s, degrees; unit quaternions (w, x, y, z) from
the receiver's (or bone's) frame to the transmitter's; text columns are never null, empty text means "none".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import pyarrow as pa
import yaml

from shukotsu.resources import ROOT
from shukotsu.tables.typed_table import Column, Table

FOLDER = ROOT / "schemas"

BONE_TIP, DISTAL_RECEIVER = "bone tip", "distal receiver"
"""Points at which the last bone of a digit may end."""

HAND_KEY = ("subject", "session", "hand")
RECORDING_KEY = (*HAND_KEY, "task", "trial")

_TYPES = {"text": pa.string(), "bool": pa.bool_()}
_TYPES |= {"int8": pa.int8(), "int64": pa.int64(), "double": pa.float64()}


class _Tables(Mapping[str, Table]):
    """Tables by name; a schema file is read when its table is first used."""

    def __getitem__(self, name: str) -> Table:
        if name not in _names():
            raise KeyError(name)
        return _read_table(name)

    def __iter__(self) -> Iterator[str]:
        return iter(_names())

    def __len__(self) -> int:
        return len(_names())


TABLES = _Tables()

_JOINTS = ("projected_joints", "fitted_joints")
_TABLE_OF = dict.fromkeys(_JOINTS, "joint_centres") | {"fitted_bones": "bone_lengths"}


def table_in(file: str) -> Table:
    """Return the table in a subject's file of this name; several files may have the same table."""
    return TABLES[_TABLE_OF.get(file, file)]


def __getattr__(name: str) -> Table:
    """Return a table by its name in capitals, such as POSES."""
    if name.isupper() and name.lower() in TABLES:
        return TABLES[name.lower()]
    raise AttributeError(f"{__name__} has no {name}")


@cache
def shared_columns() -> dict[str, tuple[Column, ...]]:
    """Return the columns that several tables share, by their entry in schemas/columns.yaml."""
    columns = _yaml(FOLDER / "columns.yaml")["columns"]
    return {name: _columns(name, keys) for name, keys in columns.items()}


@cache
def _names() -> tuple[str, ...]:
    """Return the names of all tables, sorted."""
    return tuple(sorted(path.stem for path in (FOLDER / "tables").glob("*.yaml")))


@cache
def _read_table(name: str) -> Table:
    """Read the schema file of a table."""
    content = _yaml(FOLDER / "tables" / f"{name}.yaml")
    columns = [
        column
        for spelled, keys in content["columns"].items()
        for column in (_columns(spelled, keys) if keys else shared_columns()[spelled])
    ]
    return Table(name, int(content["version"]), content["row"], tuple(columns), tuple(content["key"]))


def _columns(spelled: str, keys: Mapping[str, str]) -> tuple[Column, ...]:
    """Return the columns of one entry: one, or one for each letter of a group such as {x,y,z}."""
    kind, _, length = keys["type"].rstrip("]").partition("[")
    type_ = pa.list_(_TYPES[kind], int(length)) if length else _TYPES[kind]
    braces = r"{([\w,]+)}"
    columns = []
    for letters in product(*(group.split(",") for group in re.findall(braces, spelled))):
        name, meaning = spelled, keys["meaning"]
        for letter in letters:
            name, meaning = (re.sub(braces, letter, text, count=1) for text in (name, meaning))
        columns.append(Column(name, type_, keys.get("unit", ""), meaning, keys.get("nullable") == "true"))
    return tuple(columns)


def _yaml(path: Path) -> dict[str, Any]:
    """Read a YAML file with every value as text, which takes half the time of parsing numbers."""
    content: dict[str, Any] = yaml.load(path.read_bytes(), yaml.CBaseLoader)
    return content
