"""The tidy recording: one row a receiver and frame, as CSV or Parquet (docs/recordings.md)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from schemas.errors import InputError
from schemas.layout import Layout
from stages.capture.formats.columns import Columns
from stages.capture.samples import (
    NUMBERS,
    ReadingOptions,
    Samples,
    joined,
    segments_of_names,
    segments_of_stations,
)

SEGMENT, RECEIVER = "segment", "receiver"
REQUIRED = ("frame", "time_s", *NUMBERS)
"""Beside these one of `segment` and `receiver`; any other column is left alone."""

_COMMENTS = ("#", "%", "//")
"""What the first line of a table with comments starts with."""


def read_csv(path: Path, layout: Layout, options: ReadingOptions) -> Samples:
    """Read a tidy CSV file (UTF-8, commas, decimal points). Raises InputError where it is none."""
    return joined(csv_parts(path, layout, options))


def read_parquet(path: Path, layout: Layout, options: ReadingOptions) -> Samples:
    """Read a tidy Parquet file. Raises InputError where it is none."""
    return joined(parquet_parts(path, layout, options))


def csv_parts(path: Path, layout: Layout, _options: ReadingOptions) -> Iterator[Samples]:
    """Read a tidy CSV file part by part, in its order."""
    from stages.capture.formats.csv_columns import csv_blocks

    return _parts(csv_blocks(path, wanted_columns), path, layout)


def parquet_parts(path: Path, layout: Layout, _options: ReadingOptions) -> Iterator[Samples]:
    """Read a tidy Parquet file part by part, in its order."""
    from stages.capture.formats.parquet_columns import parquet_blocks

    return _parts(parquet_blocks(path, wanted_columns), path, layout)


def _parts(blocks: Iterator[Columns], path: Path, layout: Layout) -> Iterator[Samples]:
    empty = True
    for columns in blocks:
        if columns.rows:
            empty = False
            yield read_samples(columns, path, layout)
    if empty:
        raise InputError(f"{path}: has a header but no rows; expected one row a receiver and frame")


def wanted_columns(path: Path, header: Sequence[str]) -> list[str]:
    """Give the columns to read, of those that the file has.

    Raises InputError where one is missing, is given twice, or the receiver is named in two ways.
    """
    if SEGMENT in header and RECEIVER in header:
        raise InputError(f"{path}: has both columns {SEGMENT} and {RECEIVER}; keep one of them")
    missing = [name for name in REQUIRED if name not in header]
    if SEGMENT not in header and RECEIVER not in header:
        missing.append(f"{SEGMENT} (or {RECEIVER})")
    if missing:
        found = ", ".join(name for name in header if name) or "none"
        raise InputError(
            f"{path}: column {', '.join(missing)} is missing; found {found}{_header_hint(path, header)}"
        )
    wanted = [name for name in (*REQUIRED, SEGMENT, RECEIVER) if name in header]
    twice = [name for name in wanted if list(header).count(name) > 1]
    if twice:
        raise InputError(f"{path}: column {', '.join(twice)} is given twice; keep one of them")
    return wanted


def read_samples(columns: Columns, path: Path, layout: Layout) -> Samples:
    """Turn columns into samples. Raises InputError where a cell is not what its column holds."""
    return Samples(
        layout.measured,
        _segments(columns, path, layout),
        columns.wholes("frame"),
        columns.reals("time_s"),
        np.stack([columns.reals(name) for name in NUMBERS]).T,
        columns.place,
    )


def _segments(columns: Columns, path: Path, layout: Layout) -> npt.NDArray[np.int64]:
    if SEGMENT in columns.names:
        return segments_of_names(*columns.words(SEGMENT), layout, columns.place)
    if all(layout.segments[name].receiver is None for name in layout.measured):
        raise InputError(
            f"{path}: names receivers by station number, but layout {layout.name} gives its segments none; "
            f"add `receiver:` to the layout's segments or use a {SEGMENT} column"
        )
    return segments_of_stations(columns.wholes(RECEIVER), layout, columns.place)


def _header_hint(path: Path, header: Sequence[str]) -> str:
    line = "".join(header)
    otherwise = f"`python -m stages.capture inspect {path}` shows how to read it as it is"
    if line.lstrip().startswith(_COMMENTS):
        return f"; the first line is a comment: take it out, or {otherwise}"
    for mark, name in ((";", "semicolons"), ("\t", "tabs")):
        if mark in line:
            saved = "save with commas, and points in the numbers"
            return f"; the cells are separated by {name}: {saved}, or {otherwise}"
    if any(name.lower() in REQUIRED and name not in REQUIRED for name in header):
        return "; column names are written in lower case"
    return ""
