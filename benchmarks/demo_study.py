"""The demo study in a folder of its own: cold, again with nothing changed, and after single changes."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import yaml

from benchmarks.text_table import Cell, TextTable

ROOT = Path(__file__).resolve().parent.parent
CORES = 2
CHANGED_MODEL = "paper-fig4"


@dataclass(frozen=True)
class StudyRun:
    """One run of the workflow: seconds by the clock and of the processors, all its processes together;
    jobs by rule (the rule `all` left out).
    """

    seconds: float
    processor_s: float
    jobs: dict[str, int]

    @property
    def n_jobs(self) -> int:
        """Jobs of all rules."""
        return sum(self.jobs.values())


def run() -> Iterator[TextTable]:
    """Give the one table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        study = copy_study(folder)
        runs = {"cold, recordings simulated too": run_study(folder, study)}
        runs["again, nothing changed"] = run_study(folder, study)
        for what, change in changes(study).items():
            change()
            runs[f"after changing {what}"] = run_study(folder, study)
    whole = runs["cold, recordings simulated too"].processor_s
    rows: list[tuple[Cell, ...]] = [
        (what, done.n_jobs, done.seconds, done.processor_s, done.processor_s / whole, _by_rule(done.jobs))
        for what, done in runs.items()
    ]
    config = yaml.safe_load((ROOT / "config" / "demo.yaml").read_text("utf-8"))
    yield TextTable(
        f"demo_study: {len(config['models'])} skeleton models, {CORES} cores",
        (
            ("run", ""),
            ("jobs", "d"),
            ("s", ".0f"),
            ("processor s", ".0f"),
            ("of cold", ".2f"),
            ("jobs by rule", ""),
        ),
        rows,
        "The whole workflow, once each, Snakemake's own start included: a change reruns what depends on it "
        "and nothing else. Jobs are exact; seconds by the clock suffer from whatever else runs, so the ratio "
        "is of processor time. Where pandas is installed, jobs are slower (see start_up).",
    )


def copy_study(folder: Path) -> Path:
    """Put the study's files into a folder, one model's file among them; give the study file.

    The folders inside are those of the project, so the study's relative paths stay as they are.
    """
    shutil.copytree(
        ROOT / "data" / "demo", folder / "data" / "demo", ignore=shutil.ignore_patterns("recordings")
    )
    (folder / "config").mkdir()
    model = Path("models", f"{CHANGED_MODEL}.yaml")
    (folder / "config" / "models").mkdir()
    shutil.copy(ROOT / "config" / model, folder / "config" / model)
    config = yaml.safe_load((ROOT / "config" / "demo.yaml").read_text("utf-8"))
    config["models"] = [model.as_posix() if name == CHANGED_MODEL else name for name in config["models"]]
    study = folder / "config" / "demo.yaml"
    study.write_text(yaml.safe_dump(config, sort_keys=False), "utf-8")
    return study


def changes(study: Path) -> dict[str, Callable[[], None]]:
    """Single changes to a study that was run, by what is changed."""
    recordings = study.parent.parent / "data" / "demo" / "recordings"
    solved = recordings / "sub-01_hand-right_task-opposition.parquet"
    replayed = recordings / "sub-01_hand-right_task-rom.parquet"
    model = study.parent / "models" / f"{CHANGED_MODEL}.yaml"
    return {
        "a recording that is solved and replayed": lambda: drop_last_frame(solved),
        "a recording that is only replayed": lambda: drop_last_frame(replayed),
        "a skeleton model": lambda: halve_twist(model),
    }


def drop_last_frame(recording: Path) -> None:
    """Write a recording again without its last frame."""
    table: pa.Table = pq.read_table(recording)
    frame = table.column("frame")
    pq.write_table(table.filter(pc.less(frame, pc.max(frame))), recording)


def halve_twist(model: Path) -> None:
    """Change the factor of Eq. 11 in a model's file."""
    config = yaml.safe_load(model.read_text("utf-8"))
    config.setdefault("metacarpals", {})["twist_factor"] = 0.5
    model.write_text(yaml.safe_dump(config, sort_keys=False), "utf-8")


def run_study(folder: Path, study: Path) -> StudyRun:
    """Run the workflow in the folder; RuntimeError where it fails."""
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")]
    command += ["--directory", str(folder), "--configfile", str(study), "--cores", str(CORES)]
    started, before = time.perf_counter(), os.times()
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)
    seconds, after = time.perf_counter() - started, os.times()
    processor_s = sum(after[2:4]) - sum(before[2:4])  # user and system time of child processes
    if done.returncode:
        raise RuntimeError(f"snakemake ended with {done.returncode}:\n{done.stderr[-4000:]}")
    return StudyRun(seconds, processor_s, jobs_by_rule(done.stdout + done.stderr))


def jobs_by_rule(log: str) -> dict[str, int]:
    """Read Snakemake's first table of job counts; empty where it had nothing to do."""
    if "Nothing to be done" in log:
        return {}
    found = re.search(r"^Job stats:\n.*\n[- ]+\n((?:.+\n)+?)total ", log, re.MULTILINE)
    if found is None:
        raise RuntimeError(f"no job counts in Snakemake's log:\n{log[-4000:]}")
    counts = dict(line.split()[:2] for line in found[1].splitlines())
    return {rule: int(count) for rule, count in counts.items() if rule != "all"}


def _by_rule(jobs: dict[str, int]) -> str:
    return ", ".join(f"{rule} {count}" for rule, count in jobs.items()) or "none"
