"""The coach in a terminal of 80 columns, rewritten in place; as plain lines where it is none.

What is typed makes a line, and Return hands it over: Return alone says that the request is done, or held
where a touch is asked for, as a foot switch that types Return does.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from typing import Any

from shukotsu.errors import InputError
from shukotsu.sentences.translation import N_, tr
from shukotsu.trackers.record.recording_terminal import Terminal

COLUMNS = 80
BAR = 10
KEPT = 3
"""Last lines that are shown whatever has no room: a message, the keys, what is typed."""

SIGNS = {"believe": "#", "care": "=", "no": "-"}
_HELP = N_("Return: done   s: skip   u: undo   touch index thumb   length index_middle 23.5 0.4   q: finish")


class TerminalFace:
    """Shows states on a terminal, and reads what is typed there."""

    def __init__(self, terminal: Terminal) -> None:
        self._terminal = terminal
        self._line = ""
        self._state: Mapping[str, Any] = {}
        self._logged = 0
        self._message = ""
        self._said = ""

    def show(self, state: Mapping[str, Any]) -> None:
        """Show a state: the whole view in place, or what is new in it, a line each."""
        self._state = state
        if self._terminal.in_place:
            lines, rows = view(state, self._line, self._message), self._terminal.rows
            self._terminal.show(_fitting(lines, rows))
            return
        for line in new_lines(state, self._logged):
            self._terminal.say(line)
        self._logged = state["logged"]
        if state["message"] and state["message"] != self._said:
            self._terminal.say(state["message"])
        self._said = state["message"] or self._said

    def entered(self) -> list[dict[str, Any]]:
        """Give what was typed and ended with Return."""
        entries = []
        pressed = self._terminal.pressed()
        for key in pressed:
            if key in "\r\n":
                try:
                    entries += entry_of(self._line, self._state.get("request"), self._state.get("marks", {}))
                    self._message = ""
                except InputError as error:
                    self._message = str(error)
                self._line = ""
            elif key in "\b\x7f":
                self._line = self._line[:-1]
            elif key.isprintable():
                self._line = (self._line + key)[:COLUMNS]
        if pressed and self._state:
            self.show(self._state)
        return entries


def entry_of(line: str, request: Mapping[str, Any] | None, known: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Read a typed line as entries. Raises InputError where it is none."""
    parts = line.split()
    simple = {"s": "skip", "u": "undo", "q": "finish"}
    if not parts:
        if request is not None and request["kind"] == "touch":
            return [
                {
                    "kind": "touch",
                    "digit": request["name"],
                    "part": "tip",
                    "point": next(iter(known["points"])),
                }
            ]
        return [{"kind": "done"}] if request is not None else []
    first, *rest = parts
    if first in simple and not rest:
        return [{"kind": simple[first]}]
    if first == "note" and rest:
        return [{"kind": "note", "text": " ".join(rest)}]
    if first == "touch" and len(rest) == 2:
        digit, other = rest
        to = {"meets": other} if other in known.get("digits", ()) else {"part": "tip", "point": other}
        return [{"kind": "touch", "digit": digit, **to}]
    if first == "length" and len(rest) in (2, 3):
        try:
            numbers = [float(text.replace(",", ".")) for text in rest[1:]]
        except ValueError:
            raise InputError(
                f"{line!r}: expected millimetres, such as length index_middle 23.5 0.4"
            ) from None
        return [{"kind": "length", "quantity": rest[0], "value_mm": numbers[0], "sd_mm": [*numbers, 0.4][1]}]
    raise InputError(f"{line!r} is not known; expected Return, s, u, q, touch, length or note")


def view(state: Mapping[str, Any], line: str, message: str) -> list[str]:
    """Give the lines of a view, at most 80 columns each."""
    title = state["title"]
    head = f"{title['study']}  {title['subject']} {title['hand']}  {title['file']}"[: COLUMNS - 10]
    lines = [f"{head}{state['time_s']:>{COLUMNS - len(head) - 2}.0f} s", ""]
    for finding in state["findings"]:
        lines += _wrapped(f"! {finding}", COLUMNS)
    request = state["request"]
    if request is not None:
        again = "" if request["times"] == 1 else f"  ({request['times']})"
        lines += [f">> {text}" for text in _wrapped(request["sentence"] + again, COLUMNS - 3)]
    elif state["summary"]:
        lines += _wrapped(state["summary"], COLUMNS)
    done = state["done"]
    if done is not None:
        sign = {True: "+", False: "x", None: " "}[done["success"]]
        lines += [f"{sign} {text}" for text in _wrapped(done["sentence"], COLUMNS - 2)]
    lines.append("")
    lines += _joint_lines(state)
    lines += ["", *_wrapped(message or state["message"], COLUMNS), tr(_HELP)[:COLUMNS], f": {line}"]
    return lines


def _fitting(lines: list[str], rows: int) -> list[str]:
    """Give at most so many lines, the last ones among them."""
    return lines if len(lines) <= rows else [*lines[: max(0, rows - KEPT)], *lines[-KEPT:]]


def _wide(text: str) -> int:
    """Columns of a text: letters of East Asia take two."""
    return sum(1 + (unicodedata.east_asian_width(letter) in "WF") for letter in text)


def _wrapped(text: str, columns: int) -> list[str]:
    """Lines of a text, broken between words, and within a word that is longer than a line."""
    lines, line = [], ""
    for part in [piece for word in text.split(" ") for piece in _pieces(word, columns)]:
        if line and _wide(line) + 1 + _wide(part) > columns:
            lines.append(line)
            line = part
        else:
            line = f"{line} {part}" if line else part
    return [*lines, line] if line else lines


def _pieces(word: str, columns: int) -> list[str]:
    pieces = [""]
    for letter in word:
        if _wide(pieces[-1] + letter) > columns:
            pieces.append("")
        pieces[-1] += letter
    return pieces


def _joint_lines(state: Mapping[str, Any]) -> list[str]:
    """A joint a cell, two a line: name, stated error, how near it is to what is wanted."""
    cells = []
    for joint in state["joints"]:
        share = min(1.0, state["wanted_mm"] / max(joint["sd_mm"], 1e-9))
        bar = SIGNS[joint["verdict"]] * round(BAR * share)
        cells.append(f"{joint['joint']:<11} {joint['sd_mm']:4.1f} mm [{bar:<{BAR}}]")
    half = -(-len(cells) // 2)
    pairs = [cells[i] + "   " + (cells[half + i] if half + i < len(cells) else "") for i in range(half)]
    if cells:
        pairs.append(
            tr(
                "{settled} of {of} good enough (# enough, = use with care, - not)",
                settled=state["settled"],
                of=state["of"],
            )
        )
    return pairs


def new_lines(state: Mapping[str, Any], logged: int) -> list[str]:
    """Give a line for each entry of the log since `logged`, of all that there were."""
    new = state["logged"] - logged
    return [f"{own['time_s']:7.1f} s  {own['sentence']}" for own in state["log"][-new:]] if new else []
