"""Jobs as forks of a warm process: what they do, say and return is what a process of their own would."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import psutil
import pytest

from shukotsu.__main__ import main as capture
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_recording
from shukotsu.simulate.simulation import simulate
from shukotsu.workflow import job, warm_process

REPOSITORY = Path(__file__).resolve().parents[2]
JOB = (sys.executable, "-m", "shukotsu.workflow.job")
HELP = ("shukotsu.paper", "--help")
WAITING = "tests.workflow.waiting_job"
LIGHT = (
    "import socket, sys; from shukotsu.workflow import warm_process as w; "
    "w.PACKAGES = ['shukotsu.paper']; w.serve(socket.socket(fileno=int(sys.argv[1])))"
)
"""A warm process that imports one stage, not all."""

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the warm process is for Linux")


@pytest.fixture(scope="module")
def poses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("poses")
    write_recording(folder / "rom.parquet", simulate("01", "right", "rom", 3, Realism.full(), 300))
    words = ["--layout=liberty16", "--subject=01", "--hand=right", "--task=rom"]
    assert capture(["import", f"--in={folder}/rom.parquet", *words, f"--out={folder}/poses.parquet"]) == 0
    return folder / "poses.parquet"


@pytest.fixture(scope="module")
def warm() -> Iterator[psutil.Process]:
    """The warm process of the jobs that are started from here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(REPOSITORY))
        patch.setenv(job.ADDRESS, "")
        patch.delenv(job.ADDRESS)
        whole = subprocess.Popen
        with patch.context() as light:
            words = [sys.executable, "-c", LIGHT]
            light.setattr(subprocess, "Popen", lambda own, **options: whole([*words, own[-1]], **options))
            started = warm_process.start()
        assert started is not None
        yield psutil.Process(started.pid)
        started.communicate()
        assert started.returncode == 0


def forks(warm: psutil.Process) -> list[psutil.Process]:
    """Jobs that are running."""
    return [fork for fork in warm.children() if fork.status() != psutil.STATUS_ZOMBIE]


def done(
    words: Sequence[object], folder: Path, *, address: str | None = None
) -> subprocess.CompletedProcess[str]:
    environment = os.environ | ({} if address is None else {job.ADDRESS: address})
    argv = [*JOB, *map(str, words)]
    return subprocess.run(argv, cwd=folder, env=environment, capture_output=True, text=True)


def solve(poses: Path, model: str = "rigid") -> list[object]:
    options = ["--poses", poses, "--layout=liberty16", f"--model={model}"]
    return ["shukotsu.paper", *options, "--out=joints.parquet"]


def wait_for(true: Callable[[], object]) -> None:
    """Wait as long as the suite's own time limit lets it."""
    while not true():
        time.sleep(0.02)


def test_a_fork_writes_the_same_bytes_into_the_folder_of_its_client(
    warm: psutil.Process, poses: Path, tmp_path: Path
) -> None:
    addresses = {"warm": None, "cold": str(tmp_path / "nobody")}
    for name, address in addresses.items():
        (tmp_path / name).mkdir()
        finished = done(solve(poses), tmp_path / name, address=address)
        assert (finished.returncode, finished.stderr) == (0, "")
    first, second = ((tmp_path / name / "joints.parquet").read_bytes() for name in addresses)
    assert first == second
    assert warm.is_running()


@pytest.mark.usefixtures("warm")
def test_a_fork_that_has_answered_prints_nothing_more(tmp_path: Path) -> None:
    """The client closes the line at once when it is answered, which must not look like an order to end."""
    printed = {done(HELP, tmp_path).stderr for _ in range(4)}
    assert printed == {""}


@pytest.mark.usefixtures("warm")
def test_bad_input_is_the_same_sentence_and_exit_code(poses: Path, tmp_path: Path) -> None:
    finished = done(solve(poses, "rigd"), tmp_path)
    assert finished.returncode == 2
    assert "did you mean 'rigid'" in finished.stderr
    assert "Traceback" not in finished.stderr
    assert done(HELP, tmp_path).returncode == 0
    assert done(["shukotsu.paper"], tmp_path).returncode == 2


