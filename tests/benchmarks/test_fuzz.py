"""Damaged streams, settings and archives: nothing but records, replies, skips and InputError comes out."""

from __future__ import annotations

import os

import pytest

from benchmarks.__main__ import main
from benchmarks.fuzz import TARGETS, Outcome, Run, chance_of, damage, run_apart, run_one, runs_of
from benchmarks.tracker_streams import streams

FILES = tuple(name for name in TARGETS if name.startswith("file "))
STREAMS = tuple(name for name in TARGETS if name not in FILES)


def run_here(name: str, seed: int, runs: int) -> Outcome:
    outcome = Outcome()
    for number in range(runs):
        outcome.add(number, run_one(name, seed, number))
    return outcome


def assert_all_well(outcome: Outcome, runs: int) -> None:
    assert not outcome.failures, next(iter(outcome.failures.values()))
    assert sum(outcome.counts.values()) == runs


@pytest.mark.parametrize("name", STREAMS)
def test_damaged_streams(name: str) -> None:
    outcome = run_here(name, 0, 25)
    assert_all_well(outcome, 25)
    assert outcome.counts["decoded"] + outcome.counts["read"] > 2


def test_a_case_is_the_same_every_time_and_not_the_original() -> None:
    data = streams(1)["viper"].data
    one, again, other = (damage(data, chance_of(3, "viper", run)) for run in (5, 5, 6))
    assert one == again
    assert len({data, one, other}) == 3


def test_files_get_fewer_runs() -> None:
    assert [runs_of(name, 1000) for name in ("viper", "file csv", "file c3d")] == [1000, 100, 50]
    assert runs_of("file c3d", 1) == 1


def test_the_command_prints_the_outcomes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fuzz", "--runs", "30", "--only", "trakstar group"]) == 0
    assert "trakstar group" in capsys.readouterr().out


def _dies_in_run_2(_name: str, _seed: int, number: int) -> Run:
    if number == 2:
        os._exit(1)
    return Run("read", peak_mb=10.0)


def test_a_worker_that_dies_is_a_failure_of_its_run_and_the_rest_go_on() -> None:
    outcome = run_apart("any", 0, 4, _dies_in_run_2, patience_s=0.5, start="fork")
    assert outcome.counts == {"read": 3}
    assert outcome.failures == {2: "crashed, or hung for 0.5 s"}


@pytest.mark.slow
@pytest.mark.parametrize("name", STREAMS)
def test_many_damaged_streams(name: str) -> None:
    runs = 20_000 // len(STREAMS)
    assert_all_well(run_here(name, 1, runs), runs)


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_damaged_files(name: str) -> None:
    runs = 40 if name == "file c3d" else 400  # each C3D file is read in a process of its own
    assert_all_well(run_apart(name, 1, runs), runs)
