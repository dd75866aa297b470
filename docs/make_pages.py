"""Generate parts of the guide: tables.md, configuration.md and mistakes.md after their introductions from the
schemas, and the diagram in architecture.md (Mermaid) from the rules of the demo study. A mistake in a table's
schema ends it with a sentence.
"""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from itertools import groupby, takewhile
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError
from shukotsu.study.config_files import check_config, json_schema, read_yaml, shipped_names
from shukotsu.study.sheets import SHEETS
from shukotsu.tables.catalogue import FOLDER, HAND_KEY, RECORDING_KEY, TABLES, shared_columns
from shukotsu.tables.text_files import replaced_between
from shukotsu.tables.typed_table import Column
from shukotsu.tables.whole_files import write_text
from shukotsu.workflow.one_run import ending_in_a_sentence

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "architecture.md"
ROWS = DOCS.parent / "shukotsu" / "tables" / "rows.pyi"
START, END = "<!-- diagram: start -->", "<!-- diagram: end -->"
NOTE = "<!-- What follows is made by `make docs` from the schemas; change those. -->"


def check_tables(folder: Path = FOLDER) -> None:
    """Check the files that define tables and their columns; raise InputError at the first mistake."""
    shared: dict[str, Any] = {}
    for path in (folder / "columns.yaml", *sorted((folder / "tables").glob("*.yaml"))):
        columns = check_config(read_yaml(path, "table"), "table", str(path))["columns"]
        shared = shared or columns
        if undefined := [name for name in columns if not (columns[name] or shared.get(name))]:
            expected = "expected its type and meaning, here or in columns.yaml"
            raise InputError(f"{path}: columns.{undefined[0]}: is empty; {expected}")


def pages() -> dict[str, str]:
    """Return the pages by file name: the page's own text up to NOTE, then the generated part."""
    generated = {"tables.md": tables(), "configuration.md": configuration(), "mistakes.md": mistakes()}
    return {
        name: (DOCS / name).read_text("utf-8").partition(NOTE)[0] + "\n".join([NOTE, *lines, ""])
        for name, lines in generated.items()
    }


def tables() -> list[str]:
    """Return the lines on columns that tables share, and on each table: its rows, key and other columns."""
    shared = {column.name: column for columns in shared_columns().values() for column in columns}
    lines = ["", "## Shared columns", "", *_rows(shared.values())]
    for table in TABLES.values():
        unshared = [column for column in table.columns if column != shared.get(column.name)]
        more = [f"`{c.name}`" for c in table.columns if c not in unshared and c.name not in table.key]
        key = f" Key: {_key(table.key)}." if table.key else ""
        also = f" Also: {', '.join(more)}." if more else ""
        lines += ["", f"## {table.name}", "", f"A row: {table.row}.{key}{also}", "", *_rows(unshared)]
    return lines


def row_types() -> str:
    """Return the file of row types: its own text up to the first class, then a TypedDict for each table with
    a key for each column.
    """
    python = {"string": "str", "bool": "bool", "int8": "int", "int64": "int", "double": "float"}
    lines = [ROWS.read_text("utf-8").partition("\n\nclass ")[0]]
    for table in (table for table in TABLES.values() if "frame" not in table.key):
        lines += ["", f"class {table.name.title().replace('_', '')}Row(TypedDict, total=False):"]
        for column in table.columns:
            type_ = python.get(str(column.type), "list[float]")
            lines.append(f"    {column.name}: {type_}{' | MaybeNone' if column.nullable else ''}")
    return "\n".join(lines) + "\n"


def configuration() -> list[str]:
    """Return the lines on the keys of configuration files and the columns of sheets."""
    layouts, models = ", ".join(shipped_names("layout")), ", ".join(shipped_names("model"))
    lines = ["", f"Layouts that come with the program: {layouts}. Skeleton models: {models}."]
    for kind in ("study", "layout", "model", "mapping"):
        schema = json_schema(kind)
        lines += ["", f"## {schema['title']} file", "", schema["description"], ""]
        lines += _keys(schema, "")
    form = "Tab-separated UTF-8 text with a header line. Quotation marks around a cell are removed."
    lines += ["", "## Sheets", "", form]
    for sheet in SHEETS.values():
        more = " Further columns are kept." if sheet.more_columns else ""
        lines += ["", f"### {sheet.name}", "", f"One row per {', '.join(sheet.key)}.{more}", ""]
        for cell in sheet.cells:
            unless = f" unless `{cell.unless}` has a value" if cell.unless else ""
            need = f" **needed**{unless}" if cell.required else ""
            lines.append(f"- `{cell.name}`{need}: {_linked(cell.description)}")
    return lines


