"""Recordings of any length through the stages, each a process: CPU seconds a minute, and memory."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks import stage_chain
from benchmarks.stage_chain import Job
from benchmarks.text_table import TextTable
from schemas.results import Results
from schemas.study import read_study
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import simulate

ROOT = Path(__file__).resolve().parent.parent
MODEL, TASK = "paper-fig4", "opposition"
RATE_HZ = 240
TILE_FRAMES = 7200
STAGES = ("capture", "solve_joints", "estimate_metacarpals", "evaluate_tips", "export")
COPY = """
import sys
import pyarrow.parquet as pq
inputs, outputs, copy = sys.argv[1].split(";"), sys.argv[2].split(";"), sys.argv[3]
for path in inputs:
    for batch in pq.ParquetFile(path, pre_buffer=False).iter_batches():
        pass
for path in outputs:
    if path.endswith(".parquet"):
        file = pq.ParquetFile(path, pre_buffer=False)
        with pq.ParquetWriter(copy, file.schema_arrow, compression="zstd", compression_level=3) as writer:
            for batch in file.iter_batches():
                writer.write_batch(batch)
    else:
        with open(path, "rb") as source, open(copy, "wb") as target:
            while piece := source.read(1 << 20):
                target.write(piece)
"""

LAUNCH = """
import os, sys
silent = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
child = os.posix_spawn(sys.executable, [sys.executable, *sys.argv[1:]], os.environ, file_actions=silent)
_, status, usage = os.wait4(child, 0)
print(os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime, usage.ru_maxrss)
"""
# A process of its own, small: Linux counts what the parent had when it forked as the child's memory.


def run(minutes: Sequence[float] = (1, 60), stages: Sequence[str] = STAGES) -> Iterator[TextTable]:
    """Give the table.

    minutes : lengths of the recordings. stages : those of STAGES that are measured; what they need is made.
    """
    rows = []
    for length in minutes:
        with tempfile.TemporaryDirectory() as name:
            for measured in _measured(Path(name), length, stages):
                cpu_s, copied = measured.run.cpu_s, measured.copy.cpu_s
                memory = measured.run.memory_mb, measured.copy.memory_mb
                rows.append((measured.stage, length, cpu_s, cpu_s / length, *memory, cpu_s / copied))
    yield TextTable(
        f"long_recordings: 16 receivers at {RATE_HZ} Hz, model {MODEL}, each stage a process",
        (
            ("stage", ""),
            ("minutes", "g"),
            ("CPU s", ".2f"),
            ("CPU s a minute", ".3f"),
            ("most memory MB", ".0f"),
            ("copy's memory MB", ".0f"),
            ("x copying", ".1f"),
        ),
        rows,
        "A simulated hand's half minute over and over. CPU seconds of all threads and the most memory that "
        "was resident, start-up counted. Copying is a process that reads the stage's tables with pyarrow, "
        "reads what the stage writes and writes it again.",
    )


@dataclass(frozen=True)
class Run:
    """One process: CPU seconds of it and of all its threads, and the most memory it had."""

    cpu_s: float
    memory_mb: float


@dataclass(frozen=True)
class _Measured:
    stage: str
    run: Run
    copy: Run


def process(words: Sequence[str]) -> Run:
    """Run Python on the words in the repository's folder; RuntimeError where it fails."""
    launched = subprocess.run(
        [sys.executable, "-c", LAUNCH, *words],
        cwd=ROOT,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    status, cpu_s, memory_kib = launched.stdout.split()
    if int(status):
        raise RuntimeError(f"{' '.join(words)} ended with {status}")
    return Run(float(cpu_s), int(memory_kib) * 1024 / 1e6)


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
            frame = pa.array(tile["frame"].to_numpy() + start)
            time_s = pa.array(tile["time_s"].to_numpy() + start / RATE_HZ)
            moved = tile.set_column(tile.schema.get_field_index("frame"), "frame", frame)
            moved = moved.set_column(tile.schema.get_field_index("time_s"), "time_s", time_s)
            writer.write_table(moved.slice(0, (frames - start) * receivers))


@dataclass(frozen=True)
class LongHand:
    """One hand's study with a recording of any length, whose tables its jobs make one after the other."""

    folder: Path

    @property
    def recording(self) -> Path:
        """The tidy recording."""
        return self.folder / "recording.parquet"

    @property
    def bvh(self) -> Path:
        """What the last job writes."""
        return self.folder / f"sub-01_hand-right_task-{TASK}_model-{MODEL}.bvh"

    def write(self, minutes: float) -> None:
        """Write the recording, its sheet and the study."""
        write_long_recording(self.recording, minutes)
        sheet = f"subject\thand\ttask\trole\tfile\n01\tright\t{TASK}\tboth\t{self.recording.name}\n"
        (self.folder / "sheet.tsv").write_text(sheet, "utf-8")
        layout = f"layout: {stage_chain.LAYOUT}\nmodels: [{MODEL}]\n"
        (self.folder / "study.yaml").write_text(f"study: long\nrecordings: sheet.tsv\n{layout}", "utf-8")

    def jobs(self) -> Iterator[tuple[Job, list[Path], list[Path]]]:
        """Give every job, in order, with the tables that it reads and the files that it writes."""
        results, (recording,) = self._results, read_study(self.folder / "study.yaml").recordings
        poses, skeleton = results.poses(recording), results.skeleton(MODEL, recording.hand)
        solve, project = stage_chain.joints(skeleton, MODEL, poses)
        projected = skeleton / "projected_joints.parquet"
        metacarpals, tips = stage_chain.skeleton(projected, skeleton, MODEL, poses, [poses])
        tables = {name: skeleton / f"{name}.parquet" for name in ("metacarpals", "tips", "joint_solutions")}
        yield stage_chain.capture(self.recording, poses, "right", TASK), [self.recording], [poses]
        yield solve, [poses], [tables["joint_solutions"]]
        yield project, [tables["joint_solutions"]], [projected]
        yield metacarpals, [poses], [tables["metacarpals"]]
        yield tips, [poses, tables["metacarpals"]], [tables["tips"]]
        yield self.export("bvh", self.folder), [poses, tables["metacarpals"]], [self.bvh]

    def export(self, formats: str, out: Path) -> Job:
        """Tables -> files of those formats, in the folder `out`."""
        study = f"--study={self.folder / 'study.yaml'}", f"--results={self._results.folder}"
        what = "--subject=01", "--hand=right", f"--recording={TASK}", f"--model={MODEL}"
        return Job("export", (*study, *what, "--gaps=hold", f"--formats={formats}", f"--out={out}"))

    @property
    def _results(self) -> Results:
        return Results(self.folder / "results")


def _measured(folder: Path, minutes: float, stages: Sequence[str]) -> Iterator[_Measured]:
    """Run the jobs up to the last of the stages that is wanted; give what each of these took."""
    hand = LongHand(folder)
    hand.write(minutes)
    left = set(stages)
    for job, inputs, outputs in hand.jobs():
        if not left:
            return
        ran = process(["-m", f"stages.{job.stage}", *job.words])
        if job.stage in left:
            left.remove(job.stage)
            files = [";".join(map(str, paths)) for paths in (inputs, outputs)]
            yield _Measured(job.stage, ran, process(["-c", COPY, *files, str(folder / "copy")]))
            (folder / "copy").unlink()
