"""The columns of a `*_motion.tsv`, which has no header: text until a number is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv as pa_csv

from schemas.errors import InputError
from stages.capture.bids.decimals import NotANumberError, numbers_of
from stages.capture.bids.sidecars import Channel

MISSING = ["n/a", "N/A", "NA", "NaN", "nan", "NAN", "null", "NULL", ""]
"""What BIDS, and programs beside it, write for "no value"."""


class MotionColumns:
    """The wanted columns, T rows each."""

    def __init__(self, path: Path, channels: Sequence[Channel], columns: Sequence[pa.Array]) -> None:
        self._path = path
        self._text = {channel.index: text for channel, text in zip(channels, columns, strict=True)}

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return len(next(iter(self._text.values())))

    def reals(self, channel: Channel, shift: int = 0) -> npt.NDArray[np.float64]:
        """Numbers times 10**shift, shape (T,), NaN where there is none; InputError at what is no number."""
        text = self._text[channel.index]
        try:
            return numbers_of(text, shift)
        except NotANumberError as bad:
            raise self._refusal(channel, bad.index, "a number") from bad

    def wholes(self, channel: Channel) -> npt.NDArray[np.int64]:
        """Whole numbers, shape (T,); InputError at the first cell that is none."""
        text = self._text[channel.index]
        try:
            return np.asarray(text.cast(pa.int64()).to_numpy(zero_copy_only=True), np.int64)
        except pa.ArrowInvalid as error:
            bad = next((i for i, cell in enumerate(text.to_pylist()) if not _is_whole(cell)), 0)
            raise self._refusal(channel, bad, "a whole number") from error

    def place(self, row: int) -> str:
        """File and line of a row, as an editor counts lines."""
        for index, line in enumerate(_filled_lines(self._path)):
            if index == row:
                return f"{self._path}: line {line}"
        return f"{self._path}: row {row + 1}"

    def _refusal(self, channel: Channel, row: int, expected: str) -> InputError:
        cell = self._text[channel.index][row].as_py()
        found = "is empty" if cell is None else f"is {cell!r}"
        column = f"column {channel.index + 1} ({channel.name})"
        return InputError(f"{self.place(row)}, {column}: {found}; expected {expected}")


def read_columns(
    path: Path, count: int, wanted: Sequence[Channel], missing: Sequence[str] = ()
) -> MotionColumns:
    """Read the wanted channels' columns of a motion.tsv that must have `count` columns.

    missing : texts that mean "no value" beside the usual ones. Raises InputError where the file cannot be
    read, has no row, or a row has another number of cells.
    """
    names = [str(index) for index in range(count)]
    chosen = [str(channel.index) for channel in wanted]
    options = pa_csv.ConvertOptions(
        include_columns=chosen,
        column_types=dict.fromkeys(chosen, pa.string()),
        strings_can_be_null=True,
        null_values=[*MISSING, *missing],
    )
    try:
        table = pa_csv.read_csv(
            path,
            read_options=pa_csv.ReadOptions(column_names=names),
            parse_options=pa_csv.ParseOptions(delimiter="\t", quote_char=False),
            convert_options=options,
        )
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    except pa.ArrowInvalid as error:
        raise _structural_error(path, count, error) from error
    if not table.num_rows:
        raise InputError(f"{path}: has no rows; expected one row a frame")
    return MotionColumns(path, wanted, [table.column(name).combine_chunks() for name in chosen])


def _structural_error(path: Path, count: int, error: Exception) -> InputError:
    data = path.read_bytes()
    if not data.strip():
        return InputError(f"{path}: is empty; expected one row a frame")
    lines = data.splitlines()
    for line in _filled_lines(path):
        cells = lines[line - 1].count(b"\t") + 1
        if cells != count:
            return InputError(
                f"{path}: line {line}: has {cells} cells; expected {count}, one for each row of channels.tsv "
                "(motion.tsv has no header line)"
            )
    return InputError(f"{path}: cannot be read as tab-separated text ({' '.join(str(error).split())})")


def _filled_lines(path: Path) -> list[int]:
    """The numbers of the lines that are not empty, counted from 1."""
    return [number for number, line in enumerate(path.read_bytes().splitlines(), 1) if line]


def _is_whole(cell: str | None) -> bool:
    try:
        pa.scalar(cell, pa.string()).cast(pa.int64())
    except pa.ArrowInvalid:
        return False
    return cell is not None
