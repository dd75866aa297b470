"""Whole studies of 1, 10 and 100 subjects: what they cost, and what a change costs."""

from __future__ import annotations

import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.benchmark_table import Cell, TextTable
from benchmarks.processes import ROOT, Usage, run_process, run_python
from shukotsu.schemas.config_files import read_yaml, yaml_text

WRITTEN_TO = "benchmarks.md", "tables"
SUBJECTS = (1, 10, 100)
FITTED_SUBJECTS = (4, 12)

CORES = 2
SEED = 42
HANDS = ("right", "left")
ROLES = {"rom": "calibration", "opposition": "evaluation"}
FRAMES = {"rom": 6000, "opposition": 3774}
SIMULATED = ("01", "02")
"""Subjects that are simulated; the others' recordings are theirs under another name."""

PAPER_MODELS = ("paper-fig3-rest", "paper-fig3", "paper-fig4", "paper-fig4-corrected", "rigid")
ALL_MODELS = (*PAPER_MODELS, "whole-hand")
OWN_MODEL = "paper-fig4"
"""The model whose file a study has in its own folder, to be changed there."""


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
        yield _whole(rows, PAPER_MODELS)
        rows = []
        for count in fitted:
            study = Study(folder / f"fit-{count}", ALL_MODELS)
            study.write_subjects(simulated, count)
            rows.append(_row(f"{count} subjects, cold", study.run(), count))
        yield _whole(rows, ALL_MODELS)


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


def _row(run: str, usage: Usage, subjects: int = 0) -> tuple[Cell, ...]:
    counts = job_counts(usage.output)
    each_s = usage.seconds / (subjects * len(HANDS) * len(ROLES)) if subjects else None
    return run, sum(counts.values()), usage.seconds, each_s, usage.processor_s, usage.memory_mb


def _whole(rows: list[tuple[Cell, ...]], models: Sequence[str]) -> TextTable:
    return TextTable(
        f"studies: {len(models)} models, {len(HANDS)} hands x {len(ROLES)} recordings a subject, "
        f"{CORES} cores",
        ("study", "jobs:d", "s:.1f", "s a recording:.2f", "processor s:.0f", "largest process, MB:.0f"),
        rows,
        "The whole workflow, report and figures included; Snakemake's own start and planning too. A change "
        "reruns what depends on it and nothing else; changes are to the largest study, one after the other. "
        f"Recordings are 16 receivers, {' and '.join(map(str, FRAMES.values()))} frames, of {len(SIMULATED)} "
        "simulated subjects under as many names as there are subjects.",
    )


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

    def run(self) -> Usage:
        """Run the workflow; RuntimeError where it fails."""
        command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")]
        command += ["--directory", str(self.folder), "--configfile", str(self.file), "--cores", str(CORES)]
        return run_process(command, self.folder)


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
