"""Studies in a folder of their own, run by Snakemake: what a run took, and the jobs that it consists of."""

from __future__ import annotations

import csv
import os
import re
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.processes import ROOT, Usage, run_process, run_python

CORES = 2
SEED = 42
HANDS = ("right", "left")
ROLES = {"rom": "calibration", "opposition": "evaluation"}
FRAMES = {"rom": 6000, "opposition": 3774}
SIMULATED = ("01", "02")
"""Subjects that are simulated; the others' recordings are theirs under another name."""

PAPER_MODELS = ("paper-fig3-rest", "paper-fig3", "paper-fig4", "paper-fig4-corrected", "rigid")
ALL_MODELS = (*PAPER_MODELS, "anatomical", "whole-hand")
OWN_MODEL = "paper-fig4"
"""The model whose file a study has in its own folder, to be changed there."""


@dataclass
class Job:
    """A job of a study: its rule, command, and the files that it reads and writes (relative to the study)."""

    rule: str
    command: str
    inputs: list[str]
    outputs: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Study:
    """A study in a folder, its results below the same folder."""

    folder: Path
    models: Sequence[str] = PAPER_MODELS

    @property
    def file(self) -> Path:
        """The study file."""
        return self.folder / "study.yaml"

    @property
    def model_file(self) -> Path:
        """The model that the study has a file of its own of."""
        return self.folder / "models" / f"{OWN_MODEL}.yaml"

    @property
    def results(self) -> Path:
        """Return the folder of its results."""
        return self.folder / "results" / "study"

    def write(self, rows: Sequence[Sequence[str]]) -> None:
        """Write the study file, its model file and its sheet; rows : subject, hand, task, role, file."""
        self.model_file.parent.mkdir(parents=True, exist_ok=True)
        if not self.model_file.exists():
            shutil.copy(ROOT / "config" / "models" / self.model_file.name, self.model_file)
        sheet = [("subject", "hand", "task", "role", "file"), *rows]
        (self.folder / "recordings.tsv").write_text("".join("\t".join(row) + "\n" for row in sheet), "utf-8")
        models = ", ".join(f"models/{name}.yaml" if name == OWN_MODEL else name for name in self.models)
        head = "study: study\nrecordings: recordings.tsv\nlayout: liberty16\n"
        self.file.write_text(f"{head}models: [{models}]\n", "utf-8")

    def write_subjects(self, simulated: Path, subjects: int) -> None:
        """Write the study of so many subjects, their recordings linked from those that are simulated."""
        rows = []
        for index in range(subjects):
            for hand, task in hand_tasks():
                file = self.recording(index, hand, task)
                if not file.exists():
                    file.parent.mkdir(parents=True, exist_ok=True)
                    os.link(simulated / f"{SIMULATED[index % len(SIMULATED)]}_{hand}_{task}.parquet", file)
                name = file.relative_to(self.folder).as_posix()
                rows.append((f"{index:04}", hand, task, ROLES[task], name))
        self.write(rows)

    def recording(self, index: int, hand: str, task: str) -> Path:
        """A recording of the subject of that number."""
        return self.folder / "recordings" / f"{index:04}" / f"{hand}_{task}.parquet"

    def run(self, *options: str) -> Usage:
        """Run the workflow, or only plan it; RuntimeError where it fails."""
        command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"), *options]
        command += ["--directory", str(self.folder), "--configfile", str(self.file), "--cores", str(CORES)]
        return run_process(command, self.folder)

    def jobs(self) -> list[Job]:
        """The jobs of a study that was run, from Snakemake's summary of its files."""
        jobs: dict[str, Job] = {}
        printed = self.run("--detailed-summary").output.splitlines()
        start = next(index for index, line in enumerate(printed) if line.startswith("output_file\t"))
        for row in csv.DictReader(printed[start:], delimiter="\t", quoting=csv.QUOTE_NONE):
            command = row["shellcmd"]
            job = jobs.setdefault(command, Job(row["rule"], command, row["input-file(s)"].split(",")))
            job.outputs.append(row["output_file"])
        return list(jobs.values())

    def run_job(self, job: Job) -> Usage:
        """Run one job by itself, as a process."""
        return run_process(["bash", "-c", job.command], self.folder)


def hand_tasks() -> Iterator[tuple[str, str]]:
    """Every hand of a subject with every task that it does."""
    return ((hand, task) for hand in HANDS for task in ROLES)


def simulate_recordings(folder: Path) -> Path:
    """Simulate both tasks of both hands of two subjects in full length; give their folder."""
    for subject in SIMULATED:
        for hand, task in hand_tasks():
            out = folder / f"{subject}_{hand}_{task}.parquet"
            names = (f"--subject={subject}", f"--hand={hand}", f"--task={task}", f"--seed={SEED}")
            run_python("-m", "shukotsu.stages.simulate", *names, f"--frames={FRAMES[task]}", f"--out={out}")
    return folder


def job_counts(output: str) -> Mapping[str, int]:
    """Jobs by rule from Snakemake's first table of them, `all` left out; empty where nothing was to do."""
    if "Nothing to be done" in output:
        return {}
    table = re.search(r"^Job stats:\n.*\n[- ]+\n((?:.+\n)+?)total ", output, re.MULTILINE)
    if table is None:
        raise RuntimeError(f"no job counts in Snakemake's output:\n{output[-4000:]}")
    counts = dict(line.split()[:2] for line in table[1].splitlines())
    return {rule: int(count) for rule, count in counts.items() if rule != "all"}
