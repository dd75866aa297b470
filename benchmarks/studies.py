"""Whole studies of 1, 10 and 100 subjects: what they cost, where it goes, and what a change costs."""

from __future__ import annotations

import re
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.benchmark_table import Cell, TextTable
from benchmarks.processes import Usage
from benchmarks.study_runs import (
    ALL_MODELS,
    CORES,
    FRAMES,
    HANDS,
    PAPER_MODELS,
    ROLES,
    SIMULATED,
    Study,
    job_counts,
    simulate_recordings,
)
from shukotsu.schemas.config_files import read_yaml, yaml_text

WRITTEN_TO = "benchmarks.md", "tables"
SUBJECTS = (1, 10, 100)
FITTED_SUBJECTS = (4, 12)
FIT = "fit_hand"


@dataclass(frozen=True)
class RuleCost:
    """Jobs of a rule in a study, what one of them takes by itself, and the memory of the largest in MB."""

    jobs: int
    processor_s: float
    memory_mb: float

    @property
    def total_s(self) -> float:
        """Processor seconds of all jobs of the rule."""
        return self.jobs * self.processor_s


def run(subjects: Sequence[int] = SUBJECTS, fitted: Sequence[int] = FITTED_SUBJECTS) -> Iterator[TextTable]:
    """Give the tables; studies of so many subjects, the last one also changed; fitted : with all models."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        simulated = simulate_recordings(folder / "simulated")
        rows: list[tuple[Cell, ...]] = []
        for count in subjects:
            study = Study(folder / f"{count}")
            study.write_subjects(simulated, count)
            cold = study.run()
            rows.append(_row(f"{count} subjects, cold", cold, count))
        for change, make in changes(study, simulated, count).items():
            make()
            rows.append(_row(f"then {change}", study.run()))
        yield _whole(rows)
        yield rule_table(
            rule_costs(study, job_counts(cold.output)),
            f"studies: the rules of {count} subjects, {len(PAPER_MODELS)} models",
            "The first subject's jobs and those of the whole study, each run again as a process, start-up "
            "included; all jobs of a rule are taken to cost what that subject's do.",
        )
        yield _fitted([_fitted_row(Study(folder / f"fit-{n}", ALL_MODELS), simulated, n) for n in fitted])


def changes(study: Study, simulated: Path, subjects: int) -> Mapping[str, Callable[[], object]]:
    """Single changes to a study that was run, by what is changed."""
    return {
        "nothing changed": lambda: None,
        "one subject more": lambda: study.write_subjects(simulated, subjects + 1),
        "one recording changed": lambda: drop_last_frame(study.recording(0, "right", "opposition")),
        "one model changed": lambda: halve_twist(study.model_file),
    }


def drop_last_frame(recording: Path) -> None:
    """Write a recording again without its last frame, and leave alone what else it is linked to."""
    import pyarrow.compute as pc
    import pyarrow.parquet as pq

    table = pq.read_table(recording)
    frame = table.column("frame")
    recording.unlink()
    pq.write_table(table.filter(pc.less(frame, pc.max(frame))), recording)


def halve_twist(model: Path) -> None:
    """Change the factor of Eq. 11 in a model's file."""
    config = read_yaml(model, "model")
    config.setdefault("metacarpals", {})["twist_factor"] = 0.5
    model.write_text(yaml_text(config), "utf-8")


def rule_costs(study: Study, counts: Mapping[str, int]) -> dict[str, RuleCost]:
    """Costs of every rule in a study that was run: its first subject's jobs and the study's, one by one."""
    usages: dict[str, list[Usage]] = defaultdict(list)
    jobs = [(job, set(re.findall(r"\bsub-[^/_]+", " ".join(job.outputs)))) for job in study.jobs()]
    first = min(set().union(*(subjects for _, subjects in jobs)))
    for job, subjects in jobs:
        if subjects <= {first}:
            usages[job.rule].append(study.run_job(job))
    return {
        rule: RuleCost(
            counts.get(rule, len(own)),
            sum(usage.processor_s for usage in own) / len(own),
            max(usage.memory_mb for usage in own),
        )
        for rule, own in usages.items()
    }


def _row(run: str, usage: Usage, subjects: int = 0) -> tuple[Cell, ...]:
    counts = job_counts(usage.output)
    each_s = usage.seconds / (subjects * len(HANDS) * len(ROLES)) if subjects else None
    return run, sum(counts.values()), usage.seconds, each_s, usage.processor_s, usage.memory_mb


def _whole(rows: list[tuple[Cell, ...]]) -> TextTable:
    return TextTable(
        f"studies: {len(PAPER_MODELS)} models, {len(HANDS)} hands x {len(ROLES)} recordings a subject, "
        f"{CORES} cores",
        ("study", "jobs:d", "s:.1f", "s a recording:.2f", "processor s:.0f", "largest process, MB:.0f"),
        rows,
        "The whole workflow, report and figures included; Snakemake's own start and planning too. A change "
        "reruns what depends on it and nothing else; changes are to the largest study, one after the other. "
        f"Recordings are 16 receivers, {' and '.join(map(str, FRAMES.values()))} frames, of {len(SIMULATED)} "
        "simulated subjects under as many names as there are subjects.",
    )


def rule_table(costs: Mapping[str, RuleCost], title: str, meaning: str) -> TextTable:
    """Tabulate the cost of the rules of a study."""
    heads = ("jobs:d", "processor s a job:.2f", "of all jobs:.0f", "largest MB:.0f")
    rows: list[tuple[Cell, ...]] = [
        (rule, cost.jobs, cost.processor_s, cost.total_s, cost.memory_mb) for rule, cost in costs.items()
    ]
    return TextTable(title, ("rule", *heads), rows, meaning)


def _fitted_row(study: Study, simulated: Path, subjects: int) -> tuple[Cell, ...]:
    """Run a study with all models; what it took, and what its fits take of that."""
    study.write_subjects(simulated, subjects)
    usage = study.run()
    fit = rule_costs(study, job_counts(usage.output))[FIT]
    share = 100 * fit.total_s / usage.processor_s
    return subjects, usage.seconds, usage.processor_s, fit.jobs, fit.processor_s, share, fit.memory_mb


def _fitted(rows: list[tuple[Cell, ...]]) -> TextTable:
    return TextTable(
        f"studies: all {len(ALL_MODELS)} models",
        (
            "subjects:d",
            "s:.0f",
            "processor s:.0f",
            "fits:d",
            "s a fit:.1f",
            "fits' % of all:.0f",
            "largest fit, MB:.0f",
        ),
        rows,
        "Processor seconds but for the second column. A fit is a hand under whole-hand, posed in its "
        "recordings too; the other models have none. Fits of the first subject, run again as processes.",
    )
