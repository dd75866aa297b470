"""Frictionless data package: tables of a study as CSV, with descriptions of their columns."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from shukotsu.errors import InputError
from shukotsu.export.delimited_text import write_rows
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.digests import file_sha256
from shukotsu.tables.typed_table import Table, read_row_groups
from shukotsu.tables.whole_files import write_text

FOLDER = "tables"
_TYPES = {
    "number": pa.types.is_floating,
    "integer": pa.types.is_integer,
    "array": pa.types.is_nested,
    "boolean": pa.types.is_boolean,
}
"""Types of the Table Schema (https://specs.frictionlessdata.io/table-schema/) other than string."""


def write_tables(tables: Sequence[Path], study: str, out: Path) -> None:
    """Write tables as CSV, with the package's description. Raises InputError if a file is not a table."""
    folder = out / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    resources = []
    for path in tables:
        if path.stem not in TABLES:
            raise InputError(f"{path}: is not one of the program's tables; name it as it was written")
        resources.append(_write_csv(path, TABLES[path.stem], folder / f"{path.stem}.csv"))
    package = {
        "profile": "tabular-data-package",
        "name": re.sub(r"[^a-z0-9._-]+", "-", study.lower()),
        "description": f"Tables of the study {study}, made by {PROGRAM} {VERSION}.",
        "resources": resources,
    }
    write_text(folder / "datapackage.json", json.dumps(package, ensure_ascii=False, indent=1) + "\n")


def _write_csv(path: Path, table: Table, out: Path) -> dict[str, Any]:
    """Write one table as CSV, block by block; return its entry in the package."""
    names = [column.name for column in table.columns]

    def cells() -> Iterator[pa.Table]:
        for rows in read_row_groups(path, table, names):
            for index, column in enumerate(table.columns):
                if pa.types.is_nested(column.type):  # arrays become JSON text
                    texts = [None if c is None else json.dumps(c) for c in rows.column(index).to_pylist()]
                    rows = rows.set_column(index, column.name, pa.array(texts, pa.string()))
            yield rows

    write_rows(out, ",".join(names) + "\n", cells())
    required = {"constraints": {"required": True}}
    fields = [
        {
            "name": column.name,
            "type": next((kind for kind, is_kind in _TYPES.items() if is_kind(column.type)), "string"),
            "description": column.description,
            **({"unit": column.unit} if column.unit else {}),
            # an empty string counts as missing, so a text column cannot be required
            **({} if column.nullable or column.type == pa.string() else required),
        }
        for column in table.columns
    ]
    return {
        "profile": "tabular-data-resource",
        "name": table.name,
        "path": out.name,
        "description": f"A row: {table.row}.",
        "format": "csv",
        "mediatype": "text/csv",
        "encoding": "utf-8",
        "bytes": out.stat().st_size,
        "hash": f"sha256:{file_sha256(out)}",
        "schema": {
            "fields": fields,  # `unit` is not part of the standard
            "missingValues": [""],
            **({"primaryKey": list(table.key)} if table.key else {}),
        },
    }
