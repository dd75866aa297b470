"""Sheets: tab-separated tables that people keep (recordings, participants, corrections, measurements).

Every cell is checked; a message names the file, the row (as an editor counts lines) and the column.
"""

from __future__ import annotations

import difflib
import math
import unicodedata
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError, listed
from shukotsu.files import limits
from shukotsu.files.text_files import read_text
from shukotsu.schemas.left import instead

MAX_MESSAGES = 5

_NEAR, _NEAR_LETTERS = 0.75, 2
"""How like a column that is not there a typo of its name is, and by how many letters it is longer."""


@dataclass(frozen=True)
class Cell:
    """One column of a sheet: how to read it, what it means, and whether it may be missing.

    unless : another column; where that has a cell, this one needs none though it is required else.
    """

    name: str
    read: Callable[[str], Any]
    description: str
    required: bool = True
    default: Any = None
    unless: str = ""

    def needed(self, given: Collection[str]) -> bool:
        """Return whether it must be there, where those other columns are."""
        return self.required and not (self.unless and self.unless in given)


@dataclass(frozen=True)
class Sheet:
    """One kind of sheet: its columns, those that identify a row, and whether others are allowed."""

    name: str
    cells: tuple[Cell, ...]
    key: tuple[str, ...]
    more_columns: bool = False


@dataclass(frozen=True)
class Row:
    """A row that was read: its line in the file and its values by column."""

    line: int
    values: Mapping[str, Any]

    def __getitem__(self, column: str) -> Any:
        return self.values[column]


def _text(text: str) -> str:
    if not text:
        raise ValueError("is empty")
    if any(unicodedata.category(letter) == "Cc" for letter in text):
        raise ValueError("holds a control character")
    return text


def _reason(text: str) -> str:
    """Read a reason; empty where the cell says no."""
    word = text.lower()
    if word in ("no", "false", "0"):
        return ""
    if word in ("n", "y", "n/a", "na", "nan", "none", "null", "-", "?"):
        raise ValueError(f"is {text!r}; expected a reason, yes or no")
    return _text(text)


def _one_of(*words: str) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in words:
            if why := instead("format", text):
                raise ValueError(why)
            raise ValueError(f"is {text!r}; expected {', '.join(words[:-1])} or {words[-1]}")
        return text

    return read


def _number(text: str) -> float:
    try:
        value = float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"is {text!r}; expected a number")
    return value


def _positive(text: str) -> float:
    value = _number(text)
    if value <= 0:
        raise ValueError(f"is {text!r}; expected a number above zero")
    return value


def _size(name: str) -> Callable[[str], float]:
    least, largest = limits.HAND_SIZES_MM[name]

    def read(text: str) -> float:
        value = _positive(text)
        if not least < value < largest:
            raise ValueError(f"is {text!r}; expected millimetres, {least:g} to {largest:g}")
        return value

    return read


SUBJECT = Cell("subject", _text, "the subject's name; any text")
SESSION = Cell(
    "session",
    _text,
    "which session, where receivers were taken off and put on anew: a skeleton is solved for each",
    False,
    "",
)
OF_SESSION = Cell("session", _text, "the session that the row is for; empty for all", False, "")
HAND = Cell("hand", _one_of("right", "left"), "right or left")

RECORDINGS = Sheet(
    "recordings",
    (
        SUBJECT,
        HAND,
        Cell("task", _text, "what was done, e.g. rom or opposition"),
        Cell("role", _one_of("calibration", "evaluation", "both"), "what the recording is for"),
        Cell("file", _text, "the recording, relative to the study file"),
        SESSION,
        Cell("trial", _text, "which repetition, where a task was recorded more than once", False, ""),
        Cell(
            "layout",
            _text,
            "the layout of this recording, where it is not the study's; one hand's may wear fewer receivers",
            False,
            "",
        ),
        Cell(
            "format",
            _one_of("auto", "csv", "parquet", "capture", "xdf"),
            "the file's format; auto goes by its ending",
            False,
            "auto",
        ),
        Cell(
            "mapping",
            _text,
            "how to read the file, where it is not this project's own and not as the study's `mapping` says",
            False,
            "",
        ),
        Cell(
            "hemisphere",
            _one_of("keep", "repair"),
            "repair: put positions back that are on the other side of the transmitter, at times or all along",
            False,
            "keep",
        ),
        Cell(
            "exclude",
            _reason,
            "a reason to leave the recording out, or just yes, true or 1; empty, no, false or 0 to use it",
            False,
            "",
        ),
        Cell(
            "accept",
            _reason,
            "a reason to let it count though a finding calls it suspect; empty, no, false or 0 for none",
            False,
            "",
        ),
        Cell("events", _text, "a file of its events, relative to the study file (docs/events.md)", False, ""),
        Cell("pulses", _text, "which of these events the recording has too (docs/events.md)", False, ""),
    ),
    ("subject", "session", "hand", "task", "trial"),
    more_columns=True,
)

