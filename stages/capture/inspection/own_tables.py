"""Files of this project's own: tidy recordings, and the tables that stages write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from schemas.errors import InputError
from schemas.layout import Layout
from schemas.tables import read_metadata
from stages.capture.formats.columns import Columns
from stages.capture.formats.csv_columns import open_csv
from stages.capture.formats.parquet_columns import open_parquet
from stages.capture.formats.tidy import RECEIVER, REQUIRED, SEGMENT, wanted_columns
from stages.capture.inspection.findings import Findings, extent_line, rate_line


def is_tidy(path: Path) -> bool:
    """Whether a text file's first line has the columns of a tidy recording."""
    with path.open("rb") as stream:
        first = stream.readline(10_000).decode("utf-8", "replace")
    return _tidy_header([name.strip().strip('"') for name in first.lstrip("\ufeff").split(",")])


def _tidy_header(names: Sequence[str]) -> bool:
    return {*REQUIRED} <= {*names} and not {SEGMENT, RECEIVER}.isdisjoint(names)


def look_at_tidy_csv(path: Path, layout: Layout) -> Findings:
    """Say what a tidy CSV file holds. Raises InputError where a cell is not what its column holds."""
    return Findings(
        ("a tidy recording (CSV): needs no mapping", *_tidy(open_csv(path, wanted_columns), layout))
    )


def look_at_parquet(path: Path, layout: Layout) -> Findings:
    """Say what a Parquet file holds: a tidy recording, or a table that a stage wrote."""
    try:
        with pq.ParquetFile(path) as file:
            names, rows = file.schema_arrow.names, file.metadata.num_rows
            kinds = [f"{field.name} ({field.type})" for field in file.schema_arrow]
    except (OSError, ValueError, pa.ArrowException) as error:
        raise InputError(f"{path}: not a readable Parquet file ({error}); copy it again") from error
    try:
        metadata = read_metadata(path)
    except InputError:
        if _tidy_header(names):
            facts = _tidy(open_parquet(path, wanted_columns), layout)
            return Findings(("a tidy recording (Parquet): needs no mapping", *facts))
        raise InputError(
            f"{path}: a Parquet file, but neither a tidy recording nor a table of this project; it has "
            f"{', '.join(kinds)}; rename its columns, or save it as CSV and write a mapping"
        ) from None
    lines = [
        f"table {metadata['schema']} (version {metadata['schema_version']}) of {metadata['program']} "
        f"{metadata['program_version']}: {rows} rows"
    ]
    lines += [
        f"column {name} [{told['unit'] or '-'}]: {told['description']}"
        for name, told in metadata["columns"].items()
    ]
    shown = {"schema", "schema_version", "program", "program_version", "columns"}
    lines += [f"{key}: {value}" for key, value in metadata.items() if key not in shown]
    return Findings(tuple(lines), recording=False)


def _tidy(columns: Columns, layout: Layout) -> list[str]:
    if not columns.rows:
        return ["it has a header but no rows"]
    frames, time_s = columns.wholes("frame"), columns.reals("time_s")
    position = np.stack([columns.reals(name) for name in ("x_mm", "y_mm", "z_mm")], -1)
    turned = np.stack([columns.reals(name) for name in ("qw", "qx", "qy", "qz")], -1)
    lines = [
        f"{columns.rows} rows, frames {frames.min()} to {frames.max()}, {len(np.unique(frames))} of them"
    ]
    if SEGMENT in columns.names:
        _, words = columns.words(SEGMENT)
        lines.append(f"segments: {', '.join(words)}")
        odd = [word for word in words if word not in layout.measured]
        lines += [f"not measured in layout {layout.name}: {', '.join(odd)}"] if odd else []
    else:
        lines.append(f"receivers: {', '.join(str(number) for number in np.unique(columns.wholes(RECEIVER)))}")
    if np.isfinite(time_s).any():
        lines.append(rate_line("time_s", time_s, [("s", 1.0)]))
    whole = np.isfinite(np.concatenate([position, turned], -1)).all(-1)
    lines.append(f"{(~whole).sum()} of {len(whole)} rows lack a number and stay gaps")
    lines.append(extent_line("positions", position))
    norm = np.linalg.norm(turned, axis=-1)
    return [*lines, f"quaternions: median norm {np.nanmedian(norm):.5f}"] if whole.any() else lines
