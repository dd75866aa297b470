"""Recordings of a minute and an hour through every stage: processor seconds a minute, and memory."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.benchmark_table import Cell, TextTable
from benchmarks.processes import Usage, run_process
from benchmarks.study_runs import OWN_MODEL, Job, Study
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import simulate

TASK = "opposition"
RATE_HZ = 240
TILE_FRAMES = 7200
COPY = """
import sys
import pyarrow.parquet as pq
inputs, outputs, copy = sys.argv[1].split(";"), sys.argv[2].split(";"), sys.argv[3]
for path in inputs:
    if path.endswith(".parquet"):
        for batch in pq.ParquetFile(path, pre_buffer=False).iter_batches():
            pass
for path in outputs:
    if path.endswith(".parquet"):
        file = pq.ParquetFile(path, pre_buffer=False)
        with pq.ParquetWriter(copy, file.schema_arrow, compression="zstd", compression_level=3) as writer:
            for batch in file.iter_batches():
                writer.write_batch(batch)
"""


def run(minutes: Sequence[float] = (1, 60)) -> Iterator[TextTable]:
    """Give the table, for recordings of these lengths."""
    rows: list[tuple[Cell, ...]] = []
    for length in minutes:
        with tempfile.TemporaryDirectory() as name:
            study = Study(Path(name), [OWN_MODEL, "whole-hand"])
            write_long_recording(study.folder / "long.parquet", length)
            study.write([("01", "right", TASK, "both", "long.parquet")])
            study.run()
            for job in study.jobs():
                usage = study.run_job(job)
                copied = usage.processor_s / _copy(study, job).processor_s
                cpu_s = usage.processor_s
                rows.append((job.rule, length, cpu_s, cpu_s / length, usage.memory_mb, copied))
    yield TextTable(
        f"long_recordings: 16 receivers at {RATE_HZ} Hz, models {OWN_MODEL} and whole-hand, a job a process",
        ("rule", "minutes:g", "CPU s:.2f", "CPU s a minute:.3f", "most memory MB:.0f", "x copying:.1f"),
        rows,
        "A simulated hand's half minute over and over. CPU seconds of all threads and the most memory that "
        "was resident, start-up counted. Copying is a process that reads the job's tables with pyarrow, "
        "reads the tables that the job writes and writes them again.",
    )


def _copy(study: Study, job: Job) -> Usage:
    files = [";".join(paths) for paths in (job.inputs, job.outputs)]
    return run_process([sys.executable, "-c", COPY, *files, "copy"], study.folder)


def write_long_recording(path: Path, minutes: float) -> None:
    """Write a tidy recording (Parquet) of that length: a simulated right hand's half minute over and over."""
    tile_path = path.with_name(f"tile-{path.name}")
    write_recording(tile_path, simulate("01", "right", TASK, 7, Realism.full(), TILE_FRAMES))
    tile = pq.read_table(tile_path)
    tile_path.unlink()
    receivers = len(tile["segment"].unique())
    frames = round(minutes * 60 * RATE_HZ)
    with pq.ParquetWriter(path, tile.schema) as writer:
        for start in range(0, frames, TILE_FRAMES):
            moved = tile
            for name, offset in (("frame", start), ("time_s", start / RATE_HZ)):
                index = tile.schema.get_field_index(name)
                moved = moved.set_column(index, name, pa.array(tile[name].to_numpy() + offset))
            writer.write_table(moved.slice(0, (frames - start) * receivers))
