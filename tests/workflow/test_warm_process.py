"""Jobs run as forks of a warm process behave like jobs in separate processes."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from program_files import REPOSITORY
from recording_files import WHO
from simulated_poses import recorded

from shukotsu import job
from shukotsu.__main__ import main as capture
from shukotsu.commands.run_stage import STAGES
from shukotsu.simulate.recording import write_recording
from shukotsu.workflow import warm_process

WAITING = Path(__file__).with_name("waiting_job.py")
JOB = sys.executable, "-IS", job.__file__
SOLVE = STAGES / "solve_joints.py"
LIGHT = (
    "import socket, sys; from shukotsu.workflow import warm_process as w; "
    "w.PACKAGES = ['shukotsu.paper']; w.serve(socket.socket(fileno=int(sys.argv[1])))"
)
"""A warm process that imports only one room."""

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the warm process is for Linux")


def wait_for(true: Callable[[], object]) -> None:
    """Wait for a condition, limited only by the suite's time limit."""
    while not true():
        time.sleep(0.02)


def done(folder: Path, *words: object, script: Path = SOLVE, address: str | None = None) -> tuple[int, str]:
    environment = os.environ | ({} if address is None else {job.ADDRESS: address})
    argv = [*JOB, script, *map(str, words)]
    ended = subprocess.run(argv, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    return ended.returncode, ended.stderr


@pytest.fixture(scope="module")
def poses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("poses")
    write_recording(folder / "rom.parquet", recorded(seed=3, n_frames=300)[0])
    assert capture(["import", f"--in={folder}/rom.parquet", *WHO, f"--out={folder}/poses.parquet"]) == 0
    return folder / "poses.parquet"


@pytest.fixture(scope="module")
def warm() -> Iterator[psutil.Process]:
    """The warm process for the jobs started by these tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(REPOSITORY))
        patch.setenv(job.ADDRESS, "")
        patch.delenv(job.ADDRESS)
        whole = subprocess.Popen
        with patch.context() as light:
            words = [sys.executable, "-c", LIGHT]
            light.setattr(subprocess, "Popen", lambda argv, **how: whole([*words, argv[-1]], **how))
            started = warm_process.start()
        assert started is not None
        yield psutil.Process(started.pid)
        started.communicate()
        assert started.returncode == 0


def test_a_request_arrives_as_it_was_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Words and variables may be empty, have several lines, contain = or be invalid UTF-8."""
    monkeypatch.setenv("OF_THIS_TEST", "a=b\n\udcff")
    words = ["/stages/plan.py", "", "--out=手 骨\n", "\udcff"]
    assert job.job_of(job.request_of("/a folder", words)) == ("/a folder", words, dict(os.environ))


def forks(warm: psutil.Process) -> list[psutil.Process]:
    return [fork for fork in warm.children() if fork.status() != psutil.STATUS_ZOMBIE]


def test_a_fork_writes_the_same_bytes_into_its_clients_folder(
    warm: psutil.Process, poses: Path, tmp_path: Path
) -> None:
    addresses = {"warm": None, "cold": str(tmp_path / "nobody")}
    options = ["--poses", poses, "--layout=liberty16", "--out=joints.parquet"]
    for name, address in addresses.items():
        (tmp_path / name).mkdir()
        assert done(tmp_path / name, *options, "--model=rigid", address=address) == (0, "")
    first, second = ((tmp_path / name / "joints.parquet").read_bytes() for name in addresses)
    assert first == second
    code, log = done(tmp_path, *options, "--model=rigd")
    assert (code, log.count("\n")) == (2, 1)
    assert "did you mean 'rigid'" in log
    broken = tmp_path / "broken.py"
    broken.write_text(WAITING.read_text().replace("del argv", "del nothing"))
    code, log = done(tmp_path, script=broken)
    assert code == 1
    assert "UnboundLocalError" in log
    assert warm.is_running()


@pytest.fixture
def waiting(warm: psutil.Process, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    with subprocess.Popen([*JOB, WAITING], cwd=tmp_path, text=True, **pipes) as client:
        assert client.stdout is not None
        assert client.stdout.readline() == "begun\n"
        wait_for(lambda: len(forks(warm)) == 1)
        yield client
        client.kill()


def test_a_job_has_the_clients_streams_and_exit_code(waiting: subprocess.Popen[str]) -> None:
    assert waiting.communicate() == ("", "")
    assert waiting.returncode == 7


def test_a_terminated_job_ends_its_fork(warm: psutil.Process, waiting: subprocess.Popen[str]) -> None:
    (fork,) = forks(warm)
    waiting.terminate()
    wait_for(lambda: fork not in forks(warm))


def test_a_killed_fork_is_a_failed_job(warm: psutil.Process, waiting: subprocess.Popen[str]) -> None:
    (fork,) = forks(warm)
    fork.kill()
    assert waiting.communicate() == ("", "error: the job's process was killed before its end\n")
    assert waiting.returncode == job.KILLED


ORPHAN = """
import subprocess, sys, time
from shukotsu.workflow import warm_process
print(warm_process.start().pid, flush=True)
subprocess.Popen(sys.argv[1:])
time.sleep(600)
"""


@pytest.mark.slow
def test_jobs_end_when_their_workflow_is_killed() -> None:
    """Otherwise they would write files during its next run. Nothing is left behind, and no new job starts."""
    with tempfile.TemporaryDirectory() as name:  # short enough for a socket's path (107 bytes)
        environment = os.environ | {"PYTHONPATH": str(REPOSITORY), "TMPDIR": name}
        environment.pop(job.ADDRESS, None)
        words = [sys.executable, "-c", ORPHAN, *JOB, str(WAITING)]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        with subprocess.Popen(words, env=environment, text=True, **pipes) as workflow:
            assert workflow.stdout is not None
            warm = psutil.Process(int(workflow.stdout.readline()))
            assert workflow.stdout.readline() == "begun\n"
            (fork,) = forks(warm)
            keeper = os.dup(workflow.stdin.fileno())  # type: ignore[union-attr] # the job itself would wait on
            workflow.kill()
            workflow.wait()
            wait_for(lambda: not fork.is_running() and not warm.is_running())
            os.close(keeper)
        assert not list(Path(name).iterdir())
        killed = job.KILLED, "error: the workflow that started this job was killed\n"
        assert done(Path(name), "--help", address=str(Path(name, "removed", "jobs"))) == killed
