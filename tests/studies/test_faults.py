"""A study that is killed at random moments or hits a file size limit leaves no incomplete result."""

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


def test_an_interrupted_study_is_completed_to_the_same_bytes(tmp_path: Path) -> None:
    """After a file size limit and after each kill all results present are final; a last run completes
    them.
    """
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
    """Return the SHA-256 of every result by name, without hidden files."""
    digests = hashes(study.results.folder)
    return {name: digest for name, digest in digests.items() if not re.search(r"(^|/)\.", name)}


def started(study: StudyRun, limit: Callable[[], None] | None = None) -> subprocess.Popen[str]:
    """Start a run of the study in a separate session, under a limit."""
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
