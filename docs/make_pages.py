"""Write what is made of the guide: tables.md, configuration.md and mistakes.md from the schemas, and the
data flow in architecture.md (Mermaid) from the rules of the demo study.
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
from dataclasses import dataclass
from itertools import groupby, takewhile
from pathlib import Path
from typing import Any

from shukotsu.study.config_files import json_schema, read_yaml, shipped_names
from shukotsu.study.sheets import SHEETS
from shukotsu.tables.catalogue import HAND_KEY, RECORDING_KEY, TABLES, shared_columns
from shukotsu.tables.text_files import replaced_between
from shukotsu.tables.typed_table import Column
from shukotsu.tables.whole_files import write_text

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "architecture.md"
ROWS = DOCS.parent / "shukotsu" / "tables" / "rows.pyi"
START, END = "<!-- diagram: start -->", "<!-- diagram: end -->"
NOTE = "<!-- Made by `make docs` from the schemas; change those, not this page. -->"


def pages() -> dict[str, str]:
    """Return the pages by file name."""
    return {
        "tables.md": tables_page(),
        "configuration.md": configuration_page(),
        "mistakes.md": mistakes_page(),
    }


def tables_page() -> str:
    """Return the page of tables: what a row is, its key and every column, those of many tables once."""
    shared = {column.name: column for columns in shared_columns().values() for column in columns}
    lines = [
        NOTE,
        "# Tables",
        "",
        "Every table is a Parquet file, with lengths in mm, times in s and angles in degrees. Quaternions",
        "are unit and scalar first (w, x, y, z), and rotate a receiver's or bone's coordinates into the",
        "transmitter's frame. Gaps are null, never NaN or zero. A table of another version is refused.",
        "",
        "Each file contains the same description, the SHA-256 of its inputs and the program's version:",
        "",
        "```python",
        "import pyarrow.parquet",
        "",
        'table = pyarrow.parquet.read_table("results/demo/tip_errors.parquet")',
        'table.schema.metadata[b"shukotsu"]  # a JSON object',
        "```",
        "",
        "Below, **key** lists the columns that identify a row: *hand* means `subject`, `session`, `hand`;",
        "*recording* means these and `task`, `trial`. `{x,y,z}` stands for three columns. The type is double",
        "unless another is given; `?` means that a cell may be null.",
        "",
        "## Shared columns",
        "",
        *_rows(shared.values()),
    ]
    for table in TABLES.values():
        unshared = [column for column in table.columns if column != shared.get(column.name)]
        more = [f"`{c.name}`" for c in table.columns if c not in unshared and c.name not in table.key]
        key = f" Key: {_key(table.key)}." if table.key else ""
        also = f" Also: {', '.join(more)}." if more else ""
        lines += ["", f"## {table.name}", "", f"A row: {table.row}.{key}{also}", "", *_rows(unshared)]
    return "\n".join(lines) + "\n"


def row_types() -> str:
    """Return the stub of row types: a TypedDict a table, a key a column."""
    python = {"string": "str", "bool": "bool", "int8": "int", "int64": "int", "double": "float"}
    lines = [
        '"""Types of the rows of tables, for the type checker alone: a key a column.',
        "",
        "No key is required: rows are put together in steps, and writers add the keys of a part. Tables with",
        "a row a frame are columns, never rows. Made by `make docs` from schemas/tables: change those.",
        '"""',
        "",
        "from typing import Any, TypeAlias, TypedDict",
        "",
        "MaybeNone: TypeAlias = Any",
        '"""Null; a reader knows from other columns, such as the status, that it is not."""',
    ]
    for table in (table for table in TABLES.values() if "frame" not in table.key):
        lines += ["", f"class {table.name.title().replace('_', '')}Row(TypedDict, total=False):"]
        for column in table.columns:
            type_ = python.get(str(column.type), "list[float]")
            lines.append(f"    {column.name}: {type_}{' | MaybeNone' if column.nullable else ''}")
    return "\n".join(lines) + "\n"


def configuration_page() -> str:
    """Return the page of configuration files and sheets: every key and every column."""
    lines = [
        NOTE,
        "# Configuration",
        "",
        "A study is a YAML file that names its sheets, its layout and its skeleton models. Every file is",
        "checked before anything runs, and an unknown key is refused by its name. The brackets after a key",
        "contain its type and, after a semicolon, its default value.",
        "",
        f"Layouts that come with the program: {', '.join(shipped_names('layout'))}. "
        f"Skeleton models: {', '.join(shipped_names('model'))}.",
    ]
    for kind in ("study", "layout", "model", "mapping"):
        schema = json_schema(kind)
        lines += ["", f"## {schema['title']} file", "", schema["description"], ""]
        lines += _keys(schema, "")
    lines += [
        "",
        "## Sheets",
        "",
        "Tab-separated UTF-8 text with a header line. Quotation marks around a cell are removed.",
    ]
    for sheet in SHEETS.values():
        more = " Further columns are kept." if sheet.more_columns else ""
        lines += ["", f"### {sheet.name}", "", f"One row per {', '.join(sheet.key)}.{more}", ""]
        for cell in sheet.cells:
            unless = f" unless `{cell.unless}` has a value" if cell.unless else ""
            need = f" **needed**{unless}" if cell.required else ""
            lines.append(f"- `{cell.name}`{need}: {_linked(cell.description)}")
    return "\n".join(lines) + "\n"


