"""A study of thousands on a cluster: what it will cost, from the demo's jobs and small dry runs."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import ceil
from pathlib import Path

from benchmarks.demo_study import ROOT, copy_study, run_study
from benchmarks.text_table import Cell, TextTable
from stages import job

DEMO_SUBJECTS = 2
PLANNED, PLANNED_INSIDE = (5, 20, 80), (20, 320, 1280)
"""Subjects of the studies that are planned, not run, to see how Snakemake's own cost grows: by what submits
them all, and by what runs inside one subject's job."""
GATHERED = (4, 8)
"""Subjects of the studies whose tables are gathered to see how its memory grows."""
JOB_CORES = 2  # as in config/profiles/slurm
SHARD, SHARD_CORES = 100, 16
WHOLE_STUDY = ("gather", "report", "draw_figures")
ONLY_SIMULATED = ("simulate", "capture emulate")
LIMITS = {
    "gather's memory, a node of 64 GB": ("gather_mb", 64_000.0),
    "memory of the Snakemake that submits, 16 GB": ("plan_mb", 16_000.0),
    "an hour until the first job is submitted": ("plan_s", 3600.0),
    "a quota of a million files": ("files", 1e6),
}
TIMED = (
    'if [ -z "${{TIMED:-}}" ]; then TIMED=1 exec "{python}" "{timer}" "{log}" "$BASH_EXECUTION_STRING"; fi'
)
"""Read by every bash that runs a job: the job is run again below a process that writes down what it took."""
TIMER = """
import resource, subprocess, sys
code = subprocess.call(["bash", "-c", sys.argv[2]])
took = resource.getrusage(resource.RUSAGE_CHILDREN)
command = " ".join(sys.argv[2].split())
with open(sys.argv[1], "a") as log:
    print(took.ru_utime + took.ru_stime, took.ru_maxrss / 1024, command, sep="\\t", file=log)
sys.exit(code)
"""
MEASURED = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, capture_output=True)
took = resource.getrusage(resource.RUSAGE_CHILDREN)
print(took.ru_utime + took.ru_stime, took.ru_maxrss / 1024)
"""


@dataclass(frozen=True)
class Line:
    """What grows with the subjects: its value for none, and what each adds."""

    none: float
    each: float

    def at(self, subjects: float) -> float:
        """Value for so many subjects."""
        return self.none + self.each * subjects

    def reaches(self, value: float) -> float:
        """Subjects at which it reaches the value."""
        return max(0.0, (value - self.none) / self.each) if self.each else float("inf")


@dataclass(frozen=True)
class Costs:
    """Of one rule: jobs in the demo, mean processor seconds of one, the largest's memory in MB."""

    jobs: int
    processor_s: float
    memory_mb: float


def run(subjects: int = 10_000, cores: int = 200) -> Iterator[TextTable]:
    """Give the tables: what was measured, what follows for the study, and what ends first."""
    with tempfile.TemporaryDirectory() as name:
        rules, grows = _demo(Path(name, "demo"))
        grows |= _plans(Path(name, "plans"))
    yield _measured(rules)
    yield _grown(grows)
    yield _ways(rules, grows, subjects, cores)
    yield _ends(grows)


def _demo(folder: Path) -> tuple[dict[str, Costs], dict[str, Line]]:
    """Run the demo in the folder; give its rules' costs, and what of its results grows with the subjects."""
    folder.mkdir(parents=True)
    study, log = copy_study(folder), folder / "costs"
    with _every_job_timed(folder, log):
        run_study(folder, study)
    rules = _costs(log)
    results = folder / "results" / "demo"
    notes = folder / ".snakemake" / "metadata"  # Snakemake's own, a file an output
    files = [path for place in (results, notes) for path in place.rglob("*") if path.is_file()]
    gathered = _fitted(GATHERED, [_gather_mb(folder, study, count) for count in GATHERED])
    return rules, {
        "files": Line(0.0, len(files) / DEMO_SUBJECTS),
        "megabytes": Line(0.0, sum(path.stat().st_size for path in files) / 1e6 / DEMO_SUBJECTS),
        "gather_mb": gathered,
    }


@contextmanager
def _every_job_timed(folder: Path, log: Path) -> Iterator[None]:
    """Let Snakemake's jobs write their processor seconds, MB and command into a log, each a process of its
    own as on a cluster.
    """
    timed, timer = folder / "timed.sh", folder / "timer.py"
    timer.write_text(TIMER, "utf-8")
    timed.write_text(TIMED.format(python=sys.executable, timer=timer, log=log), "utf-8")
    changed = {"BASH_ENV": str(timed), job.ADDRESS: "none"}
    os.environ |= changed
    try:
        yield
    finally:
        for name in changed:
            del os.environ[name]