def mistakes() -> list[str]:
    """Return the lines on all kinds of mistakes, with their causes and cures."""
    lines: list[str] = []
    for name, kind in read_yaml(DOCS.parent / "schemas" / "mistakes.yaml", "mistakes").items():
        lines += ["", f"## {name}", "", kind["meaning"], ""]
        lines += [f"- **Usual cause**: {kind['cause']}", f"- **Cure**: {kind['cure']}"]
    return lines


def _key(names: tuple[str, ...]) -> str:
    """Format the names of a key; the keys of a hand or a recording are replaced by that word."""
    listed = ", ".join(f"`{name}`" for name in names)
    for word, key in (("recording", RECORDING_KEY), ("hand", HAND_KEY)):
        listed = listed.replace(", ".join(f"`{name}`" for name in key), f"*{word}*")
    return listed


def _rows(columns: Iterable[Column]) -> Iterator[str]:
    """Format a line for each column; successive parts of a vector, quaternion or matrix share a line."""

    def whole(column: Column) -> tuple[str, str]:
        return re.sub(r", (row \w column )?[wxyz]$", "", column.description), _type(column)

    for (meaning, kind), parts in groupby(columns, key=whole):
        yield f"- `{_joined([part.name for part in parts])}`{kind}: {_linked(meaning)}"


def _linked(text: str) -> str:
    """Format a meaning as Markdown: link pages of the guide, and escape characters that would be markup."""
    parts = text.split("`")
    parts[::2] = [part.replace("<", "&lt;").replace("*", "\\*") for part in parts[::2]]
    return re.sub(r"docs/([\w-]+)\.md", r"[\1](\1.md)", "`".join(parts))


def _joined(names: list[str]) -> str:
    """Format names that differ in one part as a single name: x_mm, y_mm, z_mm become {x,y,z}_mm."""
    if len(names) == 1:
        return names[0]
    start, end = _alike(names), _alike([name[::-1] for name in names])
    parts = [name[start : len(name) - end] for name in names]
    return f"{names[0][:start]}{{{','.join(parts)}}}{names[0][len(names[0]) - end :]}"


def _alike(names: list[str]) -> int:
    """Return the length of the beginning that all names share."""
    return sum(1 for _ in takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False)))


def _type(column: Column) -> str:
    """Return a column's type unless it is double, and a question mark if cells may be null."""
    listed = re.fullmatch(r"fixed_size_list<item: double>\[(\d+)\]", str(column.type))
    kind = f"{listed[1]} doubles" if listed else str(column.type).replace("string", "text")
    return f"{'' if kind == 'double' else f' {kind}'}{'?' if column.nullable else ''}"


def _keys(schema: dict[str, Any], prefix: str) -> Iterator[str]:
    required = schema.get("required", [])
    for name, part in schema.get("properties", {}).items():
        yield _key_row(f"{prefix}{name}", part, name in required)
        yield from _keys(part, f"{prefix}{name}.")
        yield from _keys(part.get("items", {}), f"{prefix}{name}[].")
    others = schema.get("additionalProperties")
    if isinstance(others, dict):
        yield from _keys(others, f"{prefix}<name>.")


def _key_row(path: str, part: dict[str, Any], required: bool) -> str:
    """Format a key's line: its type, its default, and its meaning."""
    words = {"string": "text", "object": "group", "array": "list", "boolean": "true, false"}
    kinds = part.get("type", "string")
    kind = " or ".join(words.get(kind, kind) for kind in ([kinds] if isinstance(kinds, str) else kinds))
    reference = part.get("$ref", "").rsplit("/", 1)[-1]
    kind = {"vector": "vector", "column": "text or integer"}.get(reference, kind)
    if "enum" in part:
        kind = ", ".join(str(word) or "empty" for word in part["enum"])
    default = f"; `{json.dumps(part['default'])}`" if "default" in part else ""
    need = "; **needed**" if required else default
    return f"- `{path}` ({kind}{need}): {_linked(part['description'])}"


