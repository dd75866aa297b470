"""An import needs as much memory for twenty minutes of 16 receivers as for one."""

from collections.abc import Callable
from pathlib import Path

import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pytest

from benchmarks.long_recordings import process, write_long_recording
from benchmarks.made_up_capture import write_capture

SHORT, LONG = 1.0, 20.0
MOST_MB = 60.0

pytestmark = pytest.mark.slow


def by_frame(path: Path, minutes: float) -> Path:
    write_long_recording(path / "rom.parquet", minutes)
    return path / "rom.parquet"


def one_row_group_by_segment(path: Path, minutes: float) -> Path:
    table = pq.read_table(by_frame(path, minutes)).sort_by([("segment", "ascending"), ("frame", "ascending")])
    pq.write_table(table, path / "sorted.parquet", row_group_size=table.num_rows)
    return path / "sorted.parquet"


def csv(path: Path, minutes: float) -> Path:
    file = pq.ParquetFile(by_frame(path, minutes))
    with pa_csv.CSVWriter(path / "rom.csv", file.schema_arrow) as writer:
        for batch in file.iter_batches():
            writer.write_batch(batch)
    return path / "rom.csv"


def raw(path: Path, minutes: float) -> Path:
    write_capture(path / "rom.arrows", minutes * 60)
    return path / "rom.arrows"


@pytest.mark.parametrize("made", [by_frame, one_row_group_by_segment, csv, raw])
def test_memory_does_not_grow_with_the_recording(tmp_path: Path, made: Callable[[Path, float], Path]) -> None:
    memory_mb = {}
    for minutes in (SHORT, LONG):
        folder = tmp_path / f"{minutes:g}"
        folder.mkdir()
        names = "--layout=liberty16", "--subject=01", "--hand=right", "--task=rom"
        files = f"--in={made(folder, minutes)}", f"--out={folder / 'poses.parquet'}"
        memory_mb[minutes] = process(["-m", "stages.capture", "import", *files, *names]).memory_mb
        assert pq.ParquetFile(folder / "poses.parquet").metadata.num_rows == 16 * minutes * 60 * 240
    assert memory_mb[LONG] - memory_mb[SHORT] < MOST_MB