def test_a_bug_is_a_traceback_in_the_clients_log(warm: psutil.Process, tmp_path: Path) -> None:
    finished = done(["shukotsu.nothing_of_that_name"], tmp_path)
    assert finished.returncode == 1
    assert "ModuleNotFoundError" in finished.stderr
    assert warm.is_running()


@pytest.fixture
def waiting(warm: psutil.Process, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A job that has begun, and waits for the end of its input to end with 7."""
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    with subprocess.Popen([*JOB, WAITING, "7"], cwd=tmp_path, text=True, **pipes) as client:
        assert client.stdout is not None
        assert client.stdout.readline() == "begun\n"
        wait_for(lambda: len(forks(warm)) == 1)
        yield client
        client.kill()


def test_a_job_has_the_clients_streams_and_exit_code(waiting: subprocess.Popen[str]) -> None:
    assert waiting.communicate() == ("", "")
    assert waiting.returncode == 7


def test_a_job_that_is_ended_ends_its_fork(warm: psutil.Process, waiting: subprocess.Popen[str]) -> None:
    (fork,) = forks(warm)
    waiting.terminate()
    wait_for(lambda: fork not in forks(warm))


def test_a_fork_that_is_killed_is_a_failed_job(warm: psutil.Process, waiting: subprocess.Popen[str]) -> None:
    (fork,) = forks(warm)
    fork.kill()
    assert waiting.communicate() == ("", "error: the job's process was killed before its end\n")
    assert waiting.returncode == job.KILLED


@pytest.fixture
def short_folder() -> Iterator[Path]:
    """A folder whose path leaves room for a socket's (107 bytes)."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


ORPHAN = f"""
import sys, threading, time
from shukotsu.workflow import job, warm_process
process = warm_process.start()
print(process.pid, flush=True)
threading.Thread(target=job.run_in_fork, args=(["{WAITING}"],), daemon=True).start()
time.sleep(600)
"""


@pytest.mark.slow
def test_jobs_end_with_a_workflow_that_is_killed(short_folder: Path) -> None:
    """Its next run must not find them writing its files."""
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY), "TMPDIR": str(short_folder)}
    environment.pop(job.ADDRESS, None)
    words = [sys.executable, "-c", ORPHAN]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(words, env=environment, text=True, **pipes) as workflow:
        assert workflow.stdout is not None
        warm = psutil.Process(int(workflow.stdout.readline()))
        assert workflow.stdout.readline() == "begun\n"
        (fork,) = forks(warm)
        keeper = os.dup(workflow.stdin.fileno())  # type: ignore[union-attr] # the job itself would wait on
        workflow.kill()
        workflow.wait()
        wait_for(lambda: not fork.is_running())
        os.close(keeper)


def test_a_job_of_a_workflow_that_has_ended_is_not_begun(tmp_path: Path) -> None:
    finished = done(HELP, tmp_path, address=str(tmp_path / "removed" / "jobs"))
    assert finished.returncode == job.KILLED
    assert finished.stderr == "error: the workflow that started this job was killed\n"


@pytest.mark.slow
def test_it_ends_with_who_started_it(short_folder: Path) -> None:
    """Also where that is killed; then, too, it leaves nothing behind."""
    code = "import time; from shukotsu.workflow import warm_process as w; print(w.start().pid, flush=True); "
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY), "TMPDIR": str(short_folder)}
    environment.pop(job.ADDRESS, None)
    words = [sys.executable, "-c", code + "time.sleep(60)"]
    with subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True) as starting:
        assert starting.stdout is not None
        process = psutil.Process(int(starting.stdout.readline()))
        starting.kill()
        starting.stdout.close()
    wait_for(lambda: not process.is_running())
    assert not list(short_folder.iterdir())
