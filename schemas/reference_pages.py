"""The reference pages of the guide, made from the schemas: docs/tables.md,
docs/configuration.md and docs/mistakes.md.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from schemas.catalogue import TABLES
from schemas.config_files import json_schema, shipped
from schemas.findings import mistakes_page
from schemas.sheets import SHEETS
from schemas.tables import Table

NOTE = "<!-- Made by `make docs` from the schemas; change those, not this page. -->"


def pages() -> dict[str, str]:
    """Give the pages by file name."""
    return {
        "tables.md": tables_page(),
        "configuration.md": configuration_page(),
        "mistakes.md": f"{NOTE}\n{mistakes_page()}",
    }


def tables_page() -> str:
    """Give the page of tables: what a row is, its key and every column."""
    lines = [
        NOTE,
        "# Tables",
        "",
        "Every table is a Parquet file. Lengths are in mm, times in s, angles in degrees; quaternions are",
        "unit and scalar first (w, x, y, z) and turn a receiver's (or bone's) frame into the transmitter's.",
        "A gap is null, never NaN and never zero. The file's metadata, under the key `shukotsu`, is a JSON",
        "object with the table's name and version, the unit and meaning of every column, the SHA-256 of all",
        "inputs and the program's version; it holds no date and no absolute path, so the same input gives",
        "the same bytes. A table that does not match is refused, with the file, the column and what was",
        "expected.",
        "",
        "Read one with any Parquet reader:",
        "",
        "```python",
        "import pyarrow.parquet",
        "",
        'table = pyarrow.parquet.read_table("results/demo/tip_errors.parquet")',
        'table.schema.metadata[b"shukotsu"]  # units, meanings, inputs, version',
        "```",
    ]
    for table in TABLES.values():
        lines += ["", *_table(table)]
    return "\n".join(lines) + "\n"


def configuration_page() -> str:
    """Give the page of configuration files and sheets: every key and every column."""
    lines = [
        NOTE,
        "# Configuration",
        "",
        "A study is one YAML file that names its sheets, its layout and its skeleton models. Every file is",
        "checked before anything runs: a key or column that is not listed here is refused by name.",
        "",
        f"Layouts that ship: {', '.join(shipped('layout'))}. Skeleton models: {', '.join(shipped('model'))}.",
    ]
    for kind in ("study", "layout", "model", "mapping"):
        schema = json_schema(kind)
        lines += ["", f"## {schema['title']} file", "", schema["description"], ""]
        lines += ["| key | type | default | meaning |", "|---|---|---|---|", *_keys(schema, "")]
    lines += [
        "",
        "## Sheets",
        "",
        "Tab-separated UTF-8 text with a header line. Cells are taken as they are, quotes too.",
    ]
    for sheet in SHEETS.values():
        more = " Further columns are kept." if sheet.more_columns else ""
        lines += ["", f"### {sheet.name}", "", f"A row is one {', '.join(sheet.key)}.{more}", ""]
        lines += ["| column | needed | meaning |", "|---|---|---|"]
        lines += [
            f"| `{cell.name}` | {'yes' if cell.required else 'no'} | {cell.description} |"
            for cell in sheet.cells
        ]
    return "\n".join(lines) + "\n"


def _table(table: Table) -> Iterator[str]:
    yield f"## {table.name}"
    yield ""
    key = f" A row for every {', '.join(f'`{name}`' for name in table.key)}." if table.key else ""
    yield f"Version {table.version}: {table.row}.{key}"
    yield ""
    yield "| column | type | unit | may be null | meaning |"
    yield "|---|---|---|---|---|"
    for column in table.columns:
        nullable = "yes" if column.nullable else ""
        yield f"| `{column.name}` | {column.type} | {column.unit} | {nullable} | {column.description} |"


def _keys(schema: dict[str, Any], prefix: str) -> Iterator[str]:
    required = schema.get("required", [])
    for name, part in schema.get("properties", {}).items():
        yield _key_row(f"{prefix}{name}", part, name in required)
        yield from _keys(part, f"{prefix}{name}.")
    others = schema.get("additionalProperties")
    if isinstance(others, dict):
        yield from _keys(others, f"{prefix}<name>.")


def _key_row(path: str, part: dict[str, Any], required: bool) -> str:
    kind = _kind(part)
    if "enum" in part:
        kind = ", ".join(str(word) for word in part["enum"])
    default = "needed" if required else f"`{json.dumps(part['default'])}`" if "default" in part else ""
    return f"| `{path}` | {kind} | {default} | {part['description']} |"


def _kind(part: dict[str, Any]) -> str:
    reference = part.get("$ref", "").rsplit("/", 1)[-1]
    if reference in ("vector", "column"):
        return {"vector": "vector", "column": "text or integer"}[reference]
    words = {"string": "text", "object": "group", "array": "list", "boolean": "true, false"}
    kinds = part.get("type", "string")
    return " or ".join(words.get(kind, kind) for kind in ([kinds] if isinstance(kinds, str) else kinds))


def main() -> None:
    """Write the pages into a folder."""
    parser = argparse.ArgumentParser(description="Write the guide's reference pages from the schemas.")
    parser.add_argument("folder", type=Path, help="where the pages go, e.g. docs")
    folder = parser.parse_args().folder
    for name, text in pages().items():
        (folder / name).write_text(text, "utf-8")


if __name__ == "__main__":
    main()
