"""The study's tables as CSV with a data dictionary, read back exactly."""

import csv
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from program_files import printed_by
from stage_runs import export_tables as main

from shukotsu.study.results import MODEL_COMPARISONS, MOVEMENT_COMPARISONS, STUDY_TABLES
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.typed_table import Provenance, Table, columns_from_rows, read_table, write_table

TEXTS = ('a, "b"\nc', "手", " ", "1")
NAMES = (*STUDY_TABLES, *MODEL_COMPARISONS, *MOVEMENT_COMPARISONS)


def rows(table: Table) -> list[dict[str, Any]]:
    """Return four rows of difficult values; the last has nulls in all nullable columns."""
    of_type: dict[pa.DataType, tuple[Any, ...]] = {pa.string(): TEXTS, pa.bool_(): (True, False) * 2}
    of_type |= {pa.float64(): (0.1, -1e-300, 1e17, 1 / 3), pa.float32(): (0.5, -3.0, 2.0**40, 0.0)}
    usual = (0, 3, 127, 4)
    hard = []
    for number in range(4):
        values = {
            c.name: [0.1 * number] * 36 if pa.types.is_nested(c.type) else of_type.get(c.type, usual)[number]
            for c in table.columns
        }
        values |= {"session": "", "trial": "", "message": ""} if number == 2 else {}
        values |= {c.name: None for c in table.columns if c.nullable and number == 3}
        hard.append({c.name: values[c.name] for c in table.columns})
    return hard


@pytest.fixture(scope="module")
def tidy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tidy")
    for name in NAMES:
        table = TABLES[name]
        write_table(folder / f"{name}.parquet", table, columns_from_rows(table, rows(table)), Provenance())
    paths = [str(folder / f"{name}.parquet") for name in NAMES]
    assert main(["--tables", *paths, "--study", "My Study", "--out", str(folder)]) == 0
    return folder / "tables"


def test_every_table_is_written_exactly(tidy: Path) -> None:
    package = json.loads((tidy / "datapackage.json").read_text("utf-8"))
    assert package["name"] == "my-study"
    assert [resource["name"] for resource in package["resources"]] == list(NAMES)
    read: dict[str, Callable[[str], Any]] = {
        "string": str,
        "number": float,
        "integer": int,
        "array": json.loads,
    }
    read["boolean"] = lambda text: text == "true"
    for resource in package["resources"]:
        file = tidy / resource["path"]
        assert resource["hash"] == f"sha256:{hashlib.sha256(file.read_bytes()).hexdigest()}"
        table, fields = TABLES[resource["name"]], resource["schema"]["fields"]
        assert [(f["name"], f.get("unit", ""), f["description"]) for f in fields] == [
            (c.name, c.unit, c.description) for c in table.columns
        ]
        written = read_table(tidy.parent / f"{table.name}.parquet", table).to_pylist()
        with file.open(encoding="utf-8", newline="") as stream:
            for line, row in zip(csv.DictReader(stream), written, strict=True):
                for field in fields:
                    text, value = line[field["name"]], row[field["name"]]
                    assert (value is None and text == "") or read[field["type"]](text) == value


def test_a_file_that_is_not_a_table_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "other.parquet").write_bytes(b"")
    assert main(["--tables", str(tmp_path / "other.parquet"), "--out", str(tmp_path)]) == 2
    assert "is not one of the program's tables" in capsys.readouterr().err


@pytest.mark.tools
def test_frictionless_validates_the_tables(tidy: Path, export_tool: Callable[..., Path]) -> None:
    python = export_tool("python/bin/python", "frictionless")
    code = (
        "import frictionless, json, sys\n"
        "report = frictionless.Package('datapackage.json').validate()\n"
        "print(json.dumps([[t.name, t.valid, t.stats['rows'], t.flatten()] for t in report.tasks]))"
    )
    checked = json.loads(printed_by(python, "-c", code, cwd=tidy))
    assert [name for name, *_ in checked] == list(NAMES)
    assert all(valid and n == 4 for _, valid, n, _ in checked), checked
