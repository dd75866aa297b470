"""Reading a raw capture: its parts, and its memory; what decoding gives is tested with the trackers."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from benchmarks.captures import write_capture
from benchmarks.processes import run_python
from schemas.layout import read_layout
from schemas.tables import read_metadata
from stages.capture.formats.raw_capture import read_capture
from stages.capture.import_recording import main
from stages.capture.samples import joined

LIBERTY = read_layout("liberty16")


def test_the_tracker_is_named(tmp_path: Path) -> None:
    """In the samples, and in the metadata of the poses table that is made of them."""
    path, out = tmp_path / "rom.arrows", tmp_path / "poses.parquet"
    write_capture(path, 0.2)
    assert joined(read_capture(path, LIBERTY, None)).tracker == "LIBERTY"
    names = "--layout=liberty16", "--subject=01", "--hand=right", "--task=rom"
    assert main([f"--in={path}", f"--out={out}", "--record-failure", *names]) == 0
    assert read_metadata(out)["parameters"]["tracker"] == "LIBERTY"


@pytest.mark.slow
def test_memory_does_not_grow_with_the_recording(tmp_path: Path) -> None:
    """Of twenty minutes of 16 receivers, 390 MB of rows, one receiver at a time is in memory."""
    memory_mb = []
    for minutes in (1, 20):
        path, out = tmp_path / f"{minutes}.arrows", tmp_path / f"{minutes}.parquet"
        write_capture(path, minutes * 60.0)
        names = "--layout=liberty16", "--subject=01", "--hand=right", "--task=rom"
        argv = ["-m", "stages.capture", "import", f"--in={path}", f"--out={out}", *names]
        memory_mb.append(run_python(*argv).memory_mb)
        assert pq.ParquetFile(out).metadata.num_rows == 16 * minutes * 60 * 240
    assert memory_mb[1] - memory_mb[0] < 100
