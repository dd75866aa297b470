"""Real studies run by Snakemake in a process of its own, as a user runs them, and their results read back."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from program_files import BESIDE, REPOSITORY

from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_recording
from shukotsu.simulate.simulation import simulate
from shukotsu.study.results import Results
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.typed_table import read_table, rows_of

HEADER = "subject\thand\ttask\trole\tfile\texclude"

CORES = 1 if "PYTEST_XDIST_WORKER" in os.environ else 2
"""Of a study, unless a test says how many: workers share the machine."""
_JOB = re.compile(r"^Job \d+: (\w+): (.*)$", re.MULTILINE)

Row = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """A job that Snakemake wants to run: its rule, and what its message says that it is about."""

    rule: str
    about: str

    @property
    def subject(self) -> str | None:
        """The subject as it stands in paths; None of a job of the whole study."""
        found = re.match(r"subject ([^,]+)", self.about)
        return None if found is None else found[1]


@dataclass(frozen=True)
class StudyRun:
    """A study file, the folder that it runs in and the program that runs it."""

    file: Path
    folder: Path
    repository: Path = REPOSITORY

    def snakemake(self, *words: str, cores: int = CORES) -> subprocess.CompletedProcess[str]:
        """Run Snakemake on the study, started from the study's folder; give what it said."""
        return snakemake(
            self.folder,
            "--directory",
            str(self.folder),
            "--configfile",
            str(self.file),
            *words,
            cores=cores,
            repository=self.repository,
        )

    def run(self, cores: int = CORES) -> str:
        """Run the study, which must end with exit code 0; give what Snakemake said."""
        done = self.snakemake(cores=cores)
        assert done.returncode == 0, done.stderr
        return done.stderr

    def planned(self, *targets: str) -> set[Job]:
        """Jobs that a run would do now, of those targets alone where some are named."""
        done = self.snakemake("--dry-run", *targets)
        assert done.returncode == 0, done.stderr
        return jobs_in(done.stdout + done.stderr)

    @property
    def results(self) -> Results:
        """Where the results are."""
        return Results(self.folder / Results.of(self.file.stem).folder)

    def rows(self, table: str) -> list[Row]:
        """Rows of a study-wide table, which must be as the contract says."""
        return list(rows_of(read_table(self.results.study_table(table), TABLES[table])))

    def rows_where(self, table: str, **wanted: str) -> list[Row]:
        """Rows of a study-wide table with those values."""
        return [row for row in self.rows(table) if all(row[key] == value for key, value in wanted.items())]

    def page(self) -> str:
        """The report's text."""
        return self.results.report.read_text("utf-8")

    def logs(self) -> set[str]:
        """Paths of the log files, below the folder of logs."""
        folder = self.results.folder / "logs"
        return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def snakemake(
    folder: Path, *words: str, cores: int = CORES, repository: Path = REPOSITORY
) -> subprocess.CompletedProcess[str]:
    """Run Snakemake with the program's Snakefile from that working directory."""
    command = [sys.executable, "-m", "snakemake", "-s", str(repository / "Snakefile")]
    return subprocess.run(
        [*command, "--cores", str(cores), *words], cwd=folder, capture_output=True, text=True, timeout=1500
    )


def jobs_in(text: str) -> set[Job]:
    return {Job(found[1], found[2]) for found in _JOB.finditer(text)}


def write_study(folder: Path, name: str, rows: list[str], models: list[str], **keys: str) -> StudyRun:
    """Write a study file, NAME.yaml, and its sheet of recordings, NAME.tsv.

    rows: cells of the columns HEADER, separated by tabs; the first may be another header.
    """
    folder.mkdir(parents=True, exist_ok=True)
    sheet = rows if rows[0].startswith("subject\t") else [HEADER, *rows]
    (folder / f"{name}.tsv").write_text("\n".join(sheet) + "\n", "utf-8")
    lines = [f"study: {name}", f"recordings: {name}.tsv", f"models: [{', '.join(models)}]"]
    lines += [f"{key}: {value}" for key, value in ({"layout": "liberty16"} | keys).items()]
    (folder / f"{name}.yaml").write_text("\n".join(lines) + "\n", "utf-8")
    return StudyRun(folder / f"{name}.yaml", folder)


def record(
    file: Path,
    *,
    subject: str = "01",
    hand: str = "right",
    task: str = "rom",
    frames: int = 300,
    session: str = "",
) -> Path:
    """Simulate a short recording into a file whose ending says its format."""
    write_recording(file, simulate(subject, hand, task, 3, Realism.full(), frames, session=session))
    return file


def copy_of_the_program(folder: Path) -> Path:
    """Copy all that the workflow needs of this repository."""
    folder.mkdir(parents=True)
    for part in ("shukotsu", *BESIDE):
        source = REPOSITORY / part
        if source.is_dir():
            leave = shutil.ignore_patterns("recordings")
            shutil.copytree(source, folder / part, symlinks=True, ignore=leave)
        else:
            shutil.copy2(source, folder / part)
    return folder


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of every file below a folder by its path there; logs left out."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in _files(folder)
        if "logs" not in path.relative_to(folder).parts
    }


def leftovers(folder: Path) -> list[Path]:
    return [path for path in _files(folder) if path.name.endswith(".tmp")]


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in sorted(folder.rglob("*")) if path.is_file())
