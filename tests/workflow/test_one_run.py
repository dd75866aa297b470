"""One run of a study at a time, by a lock that ends with its process, however that ends."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from schemas.errors import InputError
from workflow import one_run

REPOSITORY = Path(__file__).resolve().parents[2]
STUDY = Path("results", "demo")
HOLD = (
    "import pathlib; from workflow import one_run; "
    f"one_run.begin(pathlib.Path('{STUDY}'), []); print(1); input()"
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that runs are started from."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def run(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A run that holds the study, and Snakemake's locks of its files and of another study's."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "1\n"
    locks = folder / ".snakemake" / "locks"
    locks.mkdir()
    (locks / "0.input.lock").write_text("data/rom.csv\nresults/demo/sub-01/plan.json\n")
    (locks / "0.output.lock").write_text("results/demo/sub-01/plan.json\nresults/demo/report.html\n")
    (locks / "1.output.lock").write_text("results/demo2/sub-01/plan.json\n")
    yield process
    if process.poll() is None:
        process.kill()
    process.communicate()


def locks() -> set[str]:
    return {path.name for path in Path(".snakemake", "locks").iterdir()}


def test_nothing_is_said_where_nothing_ran() -> None:
    assert one_run.begin(STUDY, []) == []


def test_a_run_beside_a_live_one_is_refused(run: subprocess.Popen[str]) -> None:
    for words in ([], ["--cores", "all", "-call"], ["--configfile", "study-n.yaml", "-pk"]):
        with pytest.raises(
            InputError, match=rf"^study demo: another run of it is under way \(process {run.pid} "
        ):
            one_run.begin(STUDY, words)
    assert locks() == {"0.input.lock", "0.output.lock", "1.output.lock"}
    assert one_run.begin(Path("results", "demo2"), []) == []


@pytest.mark.parametrize(
    "word",
    ["-n", "-np", "--dry-run", "--summary", "-S", "--unlock", "--nolock", "--list-changes=code", "--report"],
)
def test_who_only_looks_may(run: subprocess.Popen[str], word: str) -> None:
    assert one_run.begin(STUDY, ["--cores", "2", word]) == []
    assert run.poll() is None
    assert len(locks()) == 3


def test_a_killed_runs_lock_is_removed_with_a_word(run: subprocess.Popen[str]) -> None:
    """Those of another study stay."""
    run.send_signal(signal.SIGKILL)
    run.wait()
    (word,) = one_run.begin(STUDY, [])
    assert word == f"the run of process {run.pid} was killed; its lock is removed, and this one goes on"
    assert locks() == {"1.output.lock"}
    assert one_run.begin(STUDY, []) == []


def test_the_study_is_held_before_snakemake_locks_it(run: subprocess.Popen[str], folder: Path) -> None:
    """So a kill at any later moment leaves locks that are known to be nobody's; a shorter record is whole."""
    (record,) = (folder / ".snakemake").glob("shukotsu-run-*.json")
    assert json.loads(record.read_text())["process"] == run.pid
    run.kill()
    run.wait()
    record.write_text(json.dumps({"process": run.pid, "host": socket.gethostname(), "more": "x" * 300}))
    one_run.begin(STUDY, [])
    assert record.read_text().startswith(json.dumps({"process": os.getpid(), "host": socket.gethostname()}))


def test_a_lock_of_another_machine_stays(run: subprocess.Popen[str]) -> None:
    """Whether its process lives cannot be known here."""
    run.kill()
    run.wait()
    (record,) = Path(".snakemake").glob("shukotsu-run-*.json")
    record.write_text(json.dumps({"process": run.pid, "host": "another machine"}))
    assert one_run.begin(STUDY, []) == []
    assert len(locks()) == 3
    record.write_text("no JSON")
    assert one_run.begin(STUDY, []) == []
    assert len(locks()) == 3


def test_files_that_are_gone_are_named() -> None:
    for name in "abc":
        Path(name).touch()
    assert one_run.gone([["a"], ["b", "c"]]) == ""
    made = [["a", "d1"], ["d2", "d3", "d4"], ["d5"]]
    assert one_run.gone(made) == (
        "d1, d2, d3 and 2 more: made by this run and removed while it went on; run the same command again, "
        "which makes what is missing"
    )
