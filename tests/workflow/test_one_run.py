"""One run of a study at a time, by a lock that ends with its process, however that ends."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from shukotsu.errors import InputError
from shukotsu.workflow import one_run

REPOSITORY = Path(__file__).resolve().parents[2]
STUDY = Path("results", "demo")
HOLD = (
    "import pathlib; from shukotsu.workflow import one_run; "
    f"one_run.hold(pathlib.Path('{STUDY}')); print(1, flush=True); input()"
)


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[subprocess.Popen[str]]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(one_run, "_held", {})
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "1\n"
    yield process
    process.kill()
    process.communicate()


def test_a_run_beside_a_live_one_is_refused(run: subprocess.Popen[str]) -> None:
    for _ in range(2):
        with pytest.raises(
            InputError,
            match=rf"^study demo: another run of it is under way \(process {run.pid} on .+\); wait",
        ):
            one_run.hold(STUDY)
    one_run.hold(Path("results", "demo2"))


def test_a_killed_run_is_in_nobodys_way(run: subprocess.Popen[str]) -> None:
    run.kill()
    run.wait()
    for _ in range(2):
        one_run.hold(STUDY)


def test_a_folder_that_cannot_be_written_to_is_left_to_snakemake(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(one_run, "FOLDER", Path("/dev/null/.snakemake"))
    one_run.hold(STUDY)
