"""What `shukotsu run` starts: Snakemake in an environment that works, which ends with it."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from shukotsu.commands import run_study
from shukotsu.workflow import one_run

REPOSITORY = Path(__file__).resolve().parents[2]


def test_nothing_of_the_persons_own_changes_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in run_study.UNWANTED:
        monkeypatch.setenv(name, "mine")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert not {*run_study.UNWANTED, "MPLCONFIGDIR"} & {*run_study._environment()}
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/caches")
    assert run_study._environment()["XDG_CACHE_HOME"] == str(tmp_path / ".snakemake" / "caches")


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a process with its parent")
def test_what_it_started_is_killed_with_it() -> None:
    code = (
        "import sys; from shukotsu.commands.run_study import _run; "
        "_run([sys.executable, '-c', 'print(1, flush=True); input()'], None)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"1\n"
        (child,) = psutil.Process(process.pid).children()
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert psutil.wait_procs([child], 60)[1] == []


def test_the_lock_is_handed_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(one_run, "_held", {})
    lock = one_run.hold(Path("results", "a"))
    code = (
        "import pathlib; from shukotsu.workflow import one_run; "
        "assert one_run.hold(pathlib.Path('results', 'a')); print(one_run.os.getpid())"
    )
    monkeypatch.setattr(run_study, "UNWANTED", ())
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    assert run_study._run([sys.executable, "-c", code], lock) == 0
    assert run_study._run([sys.executable, "-c", code], None) != 0
