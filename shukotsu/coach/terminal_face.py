"""The coach in a terminal of 80 columns, rewritten in place; as plain lines where it is none.

What is typed makes a line, and Return hands it over: Return alone says that the request is done, or held
where a touch is asked for, as a foot switch that types Return does.
"""

from __future__ import annotations

import time
import unicodedata
from collections.abc import Mapping
from threading import RLock
from typing import Any

from shukotsu.errors import InputError
from shukotsu.sentences.translation import N_, tr
from shukotsu.trackers.record.recording_terminal import Terminal

COLUMNS = 80
BAR = 10
AGAIN_S = 0.7
"""Return that comes again within so long comes of a key that is held down."""

KEPT = 4
"""Last lines that are shown whatever has no room: a message, the keys, what is typed."""

SIGNS = {"believe": "#", "care": "=", "no": "-"}
_KEYS = N_("Return: done   s: skip   u: undo   q: finish")
_TYPED = "touch index thumb   length index_middle 23.5 0.4   note a cable pulls"


class TerminalFace:
    """Shows states on a terminal, and reads what is typed there."""

    def __init__(self, terminal: Terminal) -> None:
        self._terminal = terminal
        self._line = ""
        self._state: Mapping[str, Any] = {}
        self._logged = 0
        self._message = ""
        self._said = ""
        self._returned_s = -AGAIN_S
        self._lock = RLock()  # one thread shows, another one reads what is typed

    def show(self, state: Mapping[str, Any]) -> None:
        """Show a state: the whole view in place, or what is new in it, a line each."""
        with self._lock:
            self._state = state
            if self._terminal.in_place:
                lines, rows = view(state, self._line, self._message), self._terminal.rows
                self._terminal.show(_fitting(lines, rows))
            else:
                self._show_new(state)

    def _show_new(self, state: Mapping[str, Any]) -> None:
        for line in new_lines(state, self._logged):
            self._terminal.say(line)
        self._logged = state["logged"]
        if state["message"] and state["message"] != self._said:
            self._terminal.say(state["message"])
        self._said = state["message"] or self._said

    def entered(self) -> list[dict[str, Any]]:
        """Give what was typed and ended with Return."""
        with self._lock:
            return self._entered()

    def _entered(self) -> list[dict[str, Any]]:
        entries = []
        pressed = self._terminal.pressed()
        for key in pressed:
            if key in "\r\n":
                entries += self._returned()
            elif key in "\b\x7f":
                self._line = self._line[:-1]
            elif key.isprintable():
                self._line = (self._line + key)[:COLUMNS]
        if pressed and self._state:
            self.show(self._state)
        return entries

    def _returned(self) -> list[dict[str, Any]]:
        """Give what a line that is ended says; nothing where a key or a foot switch is only held down."""
        since_s, self._returned_s = time.monotonic() - self._returned_s, time.monotonic()
        line, self._line, self._message = self._line, "", ""
        if not line and since_s < AGAIN_S:
            return []
        try:
            return entry_of(line, self._state.get("request"), self._state.get("marks", {}))
        except InputError as error:
            self._message = str(error)
            return []


def entry_of(line: str, request: Mapping[str, Any] | None, known: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Read a typed line as entries. Raises InputError where it is none."""
    parts = line.split()
    on_request = {"": "done", "s": "skip"}
    if line.strip() in on_request:
        kind = on_request[line.strip()]
        return [] if request is None else [{"kind": kind, "number": request["number"]}]
    first, *rest = parts
    if first in ("u", "q") and not rest:
        return [{"kind": "undo" if first == "u" else "finish"}]
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
    head = _cut(f"{title['study']}  {title['subject']} {title['hand']}  {title['file']}", COLUMNS - 10)
    lines = [f"{head}{state['time_s']:>{COLUMNS - _wide(head) - 2}.0f} s", ""]
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
    lines += ["", *_wrapped(message or state["message"], COLUMNS)]
    return [*lines, tr(_KEYS), _TYPED, _cut(f": {line}", COLUMNS)]


def _fitting(lines: list[str], rows: int) -> list[str]:
    """Give at most so many lines, the last ones among them."""
    return lines if len(lines) <= rows else [*lines[: max(0, rows - KEPT)], *lines[-KEPT:]]


def _wide(text: str) -> int:
    """Columns of a text: letters of East Asia take two."""
    return sum(1 + (unicodedata.east_asian_width(letter) in "WF") for letter in text)


def _cut(text: str, columns: int) -> str:
    """Give the beginning of a text that has room."""
    return _pieces(text, columns)[0]


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
