"""A study that is killed at random moments, or may write no large file, or lacks memory: no half results."""

from __future__ import annotations

import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from studies.running import REPOSITORY, StudyRun, record, write_study

from shukotsu.tables.whole_files import file_sha256

pytestmark = pytest.mark.slow

KILLS = 5


def state(study: StudyRun) -> dict[str, str]:
    """The SHA-256 of every result; logs and hidden files are none."""
    folder = study.results.folder
    names = {path: path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}
    return {
        name.as_posix(): file_sha256(path)
        for path, name in names.items()
        if "logs" not in name.parts and not any(part.startswith(".") for part in name.parts)
    }


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[StudyRun, dict[str, str], float]:
    """A study of one short recording before it is run; its results, and how long it takes to make them."""
    folder = tmp_path_factory.mktemp("faults") / "study"
    folder.mkdir()
    file = record(folder / "rom.parquet")
    study = write_study(folder, "study", [f"01\tright\trom\tboth\t{file.name}"], ["rigid"], exports="[bvh]")
    copy = folder.with_name("undisturbed")
    shutil.copytree(folder, copy)
    began = time.monotonic()
    run = StudyRun(copy / study.file.name, copy)
    run.run()
    return study, state(run), time.monotonic() - began


def started(study: StudyRun, limit: Callable[[], None] | None = None) -> subprocess.Popen[str]:
    """The study's run in a session of its own, under a limit."""
    command = [sys.executable, "-m", "snakemake", "-s", str(REPOSITORY / "Snakefile"), "--cores", "2"]
    return subprocess.Popen(
        [*command, "--configfile", str(study.file)],
        cwd=study.folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=limit,
    )


def test_killed_at_any_moment_the_same_command_completes_to_the_same_bytes(
    undisturbed: tuple[StudyRun, dict[str, str], float], tmp_path: Path
) -> None:
    study, expected, seconds = undisturbed
    shutil.copytree(study.folder, tmp_path / "study")
    copy, chance = StudyRun(tmp_path / "study" / study.file.name, tmp_path / "study"), random.Random(5)
    for _ in range(KILLS):
        process = started(copy)
        time.sleep(chance.uniform(0, seconds))
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        half_written = {name for name, digest in state(copy).items() if expected.get(name) != digest}
        assert half_written == set()
    copy.run()
    assert state(copy) == expected
    assert not list(copy.results.folder.rglob(".*.tmp"))


def test_a_machines_trouble_is_no_result(
    undisturbed: tuple[StudyRun, dict[str, str], float], tmp_path: Path
) -> None:
    """As a quota of files' sizes."""
    study, expected, _ = undisturbed
    shutil.copytree(study.folder, tmp_path / "study")
    copy = StudyRun(tmp_path / "study" / study.file.name, tmp_path / "study")
    process = started(copy, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000)))
    error = process.communicate(timeout=600)[1]
    assert process.returncode != 0, error
    assert {name for name, digest in state(copy).items() if expected.get(name) != digest} == set()
    copy.run()
    assert state(copy) == expected
