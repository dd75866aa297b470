"""A study that is killed at random moments, or may write no large file, or lacks memory: no half results."""

from __future__ import annotations

import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from studies.running import REPOSITORY, StudyRun, hashes, leftovers, record, write_study

pytestmark = pytest.mark.slow

KILLS = 3


def test_killed_or_in_trouble_the_same_command_completes_to_the_same_bytes(tmp_path: Path) -> None:
    """A machine's trouble, as a quota of files' sizes, is no result; nor is what was killed at any moment."""
    folder, chance = tmp_path / "study", random.Random(5)
    folder.mkdir()
    file = record(folder / "rom.parquet")
    study = write_study(folder, "study", [f"01\tright\trom\tboth\t{file.name}"], ["rigid"], exports="[bvh]")
    shutil.copytree(folder, tmp_path / "copy")
    copy = StudyRun(tmp_path / "copy" / study.file.name, tmp_path / "copy")
    began = time.monotonic()
    study.run()
    seconds, expected = time.monotonic() - began, results(study)
    process = started(copy, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000)))
    error = process.communicate(timeout=600)[1]
    assert process.returncode != 0, error
    assert not results(copy).items() - expected.items()
    for _ in range(KILLS):
        process = started(copy)
        time.sleep(chance.uniform(0, seconds))
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        assert not results(copy).items() - expected.items()
    copy.run()
    assert results(copy) == expected
    assert not leftovers(copy.results.folder)


def results(study: StudyRun) -> dict[str, str]:
    """SHA-256 of every result; hidden files are none."""
    digests = hashes(study.results.folder)
    return {name: digest for name, digest in digests.items() if not re.search(r"(^|/)\.", name)}


def started(study: StudyRun, limit: Callable[[], None] | None = None) -> subprocess.Popen[str]:
    """Start the study's run in a session of its own, under a limit."""
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
