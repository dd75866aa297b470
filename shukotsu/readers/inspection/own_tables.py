"""Files of this project's own: tidy recordings, and the tables that stages write."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from shukotsu.errors import InputError
from shukotsu.readers.formats.cells import Cells
from shukotsu.readers.formats.text_table import open_tidy_csv
from shukotsu.readers.formats.tidy import (
    RECEIVER,
    REQUIRED,
    SEGMENT,
    open_recording,
    parquet_blocks,
    wanted_columns,
)
from shukotsu.readers.inspection.description import Description, extent_line, rate_line
from shukotsu.readers.samples import NUMBERS
from shukotsu.study.layout import Layout
from shukotsu.tables.typed_table import read_metadata


def is_tidy(path: Path) -> bool:
    """Return whether a text file's first line has the columns of a tidy recording."""
    with path.open("rb") as stream:
        first = stream.readline(10_000).decode("utf-8", "replace")
    return _tidy_header([name.strip().strip('"') for name in first.lstrip("\ufeff").split(",")])


def _tidy_header(names: Sequence[str]) -> bool:
    return {*REQUIRED} <= {*names} and not {SEGMENT, RECEIVER}.isdisjoint(names)


def describe_tidy_csv(path: Path, layout: Layout) -> Description:
    """Describe a tidy CSV file. Raises InputError where a cell is not what its column holds."""
    table = open_tidy_csv(path)
    blocks = table.blocks(wanted_columns(path, table.header))
    return Description(("a tidy recording (CSV): needs no mapping", *_tidy(blocks, layout)))


def describe_parquet(path: Path, layout: Layout) -> Description:
    """Describe a Parquet file: a tidy recording, or a table that a stage wrote."""
    with open_recording(path) as file:
        names, rows = [name.strip() for name in file.schema_arrow.names], file.metadata.num_rows
        kinds = [f"{field.name} ({field.type})" for field in file.schema_arrow]
    try:
        metadata = read_metadata(path)
    except InputError:
        if _tidy_header(names):
            return Description(
                ("a tidy recording (Parquet): needs no mapping", *_tidy(parquet_blocks(path), layout))
            )
        raise InputError(
            f"{path}: a Parquet file, but neither a tidy recording nor a table of this project; it has "
            f"{', '.join(kinds)}; rename its columns, or save it as CSV and write a mapping"
        ) from None
    lines = [
        f"table {metadata['schema']} (version {metadata['schema_version']}) of {metadata['program']} "
        f"{metadata['program_version']}: {rows} rows"
    ]
    lines += [
        f"column {name} [{column['unit'] or '-'}]: {column['description']}"
        for name, column in metadata["columns"].items()
    ]
    shown = {"schema", "schema_version", "program", "program_version", "columns"}
    lines += [f"{key}: {value}" for key, value in metadata.items() if key not in shown]
    return Description(tuple(lines), recording=False)


@np.errstate(over="ignore")  # a number without an end is said as one
def _tidy(blocks: Iterable[Cells], layout: Layout) -> list[str]:
    parts = [part for part in blocks if part.rows]
    if not parts:
        return ["it has a header but no rows"]
    frames, time_s = (
        np.concatenate([part.wholes("frame") for part in parts]),
        np.concatenate([part.reals("time_s") for part in parts]),
    )
    numbers = np.concatenate([np.stack([part.reals(name) for name in NUMBERS], -1) for part in parts])
    lines = [f"{len(frames)} rows, frames {frames.min()} to {frames.max()}, {len(np.unique(frames))} of them"]
    if SEGMENT in parts[0].names:
        segments = list(dict.fromkeys(name for part in parts for name in part.names_in(SEGMENT)[1]))
        lines.append(f"segments: {', '.join(segments)}")
        odd = [segment for segment in segments if segment not in layout.measured]
        lines += [f"not measured in layout {layout.name}: {', '.join(odd)}"] if odd else []
    else:
        stations = np.unique(np.concatenate([part.wholes(RECEIVER) for part in parts]))
        lines.append(f"receivers: {', '.join(map(str, stations))}")
    if np.isfinite(time_s).any():
        lines.append(rate_line("time_s", time_s, ["s"]))
    whole = np.isfinite(numbers).all(-1)
    lines.append(f"{(~whole).sum()} of {len(whole)} rows lack a number and stay gaps")
    lines.append(extent_line("positions", numbers[:, :3]))
    norm = np.linalg.norm(numbers[:, 3:], axis=-1)
    return [*lines, f"quaternions: median norm {np.nanmedian(norm):.5f}"] if whole.any() else lines
