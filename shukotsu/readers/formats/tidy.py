"""Read tidy recordings: one row per receiver and frame, as CSV or Parquet (docs/recordings.md)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from shlex import quote

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from shukotsu.errors import InputError, list_names
from shukotsu.readers.formats.cells import Cells
from shukotsu.readers.formats.text_table import open_tidy_csv
from shukotsu.readers.samples import Samples, segments_of_names, segments_of_stations
from shukotsu.study.layout import Layout
from shukotsu.study.mapping import FileMapping
from shukotsu.tables.parquet_files import naming_damage, open_parquet
from shukotsu.tables.poses import NUMBERS

SEGMENT, RECEIVER = "segment", "receiver"
REQUIRED = ("frame", "time_s", *NUMBERS)
"""Required columns, with one of `segment` and `receiver`; all other columns are ignored."""
BLOCK_ROWS = 1 << 16

_READ_BYTES = 1 << 20
"""Part of a Parquet column that is read at a time: one row group may contain the whole recording."""
COMMENTS = ("#", "%", "//")
"""Beginnings of comment lines."""


def read_csv(path: Path, layout: Layout, _mapping: FileMapping | None) -> Iterator[Samples]:
    """Read a tidy text file (commas or tabs, decimal points) in parts. Raises InputError if it is not one."""
    table = open_tidy_csv(path)
    wanted = wanted_columns(path, table.header)
    return _parts(table.blocks(wanted), path, layout, table.cut_off(wanted))


def read_parquet(path: Path, layout: Layout, _mapping: FileMapping | None) -> Iterator[Samples]:
    """Read a tidy Parquet file in parts. Raises InputError if it is not one."""
    with open_recording(path) as file:
        blank = any(name != name.strip() for name in file.schema_arrow.names)
    note = "leading and trailing blanks of column names are removed"
    return _parts(parquet_blocks(path), path, layout, notes=(note,) if blank else ())


def parquet_blocks(path: Path, block_rows: int = BLOCK_ROWS) -> Iterator[Cells]:
    """Yield the columns of a tidy recording, `block_rows` rows at a time, with the file's number types."""
    start = 0
    with open_recording(path) as file:
        written = {name.strip(): name for name in file.schema_arrow.names}
        names = wanted_columns(path, [name.strip() for name in file.schema_arrow.names])
        for batch in file.iter_batches(block_rows, columns=[written[name] for name in names]):
            batch.validate(full=True)  # checks that text is UTF-8
            batch = batch.rename_columns([name.strip() for name in batch.schema.names])
            table = pa.Table.from_batches([batch])
            yield Cells(path, table, lambda row, start=start: f"{path}: row {start + row + 1}")  # type: ignore[misc]
            start += batch.num_rows


@contextmanager
def open_recording(path: Path) -> Iterator[pq.ParquetFile]:
    """Open a Parquet file. Raises InputError if it does not exist, is not a Parquet file or is damaged."""
    expected, remedy = "a recording", "copy it again"
    with naming_damage(path, remedy), open_parquet(path, expected, remedy, _READ_BYTES) as file:
        yield file


def _parts(
    blocks: Iterable[Cells], path: Path, layout: Layout, loss: str = "", notes: tuple[str, ...] = ()
) -> Iterator[Samples]:
    """Yield the samples of a recording's parts; loss (a sentence, or "") and notes go with the first part."""
    empty, losses = True, (loss,) if loss else ()
    for cells in blocks:
        if cells.rows:
            notes += cells.dropped
            yield replace(read_samples(cells, path, layout), notes=(*losses, *notes), losses=losses)
            empty, losses, notes = False, (), ()
    if empty:
        raise InputError(f"{path}: has a header but no rows; expected one row a receiver and frame")


def wanted_columns(path: Path, header: Sequence[str]) -> list[str]:
    """Return the columns to read, out of the file's header.

    Raises InputError if one is missing or occurs twice, or if both `segment` and `receiver` are present.
    """
    if SEGMENT in header and RECEIVER in header:
        raise InputError(f"{path}: has both columns {SEGMENT} and {RECEIVER}; keep one of them")
    missing = [name for name in REQUIRED if name not in header]
    if SEGMENT not in header and RECEIVER not in header:
        missing.append(f"{SEGMENT} (or {RECEIVER})")
    if missing:
        what, do = "", "save with commas, and points in the numbers"
        what = "the cells are separated by semicolons" if ";" in "".join(header) else ""
        if "".join(header).lstrip().startswith(COMMENTS):
            what, do = "the first line is a comment", "delete it"
        if what:
            raise InputError(
                f"{path}: no columns of a tidy recording; {what}: {do}, or "
                f"`shukotsu inspect {quote(str(path))}` shows how to read it as it is"
            )
        lower = any(name.lower() in REQUIRED and name not in REQUIRED for name in header)
        do = "; column names are written in lower case" if lower else ""
        do += f"; `shukotsu inspect {quote(str(path))}` shows how to read another table as it is"
        present = list_names([name for name in header if name])
        raise InputError(f"{path}: column {', '.join(missing)} is missing; found {present}{do}")
    wanted = [name for name in (*REQUIRED, SEGMENT, RECEIVER) if name in header]
    twice = [name for name in wanted if list(header).count(name) > 1]
    if twice:
        raise InputError(f"{path}: column {', '.join(twice)} is given twice; keep one of them")
    return wanted


def read_samples(cells: Cells, path: Path, layout: Layout) -> Samples:
    """Convert cells to samples. Raises InputError if a cell is not valid for its column."""
    if SEGMENT in cells.names:
        segment = segments_of_names(*cells.names_in(SEGMENT), layout, cells.locate)
    elif all(layout.segments[name].receiver is None for name in layout.measured):
        raise InputError(
            f"{path}: identifies receivers by station number, but layout {layout.name} has no stations; "
            f"add `receiver:` to the layout's segments or use a {SEGMENT} column"
        )
    else:
        segment = segments_of_stations(cells.wholes(RECEIVER), layout, cells.locate)
    frame, time_s = cells.wholes("frame"), cells.times_s("time_s", "s")
    numbers = np.stack([cells.reals(name) for name in NUMBERS]).T
    return Samples(layout.measured, segment, frame, time_s, numbers, cells.locate)
