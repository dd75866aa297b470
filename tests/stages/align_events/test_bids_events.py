"""Reading events of a BIDS dataset."""

from pathlib import Path

import numpy as np
import pytest

from shukotsu.errors import InputError
from shukotsu.stages.align_events.bids_events import read_bids_events
from shukotsu.stages.align_events.event_list import Clock, Events


def read(tmp_path: Path, *rows: str) -> Events:
    path = tmp_path / "sub-01_task-rom_events.tsv"
    path.write_text("\n".join(row.replace(" ", "\t") for row in rows) + "\n", "utf-8")
    return read_bids_events(path)


def test_names_and_values(tmp_path: Path) -> None:
    rows = ("onset duration trial_type value", "1.5 0.25 tap 64", "-2 n/a n/a go", "3 0 n/a n/a")
    events = read(tmp_path, *rows)
    assert events.names == ("tap", "go", "event")
    np.testing.assert_array_equal(events.time_s, [1.5, -2, 3])
    np.testing.assert_array_equal(events.duration_s, [0.25, np.nan, 0])
    np.testing.assert_array_equal(events.value, [64, np.nan, np.nan])
    assert events.clock is Clock.START


def test_onset_and_duration_are_enough(tmp_path: Path) -> None:
    assert read(tmp_path, "onset duration", "1 2").names == ("event",)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (("onset value", "1 2"), "column duration is missing; found onset, value"),
        (("onset duration", "a 2"), "row 2, column onset: is 'a'; expected seconds"),
        (("onset duration", "1 2", "n/a 2"), "row 3, column onset: is empty"),
        (("onset duration", "1 inf"), "row 2, column duration: is 'inf'"),
        (("onset duration", "1 0", "2 -1"), "row 3, column duration: is -1; expected 0 s or more"),
        (("onset duration", "1 2 3"), "line 2: has 3 cells; expected 2"),
        (("",), "is empty"),
    ],
)
def test_what_is_refused(tmp_path: Path, rows: tuple[str, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, *rows)
