"""Damaged input comes out read or as InputError, and what does not is counted and kept."""

from __future__ import annotations

import json
import os
import signal
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from fuzzing import targets, worker
from fuzzing.targets import FOLDER_OF_SEEDS, TARGETS, Target, random_input, target


@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("name", TARGETS)
def test_clean_inputs_inputs_that_failed_once_and_random_damage(name: str) -> None:
    count = 3 if "c3d" in name else 12
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", ResourceWarning)
        assert target(name).check(target(name).seeds[0]) in ("read", "decoded", "refused")
        for data in (*target(name).seeds, *(random_input(name, 0, number) for number in range(count))):
            target(name).check(data)


@pytest.mark.parametrize("name", [name for name in TARGETS if name != "file parquet, odd types"])
def test_what_is_spoilt_is_sound_before(name: str) -> None:
    """Else the readers' first lines alone would be reached."""
    assert target(name).check(target(name).seeds[0]) in ("read", "decoded")


def test_every_stored_input_belongs_to_a_target_and_all_are_small() -> None:
    stored = [path for path in FOLDER_OF_SEEDS.rglob("*") if path.is_file()]
    assert {path.parent.name for path in stored} <= {name.replace(" ", "_") for name in TARGETS}
    assert 0 < sum(path.stat().st_size for path in stored) < 100_000


def test_an_input_is_the_same_every_time_and_not_the_original() -> None:
    one, again, other = (random_input("stream viper", 3, number) for number in (5, 5, 6))
    assert one == again
    assert len({*target("stream viper").seeds, one, other}) == 3


def _raise() -> None:
    raise KeyError("a")


def _warn() -> None:
    warnings.warn("odd", stacklevel=2)


def _never_end() -> None:
    while True:
        sum(range(1000))


@pytest.mark.parametrize(
    ("fail", "count"),
    [
        (_raise, "failures"),
        (_warn, "failures"),
        (_never_end, "hangs"),
        (lambda: os.kill(os.getpid(), signal.SIGKILL), "crashed"),
    ],
)
def test_what_fails_is_counted_and_its_input_kept(
    fail: Callable[[], None], count: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def check(data: bytes) -> str:
        if data == b"bad":
            fail()
        return "read"

    planted = Target((b"good", b"bad", b"good"), check, lambda *_: b"good")
    monkeypatch.setattr(targets, "_TARGETS", {"planted": lambda: planted})
    monkeypatch.setattr(targets, "target", lambda _: planted)
    monkeypatch.setattr(worker, "atheris", None)
    monkeypatch.setattr(worker, "LONGEST_S", 0.3)
    job = worker.Job("planted", 10, 1, tmp_path / "failed", tmp_path)
    counts = worker.supervised(job, time.monotonic() + 60)
    kept = [path for path in (tmp_path / "failed" / "planted").iterdir() if path.suffix != ".txt"]
    assert [path.read_bytes() for path in kept] == [b"bad"]
    assert counts["done"] == 10
    assert {name: counts[name] for name in ("failures", "hangs", "crashed")} == {
        **dict.fromkeys(("failures", "hangs", "crashed"), 0),
        count: 1,
    }


def test_too_much_memory_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "MEMORY_BYTES", 10**6)
    progress = worker.Progress(tmp_path / "progress")
    fuzzer = worker.Fuzzer("planted", Target((), lambda _: "read"), tmp_path, progress)
    fuzzer._peak_kb = 0  # as if this process had grown to what it is by this input
    fuzzer.take(b"a")
    assert progress.get()["failures"] == 1


@pytest.mark.slow
def test_all_targets_with_random_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(worker, "atheris", None)
    assert worker.main(["--inputs=4000", f"--folder={tmp_path}"]) == 0
    last = json.loads(capfd.readouterr().out.splitlines()[-1])
    assert set(last["outcomes"]) == set(TARGETS)
    assert sum(counts["done"] for counts in last["outcomes"].values()) >= 4000
    assert not list(tmp_path.iterdir())
