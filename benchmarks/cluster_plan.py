"""A study of thousands on a cluster: what it will cost, from the jobs of small studies and from dry runs."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path

from benchmarks.benchmark_table import Cell, TextTable
from benchmarks.studies import RuleCost, rule_costs, rule_table
from benchmarks.study_runs import ALL_MODELS, HANDS, ROLES, Study, job_counts, simulate_recordings

RUN = (2, 6)
"""Subjects of the studies that are run, to see what a job costs and how results and gather's memory grow."""
PLANNED, PLANNED_INSIDE = (5, 20, 80), (20, 320, 1280)
"""Subjects of the studies that are planned, not run, to see how Snakemake's own cost grows: by what submits
them all, and by what runs inside one subject's job."""
JOB_CORES = 2  # as in config/profiles/slurm
SHARD, SHARD_CORES = 100, 16
GATHER = "gather"
LIMITS = {
    "gather's memory, a node of 64 GB": ("gather_mb", 64_000.0),
    "memory of the Snakemake that submits, 16 GB": ("plan_mb", 16_000.0),
    "an hour until the first job is submitted": ("plan_s", 3600.0),
    "a quota of a million files": ("files", 1e6),
}
LABELS = {
    "plan_s": "Snakemake until it submits, processor s",
    "plan_mb": "the same, MB",
    "start_s": "Snakemake inside each job of a group, processor s",
    "gather_mb": "gather, MB",
    "files": "files",
    "megabytes": "MB of results",
}


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


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the benchmark."""
    parser.add_argument("--subjects", type=int, default=10_000, help="(default: %(default)s)")
    parser.add_argument("--cores", type=int, default=200, help="(default: %(default)s)")


def run(subjects: int, cores: int) -> Iterator[TextTable]:
    """Give the tables: what was measured, what follows for the study, and what ends first."""
    with tempfile.TemporaryDirectory() as name:
        rules, lines = _studies(Path(name, "studies"))
        lines |= _plans(Path(name, "plans"))
    yield rule_table(
        rules,
        f"cluster_plan: the jobs of {RUN[0]} subjects, 4 recordings of 16 or 25 s each, all models",
        "Processor seconds, start-up included, of the first subject's jobs.",
    )
    yield TextTable(
        "cluster_plan: what grows with the subjects",
        ("what", "for none:.1f", "for each:.4f"),
        [(LABELS[name], line.none, line.each) for name, line in lines.items()],
        f"Snakemake's: lines through dry runs of {', '.join(map(str, PLANNED))} subjects, inside a job "
        f"{', '.join(map(str, PLANNED_INSIDE))}. The others: through studies of "
        f"{' and '.join(map(str, RUN))} subjects.",
    )
    yield _ways(rules, lines, subjects, cores)
    ends = sorted((lines[name].reaches(limit), what) for what, (name, limit) in LIMITS.items())
    yield TextTable(
        "cluster_plan: what ends first, as one study grows",
        ("what", "subjects:.0f"),
        [(what, limit) for limit, what in ends],
        "Beyond the first, split the study: several study files, each with its own report.",
    )


def _studies(folder: Path) -> tuple[Mapping[str, RuleCost], dict[str, Line]]:
    """Run small studies; give the costs of the first one's rules, and what of the results grows."""
    simulated = simulate_recordings(folder / "simulated")
    costs: list[Mapping[str, RuleCost]] = []
    files: list[int] = []
    megabytes: list[float] = []
    for subjects in RUN:
        study = Study(folder / f"{subjects}", ALL_MODELS)
        study.write_subjects(simulated, subjects)
        counts = job_counts(study.run().output)
        paths = [study.results, study.folder / ".snakemake" / "metadata"]  # Snakemake's own, a file an output
        sizes = [file.stat().st_size for path in paths for file in path.rglob("*") if file.is_file()]
        files.append(len(sizes))
        megabytes.append(sum(sizes) / 1e6)
        costs.append(rule_costs(study, counts))
    return costs[0], {
        "files": fitted_line(RUN, files),
        "megabytes": fitted_line(RUN, megabytes),
        "gather_mb": fitted_line(RUN, [cost[GATHER].memory_mb for cost in costs]),
    }