PARTICIPANTS = Sheet(
    "participants",
    (
        SUBJECT,
        Cell(
            "hand_length_mm", _size("hand_length_mm"), "wrist crease to the tip of the middle finger", False
        ),
        Cell("hand_breadth_mm", _size("hand_breadth_mm"), "across the knuckles of digits 2 to 5", False),
    ),
    ("subject",),
    more_columns=True,
)

CORRECTIONS = Sheet(
    "corrections",
    (
        SUBJECT,
        HAND,
        OF_SESSION,
        Cell("joint", _text, "the joint, as the layout names it"),
        Cell("dx_mm", _number, "shift along x of the child's receiver"),
        Cell("dy_mm", _number, "shift along y of the child's receiver"),
        Cell("dz_mm", _number, "shift along z of the child's receiver"),
        Cell("note", _text, "why", False, ""),
    ),
    ("subject", "session", "hand", "joint"),
)

MEASUREMENTS = Sheet(
    "measurements",
    (
        SUBJECT,
        HAND,
        OF_SESSION,
        Cell("quantity", _text, "what was measured, e.g. the length of a bone by its segment"),
        Cell("value_mm", _number, "its value"),
        Cell("sd_mm", _positive, "1-sigma error of the measurement"),
    ),
    ("subject", "session", "hand", "quantity"),
)

TOUCHES = Sheet(
    "touches",
    (
        SUBJECT,
        HAND,
        OF_SESSION,
        Cell("task", _text, "the recording in which the fingertip was touched, or touched something"),
        Cell("trial", _text, "its repetition, where it has one", False, ""),
        Cell("digit", _text, "the digit, as the layout names it"),
        Cell(
            "part",
            _one_of("tip", "pad"),
            "what touched: tip, the very end of the digit, skin and all, or pad; empty: pad where digits "
            "meet, else tip",
            False,
            "",
        ),
        Cell("meets", _text, "the digit that it met, part on part; then no point is needed", False, ""),
        Cell("from_s", _number, "begin of the touch, device time of the recording"),
        Cell("to_s", _number, "its end"),
        Cell("x_mm", _number, "the point in the transmitter frame, x", unless="meets"),
        Cell("y_mm", _number, "the point in the transmitter frame, y", unless="meets"),
        Cell("z_mm", _number, "the point in the transmitter frame, z", unless="meets"),
        Cell(
            "sd_mm",
            _positive,
            "1-sigma error of the point, per direction; of digits that meet 1.5 mm",
            unless="meets",
        ),
    ),
    ("subject", "session", "hand", "task", "trial", "digit", "meets", "from_s"),
)

EVENTS = Sheet(
    "events",
    (
        SUBJECT,
        HAND,
        Cell("session", _text, "its session, where the subject has several", False, ""),
        Cell("task", _text, "the recording in which it happened"),
        Cell("trial", _text, "its repetition, where there are several", False, ""),
        Cell("onset_s", _number, "when it began, device time of the recording"),
        Cell("duration_s", _positive, "how long it lasted", False),
        Cell("name", _text, "what it was; events of one name cut the movement into cycles", False, ""),
        Cell("value", _number, "what came with it, e.g. a key's velocity", False),
    ),
    ("subject", "session", "hand", "task", "trial", "onset_s", "name", "value"),
)

SHEETS = {
    sheet.name: sheet for sheet in (RECORDINGS, PARTICIPANTS, CORRECTIONS, MEASUREMENTS, TOUCHES, EVENTS)
}
HAND_SHEETS = ("corrections", "measurements", "touches", "events")
"""Those whose rows say something of one hand each."""