def mistakes_page() -> str:
    """Return the guide's page of mistakes: every kind with its cause and cure."""
    lines = [
        NOTE,
        "# Mistakes that are detected",
        "",
        "Before joints are solved, the declared properties of a recording are tested against its poses.",
        "Every mistake on this page is corrected in turn, as a test. If a correction explains the poses",
        "decisively better (joints close; lengths, places and motion are those of a hand), the mistake is",
        "reported in one sentence that states what to write. `shukotsu check`, `import` and `inspect` give",
        "the same messages ([how often they are right](mistakes-benchmark.md)). If you have a symptom but",
        "no message, start with [what went wrong](what-went-wrong.md).",
        "",
        "A finding also shows how much it matters: the median gap of the joints concerned (the distance",
        "between the joint centres computed from a joint's two receivers) before and after the correction,",
        "and the number of centres that move by more than 2 mm on their bones. The same mistake with the",
        "same cure in several recordings is one item in the report and on the terminal, with a list of the",
        "recordings.",
        "",
        "A finding is `refused` (the recording is not used), `suspect` (it is solved and shown, but left",
        "out of headlines and statistics) or a `note`. A reason in the column `accept` of the recordings",
        "sheet turns suspect findings into notes. A hand with a refused or suspect recording is not used",
        "for the fit of the person's other hand. All findings are in `problems.parquet` with `kind`,",
        "`variant` (which of the sentences of the kind) and `values` (numbers, receivers and joints as",
        "JSON), so that programs need not parse sentences. For layouts other than hands, swapped digits,",
        "the wrong hand, turned receivers and small errors of the unit are not detected.",
        "",
    ]
    for name, kind in read_yaml(DOCS.parent / "schemas" / "mistakes.yaml", "mistakes").items():
        lines += [
            f"## {name}",
            "",
            kind["meaning"],
            "",
            f"- **Usual cause**: {kind['cause']}",
            f"- **Cure**: {kind['cure']}",
            "",
        ]
    return "\n".join(lines[:-1]) + "\n"


def _key(names: tuple[str, ...]) -> str:
    """Format the names of a key, with a word for those that a hand or a recording has."""
    listed = ", ".join(f"`{name}`" for name in names)
    for word, key in (("recording", RECORDING_KEY), ("hand", HAND_KEY)):
        listed = listed.replace(", ".join(f"`{name}`" for name in key), f"*{word}*")
    return listed


def _rows(columns: Iterable[Column]) -> Iterator[str]:
    """Format a line a column; neighbours that are parts of a vector, quaternion or matrix share a line."""

    def whole(column: Column) -> tuple[str, str]:
        return re.sub(r", (row \w column )?[wxyz]$", "", column.description), _type(column)

    for (meaning, kind), parts in groupby(columns, key=whole):
        yield f"- `{_joined([part.name for part in parts])}`{kind}: {_linked(meaning)}"


def _linked(text: str) -> str:
    """Format a meaning as Markdown: pages of the guide are links, and would-be marks stand as they are."""
    parts = text.split("`")
    parts[::2] = [part.replace("<", "&lt;").replace("*", "\\*") for part in parts[::2]]
    return re.sub(r"docs/([\w-]+)\.md", r"[\1](\1.md)", "`".join(parts))


def _joined(names: list[str]) -> str:
    """Format names that differ in a part as a single name: x_mm, y_mm, z_mm are {x,y,z}_mm."""
    if len(names) == 1:
        return names[0]
    start, end = _alike(names), _alike([name[::-1] for name in names])
    parts = [name[start : len(name) - end] for name in names]
    return f"{names[0][:start]}{{{','.join(parts)}}}{names[0][len(names[0]) - end :]}"


def _alike(names: list[str]) -> int:
    """Count the letters that all names begin with alike."""
    return sum(1 for _ in takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False)))


def _type(column: Column) -> str:
    """Return a column's type where it is not the usual one, and a question mark where it may be null."""
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
    """Format a key's line: what it holds, what it is where it is left out, its meaning."""
    words = {"string": "text", "object": "group", "array": "list", "boolean": "true, false"}
    kinds = part.get("type", "string")
    kind = " or ".join(words.get(kind, kind) for kind in ([kinds] if isinstance(kinds, str) else kinds))
    reference = part.get("$ref", "").rsplit("/", 1)[-1]
    kind = {"vector": "vector", "column": "text or integer"}.get(reference, kind)
    if "enum" in part:
        kind = ", ".join(str(word) or "empty" for word in part["enum"])
    default = (
        "; **needed**" if required else f"; `{json.dumps(part['default'])}`" if "default" in part else ""
    )
    return f"- `{path}` ({kind}{default}): {_linked(part['description'])}"


