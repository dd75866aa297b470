"""How `shukotsu run` starts Snakemake: its environment, signals and lock."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from program_files import REPOSITORY, run_python, started

from shukotsu.commands import run_study
from shukotsu.workflow import one_run


def test_the_users_environment_does_not_change_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in run_study.UNWANTED:
        monkeypatch.setenv(name, "mine")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert not {*run_study.UNWANTED, "MPLCONFIGDIR"} & {*run_study._environment()}
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/caches")
    assert run_study._environment()["XDG_CACHE_HOME"] == str(tmp_path / ".snakemake" / "caches")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a process with its parent")
def test_jobs_are_killed_with_the_command_that_started_them() -> None:
    code = (
        "import sys; from shukotsu.commands.run_study import _run; "
        "_run([sys.executable, '-c', 'print(1, flush=True); input()'], None)"
    )
    with started(code) as process:
        (child,) = psutil.Process(process.pid).children()
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert psutil.wait_procs([child], 60)[1] == []


ENDS = {
    "SIGINT": (130, "interrupted"),
    "SIGTERM": (143, "ended by SIGTERM"),
    "SIGHUP": (129, "ended by SIGHUP"),
}


@pytest.mark.parametrize("kill", [os.kill, os.killpg])
@pytest.mark.parametrize("name", ENDS)
def test_a_signal_ends_all_started_processes(name: str, kill: Callable[[int, int], None]) -> None:
    """Processes that ignore SIGTERM are ended too, with one sentence and the signal's exit code."""
    child = (
        "import signal, subprocess; signal.signal(signal.SIGTERM, signal.SIG_IGN); "
        "subprocess.Popen(['sleep', '600']); print(1, flush=True); signal.pause()"
    )
    code = (
        "import sys; from shukotsu import command_line; from shukotsu.commands.run_study import _run; "
        f"sys.exit(command_line.run_command(lambda: _run([sys.executable, '-c', {child!r}], None)))"
    )
    process = started(code, stderr=subprocess.PIPE, start_new_session=True)
    children = psutil.Process(process.pid).children(recursive=True)
    kill(process.pid, getattr(signal, name))
    status, how = ENDS[name]
    assert process.communicate(timeout=120)[1] == f"error: {how}; the same command goes on from there\n"
    assert process.returncode == status
    assert len(children) == 2
    assert not [each for each in children if each.is_running() and each.status() != psutil.STATUS_ZOMBIE]


@pytest.mark.parametrize("name", ENDS)
@pytest.mark.parametrize("module", ["shukotsu.command_line", "shukotsu.study.study"])
def test_a_signal_during_imports_ends_with_one_sentence(tmp_path: Path, name: str, module: str) -> None:
    code = (
        "import os, signal, sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, *_):\n"
        f"        if name == {module!r}: os.kill(os.getpid(), signal.{name})\n"
        "sys.meta_path.insert(0, Finder()); sys.argv = ['shukotsu', 'check', 'none.yaml']\n"
        "from shukotsu.__main__ import main; sys.exit(main())"
    )
    done = run_python(tmp_path, "-c", code)
    assert (done.returncode, done.stderr) == (ENDS[name][0], f"error: {ENDS[name][1]}\n")


def test_the_lock_is_passed_to_the_started_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
