"""A whole hand fitted, posed and judged: processor time, start-up, memory."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from statistics import median

from benchmarks.benchmark_table import Cell, TextTable
from benchmarks.processes import run_process
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.poses import Poses
from shukotsu.stages.fit_hand.fingertips import Fingertips, fingertips
from shukotsu.stages.fit_hand.fit import fit_hand
from shukotsu.stages.fit_hand.fitted_motion import pose_hand
from shukotsu.stages.fit_hand.frame_uncertainty import posed_errors
from shukotsu.stages.fit_hand.gains import gains
from shukotsu.stages.fit_hand.loose_receivers import displaced_in
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.simulation import LAYOUT, simulate

WRITTEN_TO = "benchmarks.md", "hand_cost"
CALIBRATION_FRAMES, TASK_FRAMES = 6000, 4000


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rounds", type=int, default=5, help="of each measurement, in turns (5)")


def run(rounds: int = 5, frames: tuple[int, int] = (CALIBRATION_FRAMES, TASK_FRAMES)) -> Iterator[TextTable]:
    """Give the tables; frames : of the calibration and of the task that is posed."""
    calibration, task = (recorded(name, n) for name, n in zip(("rom", "opposition"), frames, strict=True))
    fit = fit_hand([calibration], read_layout(LAYOUT), "right")
    yield _stages(fingertips(fit), calibration, task, rounds)
    yield _start_up()


def recorded(task: str, n_frames: int) -> Poses:
    """A right hand's recording; all receivers valid."""
    made = simulate("01", "right", task, 1, Realism(), n_frames)
    return made.poses()


def _stages(tips: Fingertips, calibration: Poses, task: Poses, rounds: int) -> TextTable:
    fit, layout = tips.fit, read_layout(LAYOUT)
    one, posed = task.take(slice(0, 1)), pose_hand(fit, task)
    frames = fit.evidence.convention.frames(task)
    seconds = _seconds(
        {
            "fit of a calibration": lambda: fit_hand([calibration], layout, "right"),
            "what was displaced in it": lambda: displaced_in(fit, [calibration]),
            "what a measurement would gain": lambda: gains(tips),
            "posing": lambda: pose_hand(fit, task),
            "errors of what was posed": lambda: posed_errors(tips, posed, frames),
            "one frame alone": lambda: pose_hand(fit, one),
        },
        rounds,
    )
    n, both = len(task.frame), seconds["posing"] + seconds["errors of what was posed"]
    per_s: dict[str, float] = {
        "posing": n / seconds["posing"],
        "errors of what was posed": n / both,
        "one frame alone": 1 / seconds["one frame alone"],
    }
    rows: list[tuple[Cell, ...]] = [(name, 1e3 * own, per_s.get(name)) for name, own in seconds.items()]
    return TextTable(
        f"hand_cost: 16 receivers, {len(calibration.frame)} frames calibrated, {n} posed, {rounds} rounds",
        ("work", "ms:.1f", "frames/s:.0f"),
        rows,
        "Processor time, median. Frames a second of the errors are posing and errors together.",
    )


def _start_up() -> TextTable:
    """Processes that compile, that find what was compiled, and that need none of it."""
    compiling = [sys.executable, "-m", "shukotsu.stages.fit_hand.compile_kernel"]
    with tempfile.TemporaryDirectory() as folder:
        usages = {
            "compiling": run_process(compiling, NUMBA_CACHE_DIR=folder),
            "compiled before": run_process(compiling, NUMBA_CACHE_DIR=folder),
        }
    usages["without compiled code"] = run_process(
        [sys.executable, "-c", "import shukotsu.stages.fit_hand.chain"]
    )
    return TextTable(
        "hand_cost: start of a process that fits hands",
        ("process", "processor s:.2f", "memory MB:.0f"),
        [(name, usage.processor_s, usage.memory_mb) for name, usage in usages.items()],
        "The first is what make demo does once; the last imports chains, which are NumPy, and no more.",
    )


def _seconds(work: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Median processor seconds of each, in turns."""
    taken: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(rounds):
        for name, own in work.items():
            started = time.process_time()
            own()
            taken[name].append(time.process_time() - started)
    return {name: median(own) for name, own in taken.items()}
