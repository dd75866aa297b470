"""On one machine a subject's jobs are forks of one process, which ends with the run."""

from __future__ import annotations

import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import psutil
import pytest
from studies.running import record, write_study

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="the warm process is for Linux"),
]


def test_jobs_are_forks_of_one_process(tmp_path: Path) -> None:
    file = record(tmp_path / "rom.parquet", subject="01", task="rom")
    study = write_study(tmp_path, "warm", [f"01\tright\trom\tboth\t{file.name}"], ["rigid"])
    seen: dict[psutil.Process, str] = {}
    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(study.run)
        while not running.done():
            for process in psutil.Process().children(recursive=True):
                seen[process] = _kind(process) or seen.get(process, "")
            time.sleep(0.01)
        running.result()
    kinds = list(seen.values())
    assert kinds.count("warm") == 1
    assert kinds.count("fork") >= 8
    assert not any(process.is_running() for process, kind in seen.items() if kind)


def _kind(process: psutil.Process) -> str:
    """The process that is warm, a fork of it, which has the same words, or neither."""
    try:
        parent = process.parent()
        if not _is_warm(process):
            return ""
        return "fork" if parent is not None and _is_warm(parent) else "warm"
    except psutil.Error:  # it has ended meanwhile
        return ""


def _is_warm(process: psutil.Process) -> bool:
    return "shukotsu.workflow.warm_process" in process.cmdline()
