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

from schemas.tables import read_metadata
from stages import job, warm_process
from stages.capture.__main__ import main as capture
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import simulate
from stages.units import pack

REPOSITORY = Path(__file__).resolve().parents[2]
JOB = (sys.executable, "-m", "stages.job")
EACH = ("each", "solve_joints", "--code=1", "--made=made.json")

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the warm process is for Linux")


@pytest.fixture(scope="module")
def poses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("poses")
    write_recording(folder / "rom.parquet", simulate("01", "right", "rom", 3, Realism.full(), 300))
    words = ["--layout=liberty16", "--subject=01", "--hand=right", "--task=rom"]
    assert capture(["import", f"--in={folder}/rom.parquet", *words, f"--out={folder}/poses.parquet"]) == 0
    return folder / "poses.parquet"


@pytest.fixture
def warm(monkeypatch: pytest.MonkeyPatch) -> Iterator[psutil.Process]:
    """The warm process, found by what is started from here."""
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    monkeypatch.setenv(job.ADDRESS, "")
    monkeypatch.delenv(job.ADDRESS)
    started = warm_process.start()
    assert started is not None
    yield psutil.Process(started.pid)
    started.communicate()
    assert started.returncode == 0


def units(poses: Path, model: str = "rigid") -> str:
    words = [f"--poses={poses}", "--layout=liberty16", f"--model={model}", "--subject=01", "--hand=right"]
    return pack([[*words, "--out=joints.parquet"]])


def done(words: Sequence[str], folder: Path, given: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run([*JOB, *words], cwd=folder, input=given, capture_output=True, text=True)


def wait_for(true: Callable[[], object]) -> None:
    until = time.monotonic() + 20.0
    while not true():
        assert time.monotonic() < until
        time.sleep(0.02)


def test_a_fork_writes_the_same_bytes_into_the_folder_of_who_asks(
    warm: psutil.Process, poses: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = [tmp_path / "warm", tmp_path / "cold"]
    for folder in folders:
        folder.mkdir()
    here = {"warm": done(EACH, folders[0], units(poses))}
    monkeypatch.setenv(job.ADDRESS, str(tmp_path / "nobody"))
    here["cold"] = done(EACH, folders[1], units(poses))
    assert [each.returncode for each in here.values()] == [0, 0]
    assert len(here["warm"].stderr.splitlines()) == 2  # the command line, and what came of it
    assert "1 made, 0 up to date" in here["warm"].stderr
    first, second = ((folder / "joints.parquet").read_bytes() for folder in folders)
    assert first == second
    assert "failure" not in read_metadata(folders[0] / "joints.parquet")
    assert warm.is_running()


@pytest.mark.usefixtures("warm")
def test_a_fork_that_has_answered_says_nothing_more(tmp_path: Path) -> None:
    """Who is answered closes the line at once, which must not look like an order to end."""
    said = {done(("each", "--help"), tmp_path).stderr for _ in range(30)}
    assert said == {""}


@pytest.mark.usefixtures("warm")
def test_bad_input_is_the_same_sentence_and_exit_code(poses: Path, tmp_path: Path) -> None:
    found = done(EACH, tmp_path, units(poses, "rigd"))
    assert found.returncode == 2
    assert "did you mean 'rigid'" in found.stderr
    assert "Traceback" not in found.stderr
    assert done(("each", "--help"), tmp_path).returncode == 0
    assert done(("each",), tmp_path).returncode == 2


def test_a_bug_is_a_traceback_of_who_asks(warm: psutil.Process, tmp_path: Path) -> None:
    found = done(("nothing_of_that_name",), tmp_path)
    assert found.returncode == 1
    assert "ModuleNotFoundError" in found.stderr
    assert warm.is_running()


@pytest.fixture
def waiting(warm: psutil.Process, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A job that waits for its units."""
    words = [*JOB, *EACH]
    with subprocess.Popen(
        words, cwd=tmp_path, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as asking:
        wait_for(warm.children)
        yield asking
        asking.kill()


def test_a_job_that_is_told_to_end_takes_its_fork_along(
    warm: psutil.Process, waiting: subprocess.Popen[str]
) -> None:
    (fork,) = warm.children()
    waiting.terminate()
    wait_for(lambda: not fork.is_running() or fork.status() == psutil.STATUS_ZOMBIE)


def test_a_fork_that_is_killed_is_a_failed_job(warm: psutil.Process, waiting: subprocess.Popen[str]) -> None:
    (fork,) = warm.children()
    time.sleep(0.5)  # it has begun by then
    fork.kill()
    assert waiting.wait(10) == job.KILLED
    assert waiting.stderr is not None
    assert waiting.stderr.read() == "error: the job's process was killed before its end\n"


@pytest.fixture
def short_folder() -> Iterator[Path]:
    """A folder whose path leaves room for a socket's (107 bytes)."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


def test_it_ends_with_who_started_it(short_folder: Path) -> None:
    """Also where that is killed; then, too, it leaves nothing behind."""
    code = "import sys, time; from stages import warm_process; print(warm_process.start().pid, flush=True); "
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