def _plans(folder: Path) -> dict[str, Line]:
    """Plan studies of several sizes without running them: what submits all, and what runs inside a job."""
    dry = ("--dry-run", "--quiet", "all")
    whole = [_empty_study(folder / f"{n}", n).run(*dry) for n in PLANNED]
    page = "results/study/report/sub-00000"
    inside = [_empty_study(folder / f"{n}-inside", n).run(page, *dry) for n in PLANNED_INSIDE]
    return {
        "plan_s": fitted_line(PLANNED, [usage.processor_s for usage in whole]),
        "plan_mb": fitted_line(PLANNED, [usage.memory_mb for usage in whole]),
        "start_s": fitted_line(PLANNED_INSIDE, [usage.processor_s for usage in inside]),
    }


def _empty_study(folder: Path, subjects: int) -> Study:
    """A study whose recordings are there, but empty."""
    study = Study(folder, ALL_MODELS)
    rows = [
        (f"{subject:05}", hand, task, role, f"{subject:05}_{hand}_{task}.csv")
        for subject in range(subjects)
        for hand in HANDS
        for task, role in ROLES.items()
    ]
    study.write(rows)
    for *_, file in rows:
        (folder / file).touch()
    return study


def fitted_line(subjects: Sequence[int], values: Sequence[float]) -> Line:
    """Line of least squares; level where it would fall, which is noise: nothing gets cheaper by more."""
    middle, mean = sum(subjects) / len(subjects), sum(values) / len(values)
    each = sum((n - middle) * (value - mean) for n, value in zip(subjects, values, strict=True))
    each = max(0.0, each / sum((n - middle) ** 2 for n in subjects))
    return Line(mean - each * middle, each)


def _ways(rules: Mapping[str, RuleCost], lines: dict[str, Line], subjects: int, cores: int) -> TextTable:
    of_subject = [cost for cost in rules.values() if cost.jobs >= RUN[0]]  # the others are of the study
    work_s = sum(cost.total_s for cost in of_subject) / RUN[0]
    chain_s = sum(cost.processor_s for cost in of_subject)
    jobs = sum(cost.jobs for cost in of_subject) // RUN[0]
    start_s, plan_s = lines["start_s"].at(subjects), lines["plan_s"].at(subjects)
    one_s, ten_s = (_spread(n * work_s, chain_s, JOB_CORES) for n in (1, 10))
    whole_s = lines["plan_s"].at(SHARD) + _spread(SHARD * work_s, chain_s, SHARD_CORES)
    ways = [  # name, Slurm jobs, cores of one, its seconds, and what Snakemake takes before the first
        ("every job its own", subjects * jobs, 1, start_s + work_s / jobs, plan_s),
        ("a subject, as in the profile", subjects, JOB_CORES, start_s + one_s, plan_s),
        ("ten subjects", ceil(subjects / 10), JOB_CORES, start_s + ten_s, plan_s),
        (f"a whole study of {SHARD}", ceil(subjects / SHARD), SHARD_CORES, whole_s, 0.0),
    ]
    rows: list[tuple[Cell, ...]] = []
    for name, count, width, job_s, before_s in ways:
        running_s = ceil(count / (cores // width)) * job_s
        hours = before_s / 3600, running_s / 3600, count * width * job_s / 3600
        rows.append((name, count, job_s, *hours, count / running_s))
    grown = {name: lines[name].at(subjects) / 1e6 for name in ("files", "megabytes")}
    return TextTable(
        f"cluster_plan: {subjects} subjects on {cores} cores: {subjects * jobs} jobs of Snakemake, "
        f"{subjects * work_s / 3600:.0f} processor hours, {grown['files']:.1f} million files, "
        f"{grown['megabytes']:.2f} TB",
        (
            "a Slurm job is",
            "Slurm jobs:d",
            "s each:.0f",
            "h planning:.2f",
            "h running:.1f",
            "core hours:.0f",
            "submissions/s:.2f",
        ),
        rows,
        "A model, not a run: planning, then full waves of equal jobs, without gather, report and figures. "
        f"Jobs of one or ten subjects have {JOB_CORES} cores, of a study {SHARD_CORES}; each takes the start "
        "of Snakemake, its longest chain, and the rest spread over its cores.",
    )


def _spread(work_s: float, chain_s: float, cores: int) -> float:
    """Seconds by the clock of work on the cores, of which a chain must go one by one (Brent's bound)."""
    return chain_s + (work_s - chain_s) / cores