_NODE = re.compile(r"^(\d+) \[.*?label=<(.*?)</table>>\]$", re.MULTILINE | re.DOTALL)
_EDGE = re.compile(r"^\s*(\d+) -> (\d+)$", re.MULTILINE)
_RULE = re.compile(r'<b><font point-size="18">(.*?)</font></b>')
_FILE = re.compile(r'<font face="monospace">(.*?)</font>')


def read_filegraph(dot: str) -> tuple[dict[str, list[str]], list[tuple[str, str]]]:
    """Parse the output of `snakemake --filegraph`, without the rule `all`.

    Returns the names of the files that each rule writes, and the edges between rules, each from the writer of
    a file to its reader.
    """
    rules: dict[str, str] = {}
    outputs: dict[str, list[str]] = {}
    for number, label in _NODE.findall(dot):
        rule = rules[number] = _RULE.findall(label)[0]
        files = _FILE.findall(label.partition("output &rarr;")[2])
        outputs[rule] = list(dict.fromkeys(file_name(html.unescape(file)) for file in files))
    del outputs["all"]
    read_by: dict[str, set[str]] = {rule: set() for rule in outputs}
    for writer, reader in _EDGE.findall(dot):
        if rules[reader] != "all":
            read_by[rules[writer]].add(rules[reader])
    return outputs, direct_edges(read_by)


def direct_edges(read_by: Mapping[str, Set[str]]) -> list[tuple[str, str]]:
    """Return the transitive reduction, sorted: the edges that no longer path implies."""

    def after(rule: str) -> set[str]:
        return {later for reader in read_by[rule] for later in (reader, *after(reader))}

    return [
        (writer, reader)
        for writer, readers in sorted(read_by.items())
        for reader in sorted(readers)
        if not any(reader in after(other) for other in readers)
    ]


def file_name(path: str) -> str:
    """Return the displayed name of a table or file, or of a folder with its parent; wildcards as capitals."""
    plain = re.sub(r"\{(\w)[^{}]*\}", lambda wildcard: wildcard[1].upper(), path)
    *_, folder, name = plain.split("/")
    if folder.endswith("_truth"):
        return "truth"
    if "." not in name:
        return f"{folder}/{name}"
    return name if name.startswith("sub-") else name.removesuffix(".parquet")


def mermaid(outputs: Mapping[str, Sequence[str]], edges: Iterable[tuple[str, str]]) -> str:
    """Format a graph of rules as a Mermaid flowchart, with a node for each rule that lists its files."""
    lines = ["flowchart TB"]
    for rule, files in sorted(outputs.items()):
        endings: dict[str, list[str]] = {}  # files that differ only in their endings share a line
        for file in files:
            stem, _, ending = file.partition(".")
            endings.setdefault(stem, []).append(ending)
        names = [
            f"{stem} ({', '.join(parts)})" if len(parts) > 1 else ".".join(filter(None, (stem, *parts)))
            for stem, parts in endings.items()
        ]
        lines.append(f'    {rule}["<b>{rule}</b><br/>{"<br/>".join(names)}"]')
    lines += [f"    {writer} --> {reader}" for writer, reader in edges]
    return "\n".join(lines)


def page_with_diagram(page: str) -> str:
    """Return the page with the diagram of the demo study's rules, with exports, between its marks."""
    with tempfile.TemporaryDirectory() as folder:
        ignore = shutil.ignore_patterns("recordings")
        for part in ("data", "config"):
            shutil.copytree(DOCS.parent / part, Path(folder, part), ignore=ignore)
        study = Path(folder, "config", "demo.yaml")
        study.write_text(f"{study.read_text('utf-8')}\nexports: [bvh, bids]\n", "utf-8")
        snakefile = str(DOCS.parent / "Snakefile")
        command = [sys.executable, "-m", "snakemake", "--snakefile", snakefile, "--configfile", str(study)]
        command += ["--directory", folder, "--cores", "1", "--forceall", "--filegraph"]
        dot = subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder).stdout
    return replaced_between(page, START, END, f"```mermaid\n{mermaid(*read_filegraph(dot))}\n```")


if __name__ == "__main__":
    with ending_in_a_sentence():
        check_tables()
        for page_name, page_text in pages().items():
            write_text(DOCS / page_name, page_text)
        write_text(ROWS, row_types())
        write_text(PAGE, page_with_diagram(PAGE.read_text("utf-8")))
