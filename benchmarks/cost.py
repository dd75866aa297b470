"""Cost of studies and their stages, of changes to a study, and of fitting, posing and judging a hand."""

from __future__ import annotations

import argparse
import os
import re
import tempfile
import time
import timeit
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.benchmark_table import PrintedTable, Row, Usage, run_python, run_study
from benchmarks.measured_jobs import KINDS, measured_jobs
from shukotsu import job
from shukotsu.fit.fingertips import fingertips
from shukotsu.fit.fit import fit_hand
from shukotsu.fit.fitted_motion import pose_hand
from shukotsu.fit.frame_uncertainty import posed_errors
from shukotsu.fit.gains import gains
from shukotsu.fit.loose_receivers import displaced_in
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import LAYOUT, simulate
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import RecordingName

WRITTEN_TO = "benchmarks.md", "tables"
SEED, CORES, SIMULATED = 42, 2, 2
"""Seed and cores of studies, and number of simulated subjects; recordings of other subjects are copies."""

FRAMES = {"rom": 6000, "opposition": 3774}
ROLES = {"rom": "calibration", "opposition": "evaluation"}
RECORDINGS = [(hand, task) for hand in ("right", "left") for task in ROLES]
MODELS = "paper-fig3-rest, paper-fig3, paper-fig4, paper-fig4-corrected, rigid, whole-hand"


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--subjects", type=int, nargs="+", default=[1, 10], help="subjects per study (1 10)")
    parser.add_argument("--models", default=MODELS, help=f"models of each study ({MODELS})")
    parser.add_argument("--rounds", type=int, default=5, help="repetitions of each measurement of a hand (5)")


def run(subjects: Sequence[int], models: str, rounds: int) -> Iterator[PrintedTable]:
    """Yield the tables; the last study is run again unchanged, then with one more subject.

    rounds : repetitions of the measurements of a hand; 0 leaves them out.
    """
    with tempfile.TemporaryDirectory() as name:
        simulated, rows = Path(name, "simulated"), list[Row]()
        for index in range(SIMULATED):
            for hand, task in RECORDINGS:
                who = (f"--subject={index}", f"--hand={hand}", f"--task={task}", f"--seed={SEED}")
                file = f"{simulated}/{index}_{hand}_{task}"
                frames = f"--frames={FRAMES[task]}"
                run_python("stages/simulate.py", *who, frames, f"--out={file}.parquet")
                recording = f"--recording={file}.parquet", "--layout=liberty16"
                run_python("stages/stream.py", *recording, f"--out={file}.arrows")
        for count in subjects:
            folder, jobs = Path(name, f"study-{count}"), list[dict[str, Any]]()
            with measured_jobs(jobs) as address:
                usage = run_copies(folder, simulated, count, models, **{job.ADDRESS: address})
            rows.append(_row(f"{count} subjects, cold", usage, jobs))
            yield stage_table(f"{count} subjects", folder, jobs, usage)
        rows.append(_row("then nothing changed", run_copies(folder, simulated, count, models)))
        rows.append(_row("then a subject more", run_copies(folder, simulated, count + 1, models)))
    yield PrintedTable(
        f"studies: {len(models.split(','))} models, 2 hands x 2 recordings a subject, {CORES} cores",
        ("study", "jobs:d", "s:.1f", "processor s:.0f", "largest process, MB:.0f"),
        rows,
        "The whole workflow, including report and figures and Snakemake's start and planning. Recordings are "
        f"raw captures of 16 receivers with {' and '.join(map(str, FRAMES.values()))} frames of {SIMULATED} "
        "simulated subjects, which are reused for all subjects. Of cold studies memory is not measured.",
    )
    if rounds:
        yield hand_table(rounds)


def stage_table(name: str, folder: Path, jobs: Sequence[dict[str, Any]], usage: Usage) -> PrintedTable:
    """Return the time of each stage's jobs, and the time that pyarrow alone takes for their files."""
    rows: list[Row] = []
    for stage in dict.fromkeys(each["stage"] for each in jobs):
        of_stage = [each for each in jobs if each["stage"] == stage]
        taken = [sum(each.get(kind, 0.0) for each in of_stage) for kind in KINDS]
        rows.append((stage, len(of_stage), sum(taken), *taken, sum(_floor_s(folder, e) for e in of_stage)))
    rows.append(("Snakemake, scheduling of jobs", len(jobs), usage.processor_s, None, None, None, None))
    rows.append(("all", len(jobs), usage.processor_s + _work_s(jobs), None, None, None, None))
    return PrintedTable(
        f"stages of a study: {name}",
        ("stage", "jobs:d", "processor s:.2f", "start:.2f", "files:.2f", "arithmetic:.2f", "floor:.2f"),
        rows,
        "Start: fork and imports. Files: reading, decoding and writing. Floor: time that pyarrow alone takes "
        "to read the Parquet files and captures that the command line names, and to write the outputs again.",
    )


