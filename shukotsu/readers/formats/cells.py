"""Convert columns of a file to numbers, times or names; a cell that cannot be converted is an InputError."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import InputError, count_of, shorten
from shukotsu.tables.limits import SECONDS_PER_UNIT
from shukotsu.tables.text_files import NO_VALUE

DAY_S = 86_400.0
_JITTER_S = 3600.0
_TIME_OF_DAY = r"^(?P<h>[0-9]{1,2}):(?P<m>[0-5]?[0-9]):(?P<s>[0-5]?[0-9](?:[.,][0-9]*)?)$"

DATES = "iso8601"
"""`time_unit` of times that are written as dates."""
_DATE = (
    r"^(?P<day>\d{4}-\d\d-\d\d)[T ](?P<h>\d\d):(?P<m>\d\d):(?P<s>\d\d(?:[.,]\d*)?)"
    r" ?(?:Z|z|(?P<sign>[+-])(?P<zone_h>\d\d):?(?P<zone_m>\d\d))?$"
)
_A_DATE = "a date as 2026-03-04T10:15:30.120Z (year, month, day)"
_TIME = f"a number, or {_A_DATE}; a mapping reads times of the day, by time_unit: hh:mm:ss"

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")

_IS_TEXT = (pa.types.is_string, pa.types.is_large_string, pa.types.is_string_view)
_TICKS_A_S = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}

_LARGEST_EXACT = 2.0**53
"""Above this, floating-point numbers cannot represent every whole number."""


class Cells:
    """N rows of some columns; every method raises an InputError that names the row of the first invalid cell.

    Parameters
    ----------
    locate : callable
        Function from a row, counted from 0, to its file and line, for messages.
    empty : sequence of str, or None
        Texts that mean "no value" in addition to NO_VALUE; a cell that is numerically equal to one of them is
        empty, too. None if the file has typed columns instead of text.
    decimal : str
        Decimal mark of text.
    empty_rows : int
        Number of rows without any cell that were dropped.

    """

    def __init__(
        self,
        path: Path,
        table: pa.Table,
        locate: Callable[[int], str],
        empty: Sequence[str] | None = None,
        decimal: str = ".",
        empty_rows: int = 0,
    ) -> None:
        self.locate = locate
        self.dropped = (f"{count_of(empty_rows, 'empty row', 'are')} left out",) if empty_rows else ()
        self.rows: int = table.num_rows
        self._path, self._empty, self._decimal = path, empty, decimal
        self._missing = []  # numbers that mean "no value", whatever their decimal mark
        for text in empty or ():
            with suppress(ValueError):
                self._missing += [float(text.replace(",", "."))] if "_" not in text else []
        self.names: list[str] = table.column_names
        self._columns = dict(zip(table.column_names, table.columns, strict=True))
        self._reals: dict[str, Array] = {}

    def reals(self, name: str, expected: str = "a number") -> Array:
        """Return a column's numbers, shape (N,), NaN for empty cells. expected : for the error message."""
        if name not in self._reals:
            numbers = np.asarray(self._numbers(name, expected).to_numpy(), float)
            self._reals[name] = np.where(np.isin(numbers, self._missing), np.nan, numbers)
        return self._reals[name]

    def times_s(self, name: str, unit: str) -> Array:
        """Return times in s, (N,), NaN if empty: numbers in `unit`, or ISO 8601 dates as s since 1970."""
        column = self._columns[name]
        if self._empty is None or (unit != DATES and _cast(column, pa.float64()) is not None):
            return self.reals(name) * SECONDS_PER_UNIT.get(unit, 1.0)
        text = _trim(column.cast(pa.string()), self._empty)
        parts = pc.extract_regex(text, _DATE)
        if unit != DATES and parts.null_count == len(parts):
            return self.reals(name, _TIME) * SECONDS_PER_UNIT[unit]
        days = pc.strptime(pc.struct_field(parts, "day"), "%Y-%m-%d", "s", error_is_null=True)
        odd = pc.and_(pc.is_null(days), pc.is_valid(text))
        self._refuse_first(odd.to_numpy(), name, _A_DATE)
        hours, minutes, seconds, zone_h, zone_m = _clock(parts, "h", "m", "s", "zone_h", "zone_m")
        west = pc.fill_null(pc.equal(pc.struct_field(parts, "sign"), "-"), False)
        sign = np.where(west.to_numpy(), -1.0, 1.0)
        whole_s = days.cast(pa.int64()).cast(pa.float64()).to_numpy()
        return np.asarray(whole_s + 3600 * (hours - sign * zone_h) + 60 * (minutes - sign * zone_m) + seconds)

    def times_of_day_s(self, name: str) -> Array:
        """Return times written as hh:mm:ss (decimals allowed) in s since midnight, (N,), NaN if empty."""
        text = _trim(self._columns[name].cast(pa.string()), self._empty or ())
        parts = pc.extract_regex(text, _TIME_OF_DAY)
        odd = pc.and_(pc.is_null(parts), pc.is_valid(text))
        self._refuse_first(odd.to_numpy(), name, "a time as hh:mm:ss")
        hours, minutes, seconds = _clock(parts, *"hms")
        return np.asarray(3600.0 * hours + 60.0 * minutes + seconds)

    def wholes(self, name: str) -> Integers:
        """Return whole numbers, shape (N,); 3.0 and 1,001 are accepted, an empty cell is an error."""
        column = self._columns[name]
        exact = None
        if self._empty is not None or pa.types.is_integer(column.type):
            exact = _cast(column, pa.int64())
        if exact is None and self._empty is not None:
            mark = "[.'\u00a0\u202f]" if self._decimal == "," else "[,'\u00a0\u202f]"
            thousands = pc.match_substring_regex(column, rf"^\s*[+-]?\d{{1,3}}({mark}\d{{3}})+\s*$")
            column = pc.if_else(thousands, pc.replace_substring_regex(column, mark, ""), column)
            self._columns[name], exact = column, _cast(column, pa.int64())
        if exact is not None and not exact.null_count:
            wholes = np.asarray(exact.to_numpy(), np.int64)
            large = (wholes > _LARGEST_EXACT) | (wholes < -_LARGEST_EXACT)
            self._refuse_first(large, name, "a whole number of at most 15 digits")
            return wholes
        reals = self.reals(name)
        whole = (np.abs(reals) <= _LARGEST_EXACT) & (reals == np.floor(reals))
        self._refuse_first(~whole, name, "a whole number")
        return reals.astype(np.int64)

    def names_in(self, name: str) -> tuple[Integers, list[str]]:
        """Return a text column as (N,) indices into a list of names; an empty cell is an error."""
        column = self._columns[name]
        kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
        if not any(is_text(kind) for is_text in _IS_TEXT):
            raise InputError(f"{self._path}: column {name} is {kind}; expected text")
        encoded = column.cast(kind).cast(pa.string()).dictionary_encode().combine_chunks()
        trimmed = pc.utf8_trim_whitespace(encoded.dictionary)  # NO_VALUE does not apply: "NA" may be a name
        trimmed = pc.if_else(pc.is_in(trimmed, pa.array(["", *(self._empty or ())])), None, trimmed)
        codes = pc.take(trimmed.dictionary_encode(), encoded.indices)
        self._refuse_first(pc.is_null(codes).to_numpy(zero_copy_only=False), name, "a name")
        return np.asarray(codes.indices.to_numpy(), np.int64), codes.dictionary.to_pylist()

    def _numbers(self, name: str, expected: str) -> pa.ChunkedArray:
        text = column = self._columns[name]
        if self._empty is None:
            if pa.types.is_duration(column.type) or pa.types.is_timestamp(column.type):
                ticks = column.cast(pa.int64())  # a timestamp counts from 1970
                return pc.divide(ticks.cast(pa.float64(), safe=False), _TICKS_A_S[column.type.unit])
            is_number = (pa.types.is_integer, pa.types.is_floating, pa.types.is_decimal, pa.types.is_null)
            if not any(check(column.type) for check in is_number):
                raise InputError(f"{self._path}: column {name} is {column.type}; expected numbers")
            return column.cast(pa.float64(), safe=False)
        if self._decimal == ",":
            text = _trim(text, self._empty)
            points = pc.fill_null(pc.match_substring(text, "."), False)
            self._refuse_first(points.to_numpy(), name, "a number with a decimal comma")
            text = pc.replace_substring(text, ",", ".")
        numbers = _cast(text, pa.float64())
        if numbers is None:
            text = pc.replace_substring(_trim(text, self._empty), "\N{MINUS SIGN}", "-")
            numbers = _cast(text, pa.float64())
        if numbers is None:
            rows = range(len(text))
            row = bisect_left(rows, True, key=lambda row: _cast(text[: row + 1], pa.float64()) is None)
            if _DECIMAL_COMMA.fullmatch(text[row].as_py()):
                expected += " with a decimal point, not a comma"
            raise self._refusal(name, row, expected)
        return numbers

    def _refuse_first(self, bad: Bools, name: str, expected: str) -> None:
        if bad.any():
            raise self._refusal(name, int(np.argmax(bad)), expected)

    def _refusal(self, name: str, row: int, expected: str) -> InputError:
        cell = self._columns[name][row].as_py()
        cell = shorten(cell.strip(), 60) if isinstance(cell, str) else cell
        what = "is empty" if cell is None else f"is {cell!r}"
        if cell == name:
            expected += "; the header is repeated: delete this line, or put two recordings into two files"
        return InputError(f"{self.locate(row)}, column {name}: {what}; expected {expected}")