def read_sheet(path: Path | None, sheet: Sheet, more: Collection[str] = ()) -> list[Row]:
    """Read a sheet (UTF-8, tab-separated, a header line; empty lines are skipped); no path, no rows.

    more : further columns that it may have, read as text.
    Raises InputError that names every bad cell (the first five) by file, row and column.
    """
    if path is None:
        return []
    return sheet_rows(path, read_text(path, f"the sheet of {sheet.name}", limits.SHEET_BYTES), sheet, more)


def sheet_rows(path: Path, text: str, sheet: Sheet, more: Collection[str] = ()) -> list[Row]:
    """Read the text of a sheet as `read_sheet` does; path : what messages call it. Raises as that does."""
    numbered = [
        (number, [cell.strip() for cell in line.split("\t")])
        for number, line in enumerate(text.split("\n"), 1)
        if line.strip()
    ]
    if not numbered:
        raise InputError(f"{path}: is empty; expected a header line with {_columns(sheet)}")
    _check_header(path, sheet, numbered[0][1], more)
    header = numbered[0][1]
    rows, messages = [], []
    for line, cells in numbered[1:]:
        row, bad = _read_row(sheet, header, line, cells)
        rows.append(row)
        messages += bad
    messages += _twins(sheet, rows)
    if messages:
        more = f"; and {len(messages) - MAX_MESSAGES} more" if len(messages) > MAX_MESSAGES else ""
        raise InputError(f"{path}: " + "; ".join(messages[:MAX_MESSAGES]) + more)
    return rows


def _columns(sheet: Sheet) -> str:
    return ", ".join(cell.name for cell in sheet.cells if cell.required)


def _check_header(path: Path, sheet: Sheet, header: list[str], more: Collection[str]) -> None:
    known = [cell.name for cell in sheet.cells]
    odd = [name for name in header if name and name not in known and name not in more]
    for name in odd:
        close = difflib.get_close_matches(name.lower(), [own for own in known if own not in header], 1, _NEAR)
        if close and abs(len(close[0]) - len(name)) <= _NEAR_LETTERS:
            raise InputError(f"{path}: row 1: unknown column {name}; did you mean {close[0]!r}?")
    missing = [cell.name for cell in sheet.cells if cell.needed(header) and cell.name not in header]
    if missing:
        hint = "; are the columns separated by tabs?" if len(header) == 1 else ""
        raise InputError(
            f"{path}: row 1: column {', '.join(missing)} is missing; found {listed(header)}{hint}"
        )
    twice = sorted({name for name in header if header.count(name) > 1})
    if twice:
        raise InputError(f"{path}: row 1: column {listed(twice)} is given twice")
    if odd and not sheet.more_columns:
        raise InputError(f"{path}: row 1: unknown column {listed(odd)}; known are {', '.join(known)}")


def _read_row(sheet: Sheet, header: list[str], line: int, cells: list[str]) -> tuple[Row, list[str]]:
    if len(cells) > len(header):
        return Row(line, {}), [f"row {line}: has {len(cells)} cells; expected {len(header)}"]
    given = dict(zip_longest(header, cells, fillvalue=""))
    values: dict[str, Any] = {k: v for k, v in given.items() if k not in {c.name for c in sheet.cells}}
    messages, filled = [], {name for name, text in given.items() if text}
    for cell in sheet.cells:
        text = given.get(cell.name, "")
        try:
            values[cell.name] = cell.read(text) if text or cell.needed(filled) else cell.default
        except ValueError as error:
            other = f", or a cell in column {cell.unless}" if cell.unless and not text else ""
            messages.append(f"row {line}, column {cell.name}: {error}{other}")
    return Row(line, values), messages


def _twins(sheet: Sheet, rows: Iterable[Row]) -> list[str]:
    seen: dict[tuple[Any, ...], int] = {}
    messages = []
    for row in rows:
        if not set(sheet.key) <= row.values.keys():
            continue
        key = tuple(row[column] for column in sheet.key)
        if key in seen:
            names = ", ".join(f"{c} {v!r}" for c, v in zip(sheet.key, key, strict=True) if v)
            messages.append(f"row {row.line}: {names} already stands in row {seen[key]}")
        seen.setdefault(key, row.line)
    return messages
