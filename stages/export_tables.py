"""Command line: the study's tables -> a CSV a table and a data dictionary: a Frictionless data package."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu import command_line, job

if TYPE_CHECKING:
    import pyarrow as pa

    from shukotsu.tables.typed_table import Column, Table

FOLDER = "tables"


def build_parser() -> argparse.ArgumentParser:
    """Return the argument parser."""
    parser = command_line.parser(
        "shukotsu stage export.tables",
        "Write tables as CSV, and what their columns mean as a Frictionless data package, for R and others.",
        "shukotsu stage export.tables --tables results/demo/*.parquet --study demo --out tidy",
        records_failure=False,
    )
    parser.add_argument("--tables", type=Path, nargs="+", required=True, help="tables of the study")
    parser.add_argument("--study", default="study", help="the study's name (default: study)")
    parser.add_argument("--out", type=Path, required=True, help=f"the folder to write {FOLDER}/ into")
    return parser


def write_tables(arguments: argparse.Namespace) -> None:
    """Write every table, and the package that names them. Raises InputError where a file is no table."""
    from shukotsu.errors import InputError
    from shukotsu.resources import PROGRAM, VERSION
    from shukotsu.tables.catalogue import TABLES
    from shukotsu.tables.whole_files import write_text

    folder = arguments.out / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    resources = []
    for path in arguments.tables:
        if path.stem not in TABLES:
            raise InputError(f"{path}: is none of the program's tables; name it as it was written")
        resources.append(_write_csv(path, TABLES[path.stem], folder / f"{path.stem}.csv"))
    package = {
        "profile": "tabular-data-package",
        "name": re.sub(r"[^a-z0-9._-]+", "-", arguments.study.lower()),
        "description": f"Tables of the study {arguments.study}, made by {PROGRAM} {VERSION}.",
        "resources": resources,
    }
    write_text(folder / "datapackage.json", json.dumps(package, ensure_ascii=False, indent=1) + "\n")


def _write_csv(path: Path, table: Table, out: Path) -> dict[str, Any]:
    """Write one table as CSV, in blocks; give its entry in the package."""
    import pyarrow as pa
    import pyarrow.csv as pc

    from shukotsu.tables.typed_table import read_row_groups
    from shukotsu.tables.whole_files import file_sha256, replacing

    names = [column.name for column in table.columns]
    with replacing(out) as temporary, temporary.open("wb") as stream:
        stream.write((",".join(names) + "\n").encode())
        options = pc.WriteOptions(include_header=False, quoting_style="needed")
        for rows in read_row_groups(path, table, names):
            block = {name: _flat(rows.column(name)) for name in names}
            pc.write_csv(pa.table(block), stream, options)
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
        "schema": table_schema(table.columns, table.key),
    }


def table_schema(columns: Sequence[Column], key: Sequence[str]) -> dict[str, Any]:
    """Return the Table Schema of some columns; units stand beside, which the standard has no word for."""
    fields = [
        {
            "name": column.name,
            "type": _type(column),
            "description": column.description,
            **({"unit": column.unit} if column.unit else {}),
            # an empty text is a text here, and a missing one to the standard
            **(
                {} if column.nullable or str(column.type) == "string" else {"constraints": {"required": True}}
            ),
        }
        for column in columns
    ]
    return {"fields": fields, "missingValues": [""], **({"primaryKey": list(key)} if key else {})}


def _flat(values: pa.Array) -> pa.Array:
    """Return values of a column; an array in a cell as its JSON."""
    import pyarrow as pa

    if not pa.types.is_nested(values.type):
        return values
    return pa.array([None if cell is None else json.dumps(cell) for cell in values.to_pylist()], pa.string())


def _type(column: Column) -> str:
    """Return a column's type of the Table Schema (https://specs.frictionlessdata.io/table-schema/)."""
    from pyarrow import types

    if types.is_floating(column.type):
        return "number"
    if types.is_integer(column.type):
        return "integer"
    if types.is_nested(column.type):
        return "array"
    return "boolean" if types.is_boolean(column.type) else "string"


def main(argv: list[str] | None = None) -> int:
    """Run the command; give its exit code."""
    return command_line.run(build_parser, argv, write_tables)


if __name__ == "__main__":
    sys.exit(job.run(main))