def unwrapped_s(time_s: Array, start_s: float = np.nan) -> Array:
    """Unwrap times of day (N,) of one clock, in s, so that they continue past midnight.

    A step back by more than half a day is a new day. A step forward by nearly a whole day (within a clock's
    jitter) is a step back across midnight; a shorter one is a pause.

    start_s : a time less than half a day away from the first one; the first time itself if NaN.
    """
    timed = np.flatnonzero(np.isfinite(time_s))
    start = time_s[timed[:1]] if np.isnan(start_s) else start_s
    steps = np.diff(time_s[timed], prepend=start)
    back = steps > DAY_S - _JITTER_S
    if len(back):
        back[0] = steps[0] > DAY_S / 2
    out = time_s.copy()
    out[timed] += DAY_S * np.cumsum((steps < -DAY_S / 2).astype(int) - back)
    return out


def _clock(parts: pa.ChunkedArray, *groups: str) -> Iterator[Array]:
    """Yield the named groups of matched texts as numbers, (N,): 0 for an absent group, NaN for no match."""
    for group in groups:
        text = pc.replace_substring(pc.struct_field(parts, group), ",", ".")
        yield pc.replace_substring_regex(text, "^$", "0").cast(pa.float64()).to_numpy()


def _cast(column: pa.ChunkedArray, kind: pa.DataType) -> pa.ChunkedArray | None:
    try:
        return column.cast(kind)
    except pa.ArrowInvalid:
        return None


def _trim(text: pa.Array, empty: Sequence[str]) -> pa.Array:
    bare = pc.utf8_trim_whitespace(text)
    is_empty = pc.match_substring_regex(bare, f"^({NO_VALUE})$", ignore_case=True)
    is_empty = pc.or_(is_empty, pc.is_in(bare, pa.array(empty, pa.string())))
    return pc.if_else(is_empty, pa.scalar(None, pa.string()), bare)
