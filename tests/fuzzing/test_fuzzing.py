"""Damaged streams, settings and archives: nothing but records, replies, skips and InputError comes out."""

from __future__ import annotations

import pytest

from fuzzing.targets import TARGETS, chance_of, damage, outcomes
from fuzzing.tracker_streams import streams

FILES = tuple(name for name in TARGETS if name.startswith("file "))
STREAMS = tuple(name for name in TARGETS if name not in FILES)


@pytest.mark.parametrize("name", STREAMS)
def test_damaged_streams(name: str) -> None:
    counts = outcomes(name, 0, 25)
    assert counts["decoded"] + counts["read"] > 2


def test_a_case_is_the_same_every_time_and_not_the_original() -> None:
    data = streams(1)["viper"].data
    one, again, other = (damage(data, chance_of(3, "viper", run)) for run in (5, 5, 6))
    assert one == again
    assert len({data, one, other}) == 3


@pytest.mark.slow
@pytest.mark.parametrize("name", STREAMS)
def test_many_damaged_streams(name: str) -> None:
    runs = 20_000 // len(STREAMS)
    counts = outcomes(name, 1, runs)
    assert counts.total() == runs
    assert counts["decoded"] + counts["read"] > runs // 20


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_damaged_files(name: str) -> None:
    outcomes(name, 1, 40 if name == "file c3d" else 400)  # a C3D file is read in a process of its own
