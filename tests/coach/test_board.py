"""The board: newest state to all, bounded for who does not read, entries checked by their fields."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from shukotsu.coach.board import MOST_BATCHES, MOST_ENTRIES, Board
from shukotsu.errors import InputError


def poses(x: float) -> list[list[list[float]]]:
    return [[[x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]]


def test_the_newest_state_is_given_and_nobody_shares_it() -> None:
    board, state = Board(), {"time_s": 1, "sd": [math.nan, np.float64(1.5)], "at": np.zeros(2)}
    assert board.subscribe().take(0) == []
    board.publish(state)
    expected = {"time_s": 1, "sd": [None, 1.5], "at": [0.0, 0.0]}
    state["time_s"] = 2
    assert board.subscribe().take(0) == [("state", json.dumps(expected))]


def test_a_viewer_that_does_not_read_costs_the_oldest_batches_alone() -> None:
    board = Board()
    slow, quick, gone = board.subscribe(), board.subscribe(), board.subscribe()
    gone.close()
    for x in range(1000):
        board.publish({"time_s": x})
        board.show_poses([x], poses(x))
        assert [kind for kind, _ in quick.take(0)] == ["state", "poses"]
    found = slow.take(0)
    assert found[0] == ("state", '{"time_s": 999}')
    assert [json.loads(text)["times_s"][0] for _, text in found[1:]] == [*range(1000 - MOST_BATCHES, 1000)]
    assert slow.take(0) == gone.take(0) == []


def test_a_pose_that_lacks_a_number_is_none() -> None:
    board = Board()
    viewer = board.subscribe()
    values = np.full((1, 2, 7), 1 / 3)
    values[0, 1, 4] = np.nan
    board.show_poses(np.array([1 / 30]), values)
    ((_, text),) = viewer.take(0)
    third = [0.33] * 3 + [0.33333] * 4
    assert json.loads(text) == {"times_s": [0.0333], "poses": [[third, None]]}


@pytest.mark.parametrize(
    "entry",
    [
        {"kind": "touch", "digit": "index", "meets": "thumb"},
        {"kind": "touch", "digit": "index", "part": "tip", "point": "post"},
        {"kind": "length", "quantity": "index_middle.lateral", "value_mm": -3.1, "sd_mm": 0.4},
        {"kind": "note", "text": "指輪を外した"},
        {"kind": "skip", "number": 3},
        *({"kind": kind} for kind in ("undo", "done", "skip", "finish")),
    ],
)
def test_entries_of_the_contract_are_taken_once(entry: dict[str, Any]) -> None:
    board = Board()
    board.enter(entry)
    assert board.entered() == [entry]
    assert board.entered() == []


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ([], "no object"),
        ({}, "expected one of: touch, digit, meets"),
        ({"kind": "done", "event": "stop"}, "fields of its kind"),
        ({"kind": ["done"]}, "fields of its kind"),
        ({"kind": "undo", "number": 1}, "fields of its kind"),
        ({"kind": "done", "number": True}, "number of the entry"),
        ({"kind": "note", "text": "a\nb"}, "text of the entry"),
        ({"kind": "note", "text": "a" * 201}, "text of the entry"),
        ({"kind": "length", "quantity": "a", "value_mm": math.inf, "sd_mm": 1}, "value_mm of the entry"),
        ({"kind": "length", "quantity": "a", "value_mm": 1, "sd_mm": True}, "sd_mm of the entry"),
    ],
)
def test_other_entries_are_refused(entry: Any, said: str) -> None:
    board = Board()
    with pytest.raises(InputError, match=said):
        board.enter(entry)
    assert board.entered() == []


def test_entries_that_nobody_takes_are_bounded() -> None:
    board = Board()
    for _ in range(MOST_ENTRIES):
        board.enter({"kind": "done"})
    with pytest.raises(InputError, match="wait already"):
        board.enter({"kind": "done"})
    assert len(board.entered()) == MOST_ENTRIES
