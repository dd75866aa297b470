"""The coach's terminal: 80 columns, and lines that are typed."""

from __future__ import annotations

import unicodedata
from typing import Any

import pytest
from coach.fake_coach import ReturnHeld

from shukotsu.coach import terminal_face
from shukotsu.coach.terminal_face import COLUMNS, TerminalFace, entry_of, new_lines, view
from shukotsu.errors import InputError

KNOWN = {"digits": ["thumb", "index"], "points": ["post"], "quantities": ["index_middle"]}
REQUEST = {"number": 3, "sentence": "Close the hand. " * 9, "times": 2}
STATE: dict[str, Any] = {
    "title": {
        "study": "a study with a long name" * 3,
        "subject": "03",
        "hand": "left",
        "file": "03_left_rom.arrows",
    },
    "time_s": 31.5,
    "findings": ["The receivers on index_middle and middle_middle are swapped. " * 3],
    "request": REQUEST,
    "summary": None,
    "done": {"number": 1, "sentence": "The knuckle moved 24 deg: a little further. " * 4, "success": None},
    "joints": [{"joint": f"little_{n}", "sd_mm": n / 2, "verdict": "care"} for n in range(15)],
    "wanted_mm": 2.0,
    "settled": 3,
    "of": 15,
    "message": "m" * 200,
    "log": [{"time_s": float(n), "sentence": f"said {n}"} for n in range(5)],
    "logged": 12,
}


def test_no_line_is_longer_than_the_terminal_and_all_fit_into_its_rows() -> None:
    lines = view(STATE, "length index_middle 23.5", "")
    assert max(map(len, lines)) <= COLUMNS
    assert sum("little_" in line for line in lines) == 8


@pytest.mark.parametrize(
    ("line", "entry"),
    [
        ("", {"kind": "done", "number": 3}),
        ("s", {"kind": "skip", "number": 3}),
        ("q", {"kind": "finish"}),
        ("touch index thumb", {"kind": "touch", "digit": "index", "meets": "thumb"}),
        ("touch index post", {"kind": "touch", "digit": "index", "part": "tip", "point": "post"}),
        (
            "length index_middle 23,5",
            {"kind": "length", "quantity": "index_middle", "value_mm": 23.5, "sd_mm": 0.4},
        ),
        (
            "length index_middle 23.5 0.3",
            {"kind": "length", "quantity": "index_middle", "value_mm": 23.5, "sd_mm": 0.3},
        ),
        ("note a cable pulls", {"kind": "note", "text": "a cable pulls"}),
    ],
)
def test_a_line_is_an_entry(line: str, entry: dict[str, object]) -> None:
    assert entry_of(line, REQUEST, KNOWN) == [entry]


@pytest.mark.parametrize("line", ["x", "touch index", "length index_middle", "length index_middle much"])
def test_what_is_no_entry_is_said(line: str) -> None:
    with pytest.raises(InputError, match="expected"):
        entry_of(line, REQUEST, KNOWN)


def test_a_foot_switch_that_is_held_down_is_one_return(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terminal_face, "AGAIN_S", 3600.0)
    face = TerminalFace(ReturnHeld())
    face.show({**STATE, "marks": KNOWN})
    assert [len(face.entered()) for _ in range(5)] == [1, 0, 0, 0, 0]


def test_letters_of_two_columns_fit_as_well() -> None:
    state = {**STATE, "title": STATE["title"] | {"study": "手の骨" * 20}}
    lines = view(state, "note " + "指" * 60, "")
    widths = [sum(1 + (unicodedata.east_asian_width(own) == "W") for own in line) for line in lines]
    assert max(widths) <= COLUMNS


def test_where_it_is_piped_each_entry_of_the_log_is_a_line_once() -> None:
    assert new_lines(STATE, 12) == []
    assert [line.split("  ")[-1] for line in new_lines(STATE, 10)] == ["said 3", "said 4"]
