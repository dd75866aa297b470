"""Describe tidy recordings, and the tables that stages of this project write."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from shukotsu.errors import InputError, count_of
from shukotsu.readers.formats import tidy
from shukotsu.readers.formats.cells import Cells
from shukotsu.readers.inspection.description import Description, extent_line, rate_line
from shukotsu.study.layout import Layout
from shukotsu.tables.poses import NUMBERS
from shukotsu.tables.typed_table import read_metadata


def is_tidy(names: Sequence[str]) -> bool:
    """Return whether columns with these names are a tidy recording."""
    return {*tidy.REQUIRED} <= {*names} and not {tidy.SEGMENT, tidy.RECEIVER}.isdisjoint(names)


def describe_parquet(path: Path, layout: Layout) -> Description:
    """Describe a Parquet file: a tidy recording, or a table that a stage wrote."""
    with tidy.open_recording(path) as file:
        names, rows = [name.strip() for name in file.schema_arrow.names], file.metadata.num_rows
        kinds = [f"{field.name} ({field.type})" for field in file.schema_arrow]
    try:
        metadata = read_metadata(path)
    except InputError:
        if is_tidy(names):
            return describe_tidy("Parquet", tidy.parquet_blocks(path), layout)
        raise InputError(
            f"{path}: a Parquet file, but neither a tidy recording nor a table of this project; it has "
            f"{', '.join(kinds)}; rename its columns, or save it as CSV and write a mapping"
        ) from None
    lines = [
        f"table {metadata['schema']} (version {metadata['schema_version']}) of {metadata['program']} "
        f"{metadata['program_version']}: {count_of(rows, 'row')}"
    ]
    lines += [
        f"column {name} [{column['unit'] or '-'}]: {column['description']}"
        for name, column in metadata["columns"].items()
    ]
    shown = {"schema", "schema_version", "program", "program_version", "columns"}
    lines += [f"{key}: {value}" for key, value in metadata.items() if key not in shown]
    return Description(tuple(lines), recording=False)


@np.errstate(over="ignore")  # infinite numbers are printed as such
def describe_tidy(kind: str, blocks: Iterable[Cells], layout: Layout) -> Description:
    """Describe the columns of a tidy recording; kind : its format in words."""
    lines = [f"a tidy recording ({kind}): needs no mapping"]
    parts = [part for part in blocks if part.rows]
    if not parts:
        return Description((*lines, "it has a header but no rows"))
    frames = np.concatenate([part.wholes("frame") for part in parts])
    time_s = np.concatenate([part.times_s("time_s", "s") for part in parts])
    numbers = np.concatenate([np.stack([part.reals(name) for name in NUMBERS], -1) for part in parts])
    extent = f"frames {frames.min()} to {frames.max()}, {len(np.unique(frames))} of them"
    lines.append(f"{count_of(len(frames), 'row')}, {extent}")
    if tidy.SEGMENT in parts[0].names:
        segments = list(dict.fromkeys(name for part in parts for name in part.names_in(tidy.SEGMENT)[1]))
        lines.append(f"segments: {', '.join(segments)}")
        odd = [segment for segment in segments if segment not in layout.measured]
        lines += [f"not measured in layout {layout.name}: {', '.join(odd)}"] if odd else []
    else:
        stations = np.unique(np.concatenate([part.wholes(tidy.RECEIVER) for part in parts]))
        lines.append(f"receivers: {', '.join(map(str, stations))}")
    if np.isfinite(time_s).any():
        lines.append(rate_line("time_s", time_s, ["s"]))
    whole = np.isfinite(numbers).all(-1)
    lines.append(f"{(~whole).sum()} of {count_of(len(whole), 'row')} lack a number and stay gaps")
    lines.append(extent_line("positions", numbers[:, :3]))
    if whole.any():
        norm = np.linalg.norm(numbers[:, 3:], axis=-1)
        lines.append(f"quaternions: median norm {np.nanmedian(norm):.5f}")
    return Description(tuple(lines))