def _costs(log: Path) -> dict[str, Costs]:
    found: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for line in log.read_text("utf-8").splitlines():
        processor_s, memory_mb, command = line.split("\t", 2)
        stage = re.search(r"-m stages\.(?:job )?(?:each )?(capture \w+|[\w.]+)", command)
        if stage is not None:
            found[stage[1]].append((float(processor_s), float(memory_mb)))
    return {
        stage: Costs(len(jobs), sum(s for s, _ in jobs) / len(jobs), max(mb for _, mb in jobs))
        for stage, jobs in found.items()
    }


def _gather_mb(folder: Path, study: Path, subjects: int) -> float:
    """Largest memory of gather on so many copies of the demo's first subject."""
    sheet, results = folder / "data" / "demo" / "recordings.tsv", folder / "results" / "demo"
    whole = sheet.read_text("utf-8")
    head, *rows = whole.splitlines(keepends=True)
    first = rows[0].split("\t")[0]
    names = [f"copy-{index}" for index in range(subjects)]
    for own in [path for path in results.rglob(f"sub-{first}") if "logs" not in path.parts]:
        for name in names:
            shutil.copytree(own, own.with_name(f"sub-{name}"), dirs_exist_ok=True)
    mine = [row.removeprefix(first) for row in rows if row.startswith(f"{first}\t")]
    sheet.write_text(head + "".join(name + row for name in names for row in mine), "utf-8")
    memory_mb = _measure(["-m", "stages.gather", "--study", str(study), "--results", str(results)])[1]
    sheet.write_text(whole, "utf-8")
    return memory_mb


def _measure(words: list[str]) -> tuple[float, float]:
    """Processor seconds and largest MB of a Python process with these words."""
    command = [sys.executable, "-c", MEASURED, sys.executable, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    processor_s, memory_mb = done.stdout.split()
    return float(processor_s), float(memory_mb)


def _plans(folder: Path) -> dict[str, Line]:
    """Plan studies of several sizes without running them: what submits all, and what runs inside a job."""
    whole = [_dry_run(_empty_study(folder / f"{n}", n)) for n in PLANNED]
    one = "results/big/report/sub-00000"
    inside = [_dry_run(_empty_study(folder / f"{n}-inside", n), one)[0] for n in PLANNED_INSIDE]
    return {
        "plan_s": _fitted(PLANNED, [seconds for seconds, _ in whole]),
        "plan_mb": _fitted(PLANNED, [memory_mb for _, memory_mb in whole]),
        "start_s": _fitted(PLANNED_INSIDE, inside),
    }


def _empty_study(folder: Path, subjects: int) -> Path:
    """A study like the demo whose recordings are there, but empty; give its file."""
    folder.mkdir(parents=True)
    rows = ["subject\thand\ttask\trole\tfile"]
    for subject in range(subjects):
        for hand in ("right", "left"):
            for task, role in (("opposition", "both"), ("rom", "calibration")):
                file = folder / f"{subject:05}_{hand}_{task}.csv"
                file.touch()
                rows.append(f"{subject:05}\t{hand}\t{task}\t{role}\t{file.name}")
    (folder / "big.tsv").write_text("\n".join(rows) + "\n", "utf-8")
    demo = (ROOT / "config" / "demo.yaml").read_text("utf-8")
    models = next(line for line in demo.splitlines() if line.startswith("models:"))
    study = folder / "big.yaml"
    study.write_text(f"study: big\nrecordings: big.tsv\nlayout: liberty16\n{models}\n", "utf-8")
    return study


def _dry_run(study: Path, *targets: str) -> tuple[float, float]:
    """Processor seconds and MB of a dry run."""
    words = ["-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"), "--directory", str(study.parent)]
    words += [*targets, "--configfile", str(study), "--cores", "1", "--dry-run", "--quiet", "all"]
    return _measure(words)


def _fitted(subjects: Sequence[int], values: Sequence[float]) -> Line:
    """Line of least squares; level where it would fall, which is noise: nothing gets cheaper by more."""
    middle, mean = sum(subjects) / len(subjects), sum(values) / len(values)
    each = sum((n - middle) * (value - mean) for n, value in zip(subjects, values, strict=True))
    each = max(0.0, each / sum((n - middle) ** 2 for n in subjects))
    return Line(mean - each * middle, each)


def _measured(rules: dict[str, Costs]) -> TextTable:
    rows: list[tuple[Cell, ...]] = [
        (stage, costs.jobs, costs.processor_s, costs.jobs * costs.processor_s, costs.memory_mb)
        for stage, costs in rules.items()
    ]
    return TextTable(
        f"cluster_plan: the demo's jobs, {DEMO_SUBJECTS} subjects, 4 recordings of 16 or 30 s each",
        (("stage", ""), ("jobs", "d"), ("mean s", ".2f"), ("all s", ".0f"), ("largest MB", ".0f")),
        rows,
        "Processor seconds, start-up included. simulate and capture emulate are left out below: a study of "
        "people has their recordings.",
    )


