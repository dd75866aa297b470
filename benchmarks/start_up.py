"""Every stage as a process: what its --help costs, and a job on tiny data."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks import stage_chain
from benchmarks.interleaved import compare
from benchmarks.stage_chain import Job
from benchmarks.text_table import Cell, TextTable

ROOT = Path(__file__).resolve().parent.parent
BASELINE = "import numpy, pyarrow.parquet"
EMPTY = "python -c pass"
MODEL = "paper-fig4"
WITH_PANDAS = "solve_joints"
FRAMES = 240

_STUDY = f"""
study: tiny
recordings: recordings.tsv
layout: {stage_chain.LAYOUT}
models: [{MODEL}]
"""
_SHEET = "subject\thand\ttask\trole\tfile\n01\tright\topposition\tboth\trecording.parquet\n"


def run(rounds: int = 7) -> Iterator[TextTable]:
    """Give both tables."""
    helps = {f"{stage} --help": _process(["-m", f"stages.{stage}", "--help"]) for stage in stages()}
    helps["capture import --help"] = _process(["-m", "stages.capture", "import", "--help"])
    yield _table(
        "start_up: --help of every stage, a process each",
        helps,
        rounds,
        "What a stage costs before it does anything: parsing words imports neither numpy nor pyarrow.",
    )
    with tempfile.TemporaryDirectory() as folder:
        without = _without_pandas(Path(folder, "without"))
        words = {job.stage: ["-m", f"stages.{job.stage}", *job.words] for job in tiny(Path(folder))}
        jobs = {stage: _process(own, without) for stage, own in words.items()}
        for work in jobs.values():
            work()  # in order: each reads what the one before wrote
        jobs[f"{WITH_PANDAS}, pandas about"] = _process(words[WITH_PANDAS])
        yield _table(
            f"start_up: a whole job of every stage, {FRAMES} frames, a process each",
            jobs,
            rounds,
            "What the smallest job costs; a study pays this for every job, whatever the data. pyarrow "
            "imports pandas where it is installed, as beside the tests, not for users: all rows but the last "
            "are without it.",
        )


def stages() -> list[str]:
    """Every stage that has a command line."""
    return sorted(path.parent.name for path in (ROOT / "stages").glob("*/__main__.py"))


def tiny(folder: Path) -> list[Job]:
    """One recording through every stage, as a study of its own."""
    recording, results = folder / "recording.parquet", folder / "results" / "tiny"
    poses = results / "sub-01" / "right" / "opposition" / "poses.parquet"
    hand = results / "models" / MODEL / "sub-01" / "right"
    study = folder / "tiny.yaml"
    study.write_text(_STUDY, "utf-8")
    (folder / "recordings.tsv").write_text(_SHEET, "utf-8")
    scores = results / "hands" / "sub-01" / "right"
    simulated = "--subject=01", "--hand=right", "--task=opposition", f"--frames={FRAMES}"
    whole = "--study", str(study), "--results", str(results)
    return [
        Job("simulate", (*simulated, f"--out={recording}")),
        stage_chain.capture(recording, poses, "right", "opposition"),
        stage_chain.advice(poses, scores),
        *stage_chain.joints(hand, MODEL, poses),
        stage_chain.whole_hand(hand / "projected_joints.parquet", folder / "fitted", poses),
        *stage_chain.skeleton(hand / "projected_joints.parquet", hand, MODEL, poses, [poses]),
        stage_chain.scores(hand, scores, poses),
        Job("gather", whole),
        Job("report", (*whole, "--out", str(results / "report.html"))),
        Job("draw_figures", (*whole, "--out", str(results / "figures"))),
        Job("export", _export(whole, results / "exports")),
    ]


def _export(whole: tuple[str, ...], out: Path) -> tuple[str, ...]:
    of = "--subject=01", "--hand=right", "--recording=opposition", f"--model={MODEL}"
    return (*whole, *of, "--formats=bvh,glb,osim,c3d,csv", f"--out={out}")


def _without_pandas(folder: Path) -> Path:
    """Make a folder whose pandas cannot be imported, to go before the installed one."""
    folder.mkdir()
    (folder / "pandas.py").write_text('raise ImportError("kept out")', "utf-8")
    return folder


def _process(words: list[str], *before: Path) -> Callable[[], object]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, [*before, ROOT]))}
    command = [sys.executable, *words]

    def work() -> None:
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")

    return work


def _table(title: str, work: dict[str, Callable[[], object]], rounds: int, meaning: str) -> TextTable:
    rivals = {EMPTY: _process(["-c", "pass"]), BASELINE: _process(["-c", BASELINE]), **work}
    found = compare(rivals, BASELINE, rounds, turn_s=0.0)
    rows: list[tuple[Cell, ...]] = [(name, timing.seconds, timing.ratio) for name, timing in found.items()]
    return TextTable(
        f"{title}, {rounds} rounds in turns",
        (("process", ""), ("median s", ".3f"), (f"x python -c '{BASELINE}'", ".2f")),
        rows,
        meaning,
    )