_NODE = re.compile(r"^(\d+) \[.*?label=<(.*?)</table>>\]$", re.MULTILINE | re.DOTALL)
_EDGE = re.compile(r"^\s*(\d+) -> (\d+)$", re.MULTILINE)
_RULE = re.compile(r'<b><font point-size="18">(.*?)</font></b>')
_FILE = re.compile(r'<font face="monospace">(.*?)</font>')


@dataclass(frozen=True)
class RuleGraph:
    """Rules of a workflow with the names of the files that each writes; edges : from writer to reader."""

    outputs: Mapping[str, Sequence[str]]
    edges: Sequence[tuple[str, str]]


def read_filegraph(dot: str) -> RuleGraph:
    """Read what `snakemake --filegraph` prints; the rule `all` is left out."""
    rules: dict[str, str] = {}
    outputs: dict[str, list[str]] = {}
    for number, label in _NODE.findall(dot):
        rule = rules[number] = _RULE.findall(label)[0]
        names = [
            file_name(html.unescape(file)) for file in _FILE.findall(label.partition("output &rarr;")[2])
        ]
        outputs[rule] = list(dict.fromkeys(names))
    del outputs["all"]
    read_by: dict[str, set[str]] = {rule: set() for rule in outputs}
    for writer, reader in _EDGE.findall(dot):
        if rules[reader] != "all":
            read_by[rules[writer]].add(rules[reader])
    return RuleGraph(outputs, direct_edges(read_by))


def direct_edges(read_by: Mapping[str, Set[str]]) -> list[tuple[str, str]]:
    """Return edges without those that a longer way implies (the transitive reduction), sorted."""

    def after(rule: str) -> set[str]:
        return {later for reader in read_by[rule] for later in (reader, *after(reader))}

    return [
        (writer, reader)
        for writer, readers in sorted(read_by.items())
        for reader in sorted(readers)
        if not any(reader in after(other) for other in readers)
    ]


def file_name(path: str) -> str:
    """Return a table's name, a file's last part, a folder with its parent; wildcards are capitals."""
    plain = re.sub(r"\{(\w)[^{}]*\}", lambda wildcard: wildcard[1].upper(), path)
    *_, folder, name = plain.split("/")
    if folder.endswith("_truth"):
        return "truth"
    if "." not in name:
        return f"{folder}/{name}"
    return name if name.startswith("sub-") else name.removesuffix(".parquet")


def mermaid(graph: RuleGraph) -> str:
    """Format the graph as a Mermaid flowchart, a rule a node with the files that it writes."""
    lines = ["flowchart TB"]
    for rule, files in sorted(graph.outputs.items()):
        endings: dict[str, list[str]] = {}  # files that differ in their endings alone are a single name
        for file in files:
            stem, _, ending = file.partition(".")
            endings.setdefault(stem, []).append(ending)
        names = [
            f"{stem} ({', '.join(parts)})" if len(parts) > 1 else ".".join(filter(None, (stem, *parts)))
            for stem, parts in endings.items()
        ]
        lines.append(f'    {rule}["<b>{rule}</b><br/>{"<br/>".join(names)}"]')
    lines += [f"    {writer} --> {reader}" for writer, reader in graph.edges]
    return "\n".join(lines)


def page_with_diagram(page: str) -> str:
    """Return the page with the diagram of the rules of the demo study with exports between its marks."""
    with tempfile.TemporaryDirectory() as folder:
        for part in ("data", "config"):
            shutil.copytree(
                DOCS.parent / part, Path(folder, part), ignore=shutil.ignore_patterns("recordings")
            )
        study = Path(folder, "config", "demo.yaml")
        study.write_text(f"{study.read_text('utf-8')}\nexports: [bvh, bids]\n", "utf-8")
        command = [
            sys.executable,
            "-m",
            "snakemake",
            "--snakefile",
            str(DOCS.parent / "Snakefile"),
            "--forceall",
        ]
        command += ["--directory", folder, "--configfile", str(study), "--cores", "1", "--filegraph"]
        dot = subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder).stdout
    return replaced_between(page, START, END, f"```mermaid\n{mermaid(read_filegraph(dot))}\n```")


if __name__ == "__main__":
    for page_name, page_text in pages().items():
        write_text(DOCS / page_name, page_text)
    write_text(ROWS, row_types())
    write_text(PAGE, page_with_diagram(PAGE.read_text("utf-8")))
