"""Spoilt streams, settings and archives: nothing but records, replies, skips and InputError comes out."""

from multiprocessing import Pipe

import pytest

from benchmarks.fuzz import Outcome, _followed, chance_of, main, run_apart, run_here, shares, spoil, targets
from benchmarks.tracker_streams import streams

DECODERS = tuple(streams(1))
FILES = tuple(name for name in targets() if name.startswith("file "))


def assert_all_well(outcome: Outcome, runs: int) -> None:
    assert not outcome.failures, next(iter(outcome.failures.values()))
    assert sum(outcome.counts.values()) == runs


@pytest.mark.parametrize("name", [*DECODERS, "settings", "archive"])
def test_spoilt_streams(name: str) -> None:
    outcome = run_here(name, 0, range(70))
    assert_all_well(outcome, 70)
    assert outcome.counts["decoded"] + outcome.counts["read"] > 8


def test_a_case_is_the_same_every_time_and_not_the_original() -> None:
    data = streams(1)["viper deg"].data
    one, again, other = (spoil(data, chance_of(3, "viper deg", run)) for run in (5, 5, 6))
    assert one == again
    assert len({data, one, other}) == 3


def test_files_get_their_share_of_the_runs() -> None:
    found = shares(list(targets()), 10_000)
    assert sum(found[name] for name in FILES) == pytest.approx(1000, abs=len(FILES))
    assert sum(found.values()) == pytest.approx(10_000, abs=len(found))


def test_the_command_tells_what_came_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--runs", "30", "--only", "position-angles group"]) == 0
    assert "trakstar position-angles group" in capsys.readouterr().out


def test_a_worker_that_dies_is_told_with_the_run_that_it_was_in() -> None:
    ours, theirs = Pipe(duplex=False)
    theirs.send(4)
    theirs.close()
    assert _followed(ours, 0) == ("crashed", 4)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*DECODERS, "settings", "archive"])
def test_many_spoilt_streams(name: str) -> None:
    runs = 20_000 // (len(DECODERS) + 2)
    assert_all_well(run_here(name, 1, range(runs)), runs)


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_spoilt_files(name: str) -> None:
    runs = 40 if name == "file c3d" else 400  # each C3D file is read in a process of its own
    assert_all_well(run_apart(name, 1, runs), runs)
