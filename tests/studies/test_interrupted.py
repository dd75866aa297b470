"""A run that is killed, one beside another, results removed meanwhile, names that Snakemake has uses for."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from studies.running import REPOSITORY, StudyRun, record, write_study

pytestmark = pytest.mark.slow

PATIENCE_S = 600.0
LONG = "s" * 300
NAMES = ["{subject}", "a" * 24, "/" * 24, 'A & <b>"x"']


@pytest.fixture
def study(tmp_path: Path) -> StudyRun:
    """A study of one subject."""
    file = record(tmp_path / "rom.parquet")
    return write_study(tmp_path, "cut", [f"01\tright\trom\tboth\t{file.name}"], ["rigid"])


@contextmanager
def running_until(study: StudyRun, table: str, *targets: str) -> Iterator[subprocess.Popen[str]]:
    """A run of a study that has come as far as a table of its subject; it is killed at the end."""
    command = [sys.executable, "-m", "snakemake", "-s", str(REPOSITORY / "Snakefile"), "--cores", "1"]
    process = subprocess.Popen(
        [*command, *targets, "--configfile", str(study.file)],
        cwd=study.folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        end, file = time.monotonic() + PATIENCE_S, study.results.subject("01") / f"{table}.parquet"
        while not file.exists() and time.monotonic() < end:
            assert process.poll() is None
            time.sleep(0.01)
        yield process
    finally:
        process.kill()
        process.communicate()


def test_a_second_run_is_refused_and_a_killed_one_goes_on(study: StudyRun) -> None:
    with running_until(study, "findings") as first:
        second = study.snakemake()
        assert first.poll() is None
    assert second.returncode == 2
    assert second.stderr.splitlines()[-1].startswith("error: study cut: another run of it is under way")
    assert "Traceback" not in second.stderr
    study.run()
    assert study.results.report.exists()
    assert study.planned() == set()


def test_no_name_in_a_sheet_stops_the_study(tmp_path: Path) -> None:
    """Nor one of a file that Snakemake would take for a pattern; what cannot be is a problem of its row."""
    rows = []
    for subject, file in zip(NAMES, ["{x}.parquet", "<b>.parquet", "a {b} c.csv", "d.parquet"], strict=True):
        record(tmp_path / file, subject=subject)
        rows.append(f"{subject}\tright\t{{rom}}\tboth\t{file}")
    rows += [f"{LONG}\tright\trom\tboth\td.parquet", f"gone\tright\trom\tboth\t{'f' * 300}.csv"]
    rows += ["other\tleft\trom\tboth\tdata\\rom.csv"]
    study = write_study(tmp_path, "names", rows, ["rigid"])
    text = study.run()
    used = {row["subject"] for row in study.rows("recordings") if row["status"] == "used"}
    assert used == set(NAMES)
    problems = {
        row["subject"]: row["message"] for row in study.rows("problems") if row["severity"] == "refused"
    }
    assert problems.keys() == {LONG, "gone", "other"}
    assert problems[LONG].startswith("names.tsv: row 6, columns subject, session, task, trial: have 3")
    assert problems["gone"].startswith("names.tsv: row 7, column file: has a part of more than 255 bytes")
    assert "folders are separated by / and not by \\" in problems["other"]
    assert text.count("the row was left out") == 2
    (tmp_path / "{x}.parquet").write_bytes((tmp_path / "d.parquet").read_bytes())
    assert {job.subject for job in study.planned() if job.rule == "capture"} == {"%7Bsubject%7D"}
