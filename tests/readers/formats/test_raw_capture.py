"""Importing a raw capture: tracker name, receivers and memory; decoding is tested in tests/tracker."""

from pathlib import Path

import captures
import numpy as np
import pyarrow.parquet as pq
import pytest
from recording_files import WHO, read, refuse

from benchmarks.benchmark_table import run_python
from shukotsu.commands.import_file import main
from shukotsu.tables.typed_table import read_metadata

STATIONS = tuple(range(1, 17))


def test_the_tracker_is_recorded_in_the_metadata(tmp_path: Path) -> None:
    path, out = tmp_path / "rom.arrows", tmp_path / "poses.parquet"
    captures.write(path, map(captures.cycle, range(48)))
    assert read(path).tracker == "LIBERTY"
    assert main([f"--in={path}", f"--out={out}", "--record-failure", *WHO]) == 0
    assert read_metadata(out)["parameters"]["tracker"] == "LIBERTY"


@pytest.mark.parametrize(
    ("receivers", "segments", "note"),
    [
        (None, {"hand": 1, "thumb_metacarpal": 2, "thumb_proximal": 3}, ""),
        ({"hand": 3, "ring_distal": 2}, {"hand": 3, "ring_distal": 2}, "receiver 1: not in layout"),
        ({"hand": 9}, None, "'9' is not in"),
    ],
)
def test_receivers_are_assigned_by_the_mapping_or_the_layout(
    tmp_path: Path, receivers, segments, note
) -> None:
    path = captures.write(tmp_path / "a.arrows", [captures.cycle(frame) for frame in range(20)])
    mapping = receivers and {
        "format": "capture",
        "position_unit": "cm",
        "receivers": {segment: {"value": value} for segment, value in receivers.items()},
    }
    if segments is None:
        refuse(path, note, mapping=mapping)
        return
    samples = read(path, mapping=mapping)
    stations = np.rint(samples.numbers[:, 0] / 10).astype(int) - 20
    positions = {(samples.segments[at], n) for at, n in zip(samples.segment, stations.tolist(), strict=True)}
    assert positions == {*segments.items()}
    assert any(note in text for text in samples.notes) or not note


@pytest.mark.slow
def test_memory_does_not_grow_with_the_recording(tmp_path: Path) -> None:
    """Six minutes of 16 receivers have 117 MB of rows, of which one receiver at a time is in memory."""
    memory_mb = []
    for minutes in (1, 6):
        path, out = tmp_path / f"{minutes}.arrows", tmp_path / f"{minutes}.parquet"
        frames = range(minutes * 60 * 240)
        captures.write(
            path, (captures.cycle(frame, STATIONS) for frame in frames), captures.settings(STATIONS)
        )
        argv = ["-m", "shukotsu", "import", f"--in={path}", f"--out={out}", *WHO]
        memory_mb.append(run_python(*argv).memory_mb)
        assert pq.ParquetFile(out).metadata.num_rows == 16 * minutes * 60 * 240
    assert memory_mb[1] - memory_mb[0] < 50
