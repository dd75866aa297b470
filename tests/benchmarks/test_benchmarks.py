"""The benchmarks on tiny sizes: their tables have the rows and numbers expected; times are not looked at."""

from __future__ import annotations

import sys
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from benchmarks import (
    benchmark_table,
    studies,
)
from benchmarks.benchmark_table import TextTable
from benchmarks.processes import run_process, run_python
from benchmarks.studies import PAPER_MODELS, Study, hand_tasks, job_counts
from shukotsu.schemas.model import read_model
from shukotsu.schemas.study import read_study


def test_a_table_aligns_its_columns_and_shows_what_is_missing() -> None:
    table = TextTable("title", ("name", "mm:.1f"), [("a", 12.34), ("longer", None)], "Meaning.")
    assert str(table).splitlines() == [
        "title",
        "name      mm",
        "------  ----",
        "a       12.3",
        "longer     -",
        "Meaning.",
    ]


def test_tables_go_into_their_page_with_the_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmark_table, "DOCS", tmp_path)
    page = tmp_path / "page.md"
    page.write_text("Prose.\n<!-- tables: start -->\nold\n<!-- tables: end -->\nMore.\n", "utf-8")
    benchmark_table.write_tables(
        "page.md", [TextTable("title", ("mm:.1f",), [(1.0,)], "Meaning.")], "make it", "tables"
    )
    written = page.read_text("utf-8")
    assert "As printed by `make it` on " in written
    assert "```text\ntitle\n mm\n---\n1.0\nMeaning.\n```" in written
    assert written.startswith("Prose.")
    assert written.endswith("More.\n")
    assert "old" not in written


def test_a_process_is_measured_with_its_children(tmp_path: Path) -> None:
    child = "data = bytearray(200_000_000); print('in', __import__('os').getcwd())"
    usage = run_process(
        [sys.executable, "-c", f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"],
        tmp_path,
    )
    assert usage.output.strip() == f"in {tmp_path}"
    assert usage.memory_mb > 200
    assert usage.processor_s > 0
    with pytest.raises(RuntimeError, match="ended with 3"):
        run_python("-c", "import sys; sys.exit(3)")


def test_job_counts_are_read_from_the_output() -> None:
    counts = ["job        count", "-------  -------", "all            1", "capture        8", "total   9"]
    output = "\n".join(["Building", "Job stats:", *counts, ""])
    assert job_counts(output) == {"capture": 8}
    assert job_counts("Nothing to be done (all requested files are present).") == {}
    with pytest.raises(RuntimeError, match="no job counts"):
        job_counts("something else")


@pytest.fixture
def simulated(tmp_path: Path) -> Path:
    """Recordings of two subjects that hold frame numbers alone."""
    folder = tmp_path / "simulated"
    folder.mkdir()
    for subject in ("01", "02"):
        for hand, task in hand_tasks():
            pq.write_table(pa.table({"frame": [1, 2, 2]}), folder / f"{subject}_{hand}_{task}.parquet")
    return folder


def test_a_study_is_written_and_changed(tmp_path: Path, simulated: Path) -> None:
    study = Study(tmp_path / "study")
    study.write_subjects(simulated, 3)
    written = read_study(study.file)
    assert list(written.subjects) == ["0000", "0001", "0002"]
    assert list(written.models) == list(PAPER_MODELS)
    assert all(recording.file.exists() for recording in written.recordings)
    changes = studies.changes(study, simulated, 3)
    changes["one subject more"]()
    assert len(read_study(study.file).subjects) == 4
    changes["one recording changed"]()
    assert pq.read_table(study.recording(0, "right", "opposition")).num_rows == 1
    assert pq.read_table(study.recording(2, "right", "opposition")).num_rows == 3
    changes["one model changed"]()
    assert read_model(study.model_file).metacarpals.twist_factor == 0.5
