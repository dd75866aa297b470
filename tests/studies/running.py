"""Running real studies with Snakemake in a separate process, and reading their results."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from program_files import BESIDE, REPOSITORY, run_python

from shukotsu import job
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_recording
from shukotsu.simulate.simulation import simulate
from shukotsu.study.results import Results
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.digests import file_sha256
from shukotsu.tables.poses import RecordingName
from shukotsu.tables.typed_table import read_table, rows_of
from shukotsu.workflow import warm_process

SHORT_FIT = """model: fitted
description: a short fit
joints: {calibration: all}
planes: {cut: false}
fit: {whole_hand: true, frames: 40, steps: 1}
metacarpals: {unmeasured: fitted, measured: fitted}
"""
"""A whole-hand model that is fitted in seconds."""
HEADER = "subject\thand\ttask\trole\tfile\texclude"

CORES = 1 if "PYTEST_XDIST_WORKER" in os.environ else 2
"""Default number of cores for a study; parallel test workers share the machine."""
ALL_BUT_FIGURES = ("--omit-from", "print_figures")
"""Arguments of a run without figures."""
_JOB = re.compile(r"^Job \d+: (\w+): (.*)$", re.MULTILINE)

Row = dict[str, Any]


@cache
def warm_jobs() -> dict[str, str]:
    """Start a warm process for all studies, as each start takes 4 s; return the environment of its jobs."""
    warm_process.start()
    address = os.environ.pop(job.ADDRESS, None)  # None where there are no warm processes
    return {job.ADDRESS: address} if address else {}


@dataclass(frozen=True)
class Job:
    """A job that Snakemake would run: its rule and the subject of its message."""

    rule: str
    about: str

    @property
    def subject(self) -> str | None:
        """The subject as written in paths, or None for a job of the whole study."""
        match = re.match(r"subject ([^,]+)", self.about)
        return match and match[1]


@dataclass(frozen=True)
class StudyRun:
    """A study file, its working folder and the program that runs it."""

    file: Path
    folder: Path
    repository: Path = REPOSITORY

    def snakemake(self, *words: str, cores: int = CORES, **more: str) -> subprocess.CompletedProcess[str]:
        """Run Snakemake with the program's Snakefile on the study, in the study's folder, and wait for it.

        more : variables for its environment.
        """
        command = [sys.executable, "-m", "snakemake", "-s", str(self.repository / "Snakefile")]
        command += ["--directory", str(self.folder), "--configfile", str(self.file), "--cores", str(cores)]
        how: dict[str, Any] = {"cwd": self.folder, "env": os.environ | more}
        return subprocess.run([*command, *words], capture_output=True, text=True, timeout=1500, **how)

    def run(self, *targets: str, cores: int = CORES) -> str:
        """Run the study or some targets, check for exit code 0 and return Snakemake's standard error."""
        shared = warm_jobs() if self.repository == REPOSITORY else {}
        done = self.snakemake(*targets, cores=cores, **shared)
        assert done.returncode == 0, done.stderr
        return done.stderr

    def planned(self, *targets: str) -> set[Job]:
        """Return the jobs that a run would do now, for the given targets or all."""
        done = self.snakemake("--dry-run", *targets)
        assert done.returncode == 0, done.stderr
        return {Job(match[1], match[2]) for match in _JOB.finditer(done.stdout + done.stderr)}

    @property
    def results(self) -> Results:
        """Paths of the results."""
        return Results(self.folder / "results" / self.file.stem)

    def rows(self, table: str) -> list[Row]:
        """Return the rows of a study-wide table, checked against its schema."""
        return list(rows_of(read_table(self.results.study_table(table), TABLES[table])))

    def rows_where(self, table: str, **wanted: str) -> list[Row]:
        """Return the rows of a study-wide table with the wanted values."""
        return [row for row in self.rows(table) if all(row[key] == value for key, value in wanted.items())]

    def page(self) -> str:
        """Return the report's text."""
        return self.results.report.read_text("utf-8")


def shukotsu(folder: Path, *argv: str) -> subprocess.CompletedProcess[str]:
    """Run a shukotsu command in a folder, as if the program were installed."""
    return run_python(folder, "-m", "shukotsu", *argv)


def write_study(folder: Path, name: str, rows: list[str], models: list[str], **keys: str) -> StudyRun:
    """Write a study file, NAME.yaml, and its sheet of recordings, NAME.tsv.

    rows : cells of the columns HEADER, separated by tabs; the first row may be another header.
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
    """Write a short simulated recording to a file, in the format of its extension."""
    write_recording(file, simulate(RecordingName(subject, hand, task, session=session), 3, Realism(), frames))
    return file


def copy_of_the_program(folder: Path) -> Path:
    """Copy the parts of this repository that the workflow needs."""
    folder.mkdir(parents=True)
    for part in ("shukotsu", *BESIDE):
        source = REPOSITORY / part
        if source.is_dir():
            leave = shutil.ignore_patterns("recordings", "*.pyc.*", "*.tmp.*")
            shutil.copytree(source, folder / part, symlinks=True, ignore=leave)
        else:
            shutil.copy2(source, folder / part)
    return folder


def hashes(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file below a folder except logs, by relative path."""
    paths = {path.relative_to(folder): path for path in folder.rglob("*") if path.is_file()}
    return {n.as_posix(): file_sha256(path) for n, path in paths.items() if "logs" not in n.parts}


def leftovers(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*.tmp") if path.is_file()]
