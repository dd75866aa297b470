"""Cost of whole studies, of a change to a study, and of fitting, posing and judging a hand."""

from __future__ import annotations

import argparse
import os
import re
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median

from benchmarks.benchmark_table import Cell, PrintedTable, Usage, run_python, run_study
from shukotsu.fit.fingertips import fingertips
from shukotsu.fit.fit import fit_hand
from shukotsu.fit.fitted_motion import pose_hand
from shukotsu.fit.frame_uncertainty import posed_errors
from shukotsu.fit.gains import gains
from shukotsu.fit.loose_receivers import displaced_in
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import LAYOUT, simulate
from shukotsu.study.layout import read_layout

WRITTEN_TO = "benchmarks.md", "tables"
SEED, CORES, SIMULATED = 42, 2, 2
"""Seed and cores of studies; so many subjects are simulated, and the others' recordings are copies."""

FRAMES = {"rom": 6000, "opposition": 3774}
ROLES = {"rom": "calibration", "opposition": "evaluation"}
MODELS = "paper-fig3-rest, paper-fig3, paper-fig4, paper-fig4-corrected, rigid, whole-hand"


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--subjects", type=int, nargs="+", default=[1, 10], help="of each study (1 10)")
    parser.add_argument("--rounds", type=int, default=5, help="of each measurement of a hand (5)")


def run(subjects: Sequence[int] = (1, 10), rounds: int = 5) -> Iterator[PrintedTable]:
    """Return the tables; the last study is run again, and with a subject more."""
    with tempfile.TemporaryDirectory() as name:
        simulated, rows = Path(name, "simulated"), list[tuple[Cell, ...]]()
        for index in range(SIMULATED):
            for hand, task in _recordings():
                who = (f"--subject={index}", f"--hand={hand}", f"--task={task}", f"--seed={SEED}")
                file = f"--out={simulated}/{index}_{hand}_{task}.parquet"
                run_python("-m", "shukotsu.simulate", *who, f"--frames={FRAMES[task]}", file)
        for count in subjects:
            folder = Path(name, f"study-{count}")
            rows.append(_row(f"{count} subjects, cold", run_copies(folder, simulated, count)))
        rows.append(_row("then nothing changed", run_copies(folder, simulated, count)))
        rows.append(_row("then a subject more", run_copies(folder, simulated, count + 1)))
    yield PrintedTable(
        f"studies: 6 models, 2 hands x 2 recordings a subject, {CORES} cores",
        ("study", "jobs:d", "s:.1f", "processor s:.0f", "largest process, MB:.0f"),
        rows,
        "The whole workflow, report and figures included; Snakemake's own start and planning too. Recordings "
        f"are 16 receivers, {' and '.join(map(str, FRAMES.values()))} frames, of {SIMULATED} simulated "
        "subjects under as many names as there are subjects.",
    )
    yield hand_table(rounds)


def _recordings() -> Iterator[tuple[str, str]]:
    return ((hand, task) for hand in ("right", "left") for task in ROLES)


def run_copies(folder: Path, simulated: Path, subjects: int) -> Usage:
    """Write a study of so many subjects, recordings linked from those that are simulated, and run it."""
    sheet = ["subject\thand\ttask\trole\tfile"]
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    for index in range(subjects):
        for hand, task in _recordings():
            file = folder / "recordings" / f"{index:04}_{hand}_{task}.parquet"
            if not file.exists():
                os.link(simulated / f"{index % SIMULATED}_{hand}_{task}.parquet", file)
            sheet.append(f"{index:04}\t{hand}\t{task}\t{ROLES[task]}\trecordings/{file.name}")
    (folder / "recordings.tsv").write_text("\n".join(sheet) + "\n", "utf-8")
    text = f"study: study\nrecordings: recordings.tsv\nlayout: liberty16\nmodels: [{MODELS}]\n"
    (folder / "study.yaml").write_text(text, "utf-8")
    return run_study(folder, CORES)


def _row(name: str, usage: Usage) -> tuple[Cell, ...]:
    jobs = re.search(r"^total +(\d+)$", usage.output, re.MULTILINE)
    return name, int(jobs[1]) if jobs else 0, usage.seconds, usage.processor_s, usage.memory_mb


def hand_table(rounds: int) -> PrintedTable:
    """Return what a hand takes."""
    frames = 6000, 4000  # of the calibration and of the task that is posed
    calibration, task = (
        simulate("01", "right", name, 1, Realism(), n).poses() for name, n in zip(ROLES, frames, strict=True)
    )
    layout = read_layout(LAYOUT)
    tips = fingertips(fit_hand([calibration], layout, "right"))
    fit, posed = tips.fit, pose_hand(tips.fit, task)
    frames_of_task, single = fit.evidence.convention.frames(task), task.take(slice(0, 1))
    work: dict[str, tuple[int, Callable[[], object]]] = {
        "fit of a calibration": (0, lambda: fit_hand([calibration], layout, "right")),
        "what was displaced in it": (0, lambda: displaced_in(fit, [calibration])),
        "what a measurement would gain": (0, lambda: gains(tips)),
        "posing": (len(task.frame), lambda: pose_hand(fit, task)),
        "errors of what was posed": (len(task.frame), lambda: posed_errors(tips, posed, frames_of_task)),
        "one frame alone": (1, lambda: pose_hand(fit, single)),
    }
    rows: list[tuple[Cell, ...]] = []
    for name, (count, call) in work.items():
        taken = []
        for _ in range(rounds):
            started = time.process_time()
            call()
            taken.append(time.process_time() - started)
        rows.append((name, 1e3 * median(taken), count / median(taken) if count else None))
    return PrintedTable(
        f"a hand: 16 receivers, {frames[0]} frames calibrated, {frames[1]} posed, {rounds} rounds",
        ("work", "ms:.1f", "frames/s:.0f"),
        rows,
        "Processor time, median.",
    )