def _floor_s(folder: Path, of_job: dict[str, Any]) -> float:
    """Return the processor seconds in which pyarrow reads a job's inputs and writes its outputs."""
    written, seconds = False, 0.0
    for word in of_job["argv"]:
        value = word
        if word.startswith("--"):
            option, _, value = word.partition("=")
            written = option.startswith("--out")
        path = folder / value
        for file in path.glob("*.parquet") if path.is_dir() and value and written else [path]:
            started = time.process_time()
            if file.suffix == ".parquet" and file.is_file():
                table = pq.read_table(file, use_threads=False)
                if written:
                    started = time.process_time()
                    pq.write_table(table, pa.BufferOutputStream())
            elif file.suffix == ".arrows" and file.is_file():
                pa.ipc.open_stream(file).read_all()
            seconds += time.process_time() - started
    return seconds


def run_copies(folder: Path, simulated: Path, subjects: int, models: str, **environment: str) -> Usage:
    """Write a study with links to the simulated recordings for each subject, and run it."""
    sheet = ["subject\thand\ttask\trole\tfile"]
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    for index in range(subjects):
        for hand, task in RECORDINGS:
            file = folder / "recordings" / f"{index:04}_{hand}_{task}.arrows"
            if not file.exists():
                os.link(simulated / f"{index % SIMULATED}_{hand}_{task}.arrows", file)
            sheet.append(f"{index:04}\t{hand}\t{task}\t{ROLES[task]}\trecordings/{file.name}")
    (folder / "recordings.tsv").write_text("\n".join(sheet) + "\n", "utf-8")
    text = f"study: study\nrecordings: recordings.tsv\nlayout: liberty16\nmodels: [{models}]\n"
    (folder / "study.yaml").write_text(text, "utf-8")
    return run_study(folder, CORES, **environment)


def _work_s(jobs: Sequence[dict[str, Any]]) -> float:
    return float(sum(each.get(kind, 0.0) for each in jobs for kind in KINDS))


def _row(name: str, usage: Usage, measured: Sequence[dict[str, Any]] = ()) -> Row:
    """Return a study's row; measured : jobs of a process outside `usage`, whose memory is not measured."""
    jobs = re.search(r"^total +(\d+)$", usage.output, re.MULTILINE)
    processor_s, memory_mb = usage.processor_s + _work_s(measured), None if measured else usage.memory_mb
    return name, int(jobs[1]) if jobs else 0, usage.seconds, processor_s, memory_mb


def hand_table(rounds: int) -> PrintedTable:
    """Return the processor time of fitting, posing and judging a hand."""
    frames = 6000, 4000  # frames of the calibration, and of the task that is posed
    calibration, task = (
        simulate(RecordingName("01", "right", name), 1, Realism(), n)
        for name, n in zip(ROLES, frames, strict=True)
    )
    layout = read_layout(LAYOUT)
    tips = fingertips(fit_hand([calibration], layout, "right"))
    fit, posed = tips.fit, pose_hand(tips.fit, task)
    frames_of_task, single = fit.convention.frames(task), task.take(slice(0, 1))
    work: dict[str, tuple[int, Callable[[], object]]] = {
        "fit of a calibration": (0, lambda: fit_hand([calibration], layout, "right")),
        "displacements in it": (0, lambda: displaced_in(fit, [calibration])),
        "gains of measurements": (0, lambda: gains(tips)),
        "posing": (len(task.frame), lambda: pose_hand(fit, task)),
        "errors of the posed frames": (len(task.frame), lambda: posed_errors(tips, posed, frames_of_task)),
        "posing of a single frame": (1, lambda: pose_hand(fit, single)),
    }
    rows: list[Row] = []
    for name, (count, call) in work.items():
        taken_s = median(timeit.repeat(call, timer=time.process_time, repeat=rounds, number=1))
        rows.append((name, 1e3 * taken_s, count / taken_s if count else None))
    title = f"a hand: 16 receivers, {frames[0]} frames calibrated, {frames[1]} posed, {rounds} rounds"
    return PrintedTable(title, ("work", "ms:.1f", "frames/s:.0f"), rows, "Processor time, median.")