def _grown(grows: dict[str, Line]) -> TextTable:
    words = {
        "plan_s": "Snakemake until it submits, processor s",
        "plan_mb": "the same, MB",
        "start_s": "Snakemake inside each job of a group, processor s",
        "gather_mb": "gather, MB",
        "files": "files",
        "megabytes": "MB of results",
    }
    return TextTable(
        "cluster_plan: what grows with the subjects",
        (("what", ""), ("for none", ".1f"), ("for each", ".4f")),
        [(words[name], line.none, line.each) for name, line in grows.items()],
        f"Snakemake's: lines through dry runs of {', '.join(map(str, PLANNED))} subjects, inside a job "
        f"{', '.join(map(str, PLANNED_INSIDE))}. gather's: {' and '.join(map(str, GATHERED))} copies of the "
        "demo's first subject.",
    )


def _ways(rules: dict[str, Costs], grows: dict[str, Line], subjects: int, cores: int) -> TextTable:
    of_subject = [c for stage, c in rules.items() if stage not in (*ONLY_SIMULATED, *WHOLE_STUDY)]
    work_s = sum(costs.jobs * costs.processor_s for costs in of_subject) / DEMO_SUBJECTS
    chain_s = sum(costs.processor_s for costs in of_subject)
    jobs = sum(costs.jobs for costs in of_subject) // DEMO_SUBJECTS
    start_s, plan_s = grows["start_s"].at(subjects), grows["plan_s"].at(subjects)
    whole_s = grows["plan_s"].at(SHARD) + _spread(SHARD * work_s, chain_s, SHARD_CORES)
    ways = [  # name, Slurm jobs, cores of one, its seconds, and what Snakemake takes before the first
        ("every job its own", subjects * jobs, 1, start_s + work_s / jobs, plan_s),
        (
            "a subject, as in the profile",
            subjects,
            JOB_CORES,
            start_s + _spread(work_s, chain_s, JOB_CORES),
            plan_s,
        ),
        (
            "ten subjects",
            ceil(subjects / 10),
            JOB_CORES,
            start_s + _spread(10 * work_s, chain_s, JOB_CORES),
            plan_s,
        ),
        (f"a whole study of {SHARD}", ceil(subjects / SHARD), SHARD_CORES, whole_s, 0.0),
    ]
    grown = {name: grows[name].at(subjects) / 1e6 for name in ("files", "megabytes")}
    return TextTable(
        f"cluster_plan: {subjects} subjects on {cores} cores: {subjects * jobs} jobs of Snakemake, "
        f"{subjects * work_s / 3600:.0f} processor hours, {grown['files']:.1f} million files, "
        f"{grown['megabytes']:.2f} TB",
        (
            ("a Slurm job is", ""),
            ("Slurm jobs", "d"),
            ("s each", ".0f"),
            ("h planning", ".2f"),
            ("h running", ".1f"),
            ("core hours", ".0f"),
            ("submissions/s", ".2f"),
        ),
        [_way(*way, cores) for way in ways],
        "A model, not a run: planning, then full waves of equal jobs, without gather, report and figures. "
        f"Jobs of one or ten subjects have {JOB_CORES} cores, of a study {SHARD_CORES}; each takes the start "
        "of Snakemake, its longest chain, and the rest spread over its cores.",
    )


def _way(name: str, count: int, width: int, job_s: float, before_s: float, cores: int) -> tuple[Cell, ...]:
    running_s = ceil(count / (cores // width)) * job_s
    core_hours = count * width * job_s / 3600
    return name, count, job_s, before_s / 3600, running_s / 3600, core_hours, count / running_s


def _spread(work_s: float, chain_s: float, cores: int) -> float:
    """Seconds by the clock of work on the cores, of which a chain must go one by one (Brent's bound)."""
    return chain_s + (work_s - chain_s) / cores


def _ends(grows: dict[str, Line]) -> TextTable:
    ends = sorted((grows[name].reaches(limit), what) for what, (name, limit) in LIMITS.items())
    return TextTable(
        "cluster_plan: what ends first, as one study grows",
        (("what", ""), ("subjects", ".0f")),
        [(what, subjects) for subjects, what in ends],
        "Beyond the first, split the study: several study files, each with its own report.",
    )


def main() -> int:
    """Print the plan for the subjects and cores of the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.cluster_plan", description=__doc__)
    parser.add_argument("--subjects", type=int, default=10_000)
    parser.add_argument("--cores", type=int, default=200)
    arguments = parser.parse_args()
    for table in run(arguments.subjects, arguments.cores):
        print(table, end="\n\n", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
