"""What a study's tables are put together from: hands' tables, and a row for every recording."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from schemas.catalogue import POSES, RECEIVERS
from schemas.errors import InputError
from schemas.joined_tables import read_joined
from schemas.results import FIT_TABLES, Part, Results
from schemas.study import Recording
from schemas.tables import METADATA_KEY, Table, open_table, rows_of

Row = dict[str, Any]

_READ_OF_POSES = {
    place: column.name
    for place, column in enumerate(POSES.columns)
    if column.name in ("segment", "time_s", "valid")
}
"""Columns of a recording's poses that its row is made from, by their place."""


def failing(parts: Iterable[Part], problems: list[Row]) -> Callable[[Path, InputError], None]:
    """What is to be done where a part cannot be had: it becomes a row of problems."""
    part_of = {part.path: part for part in parts}

    def tell(path: Path, error: InputError) -> None:
        part = part_of[path]
        problems.append({"where": part.whose, "stage": part.stage, "message": str(error)})

    return tell


def whole_table(table: Table, parts: Sequence[Part]) -> tuple[pa.Table, list[Row]]:
    """One table over hands and models, whole; a part that failed becomes a row of problems."""
    problems: list[Row] = []
    rows = read_joined(table, [part.path for part in parts], failing(parts, problems))
    return rows, problems


def receiver_problems(receivers: pa.Table) -> list[Row]:
    """Receivers that came loose, and touches that were refused, once however many models say so.

    A receiver without a valid pose is named with its recording.
    """
    return [
        {
            "where": f"subject {row['subject']}, {row['hand']} hand, {row['segment']}",
            "stage": FIT_TABLES[RECEIVERS.name],
            "message": row["message"],
        }
        for row in rows_of(receivers)
        if row["message"] and row["status"] != "failed"
    ]


def recording_row(recording: Recording, results: Results, problems: list[Row]) -> Row:
    """A recording's row of the recordings table; what is wrong with it joins the problems."""
    row: Row = {
        "subject": recording.hand.subject,
        "hand": recording.hand.hand,
        "task": recording.task,
        "trial": recording.trial,
        "role": recording.role,
        "file": recording.file_as_written,
        "status": "used",
        "n_frames": 0,
        "message": "",
    }
    if recording.exclude:
        return row | {"status": "excluded", "message": recording.exclude}
    names = (recording.hand.subject, recording.hand.hand, recording.task, recording.trial)
    problem = {"where": ", ".join(filter(None, names)), "stage": "capture"}
    path = results.poses(recording)
    try:
        seen, parameters = _seen(path)
    except InputError as error:
        problems.append(problem | {"message": str(error)})
        return row | {"status": "failed", "message": str(error)}
    absent = parameters.get("absent", [])
    dead = list(dict.fromkeys([*absent, *(name for name, n in seen.n_valid.items() if not n)]))
    doubts = [f"no usable pose of {', '.join(dead)}; check that receiver"] if dead else []
    doubts += [parameters["doubt"]] if parameters.get("doubt") else []
    doubts += parameters.get("losses", [])
    problems += [problem | {"message": doubt} for doubt in doubts]
    said = "; ".join(dict.fromkeys([*doubts, *parameters.get("notes", [])]))
    return row | _counts(seen, absent, parameters.get("missing_frames", 0)) | {"message": said}


@dataclass
class _Seen:
    """What a poses table holds: its rows, the valid ones of every segment, and the times that are known."""

    n_rows: int = 0
    n_valid: dict[str, int] = field(default_factory=dict)
    first_s: float = np.inf
    last_s: float = -np.inf

    def add(self, segment: str, rows: int, valid: int, first_s: float, last_s: float) -> None:
        self.n_rows += rows
        self.n_valid[segment] = self.n_valid.get(segment, 0) + valid
        self.first_s, self.last_s = min(self.first_s, first_s), max(self.last_s, last_s)


def _seen(path: Path) -> tuple[_Seen, dict[str, Any]]:
    """Read what a poses table holds, and the parameters that it was made with.

    A row group's least and greatest values mostly say all (one segment, every pose valid); others are read.
    """
    seen = _Seen()
    with open_table(path, POSES) as file:
        for index in range(file.num_row_groups):
            if not _seen_at_a_glance(file.metadata.row_group(index), seen):
                _read_group(path, file, index, seen)
        parameters: dict[str, Any] = json.loads(file.schema_arrow.metadata[METADATA_KEY])["parameters"]
    return seen, parameters


def _seen_at_a_glance(group: pq.RowGroupMetaData, seen: _Seen) -> bool:
    """Add a row group by its statistics; False where they do not say enough."""
    of = {}
    for place, name in _READ_OF_POSES.items():
        column = group.column(place)
        if column.path_in_schema != name or not (found := column.statistics) or not found.has_min_max:
            return False
        of[name] = found
    segment, valid, time_s = of["segment"], of["valid"], of["time_s"]
    if (
        segment.min != segment.max
        or valid.min != valid.max
        or not np.isfinite([time_s.min, time_s.max]).all()
    ):
        return False
    seen.add(segment.min, group.num_rows, group.num_rows * valid.min, time_s.min, time_s.max)
    return True


def _read_group(path: Path, file: pq.ParquetFile, index: int, seen: _Seen) -> None:
    """Add a row group by its rows. Raises InputError where it is damaged."""
    try:
        rows = file.read_row_group(index, [*_READ_OF_POSES.values()])
    except (OSError, ValueError, pa.ArrowException) as error:
        raise InputError(f"{path}: damaged Parquet file ({error}); make it again") from error
    for segment in rows["segment"].unique().to_pylist():
        own = rows.filter(pc.equal(rows["segment"], segment))
        time_s = own["time_s"].to_numpy()
        known = time_s[np.isfinite(time_s)]
        first_s, last_s = (known.min(), known.max()) if len(known) else (np.inf, -np.inf)
        seen.add(segment, own.num_rows, int(np.sum(own["valid"].to_numpy())), first_s, last_s)


def _counts(seen: _Seen, absent: Sequence[str], missing_frames: int) -> Row:
    n_frames = seen.n_rows // max(len(seen.n_valid), 1)
    expected = (n_frames + missing_frames) * len({*seen.n_valid, *absent})
    return {
        "n_frames": n_frames,
        "duration_s": float(seen.last_s - seen.first_s) if seen.last_s >= seen.first_s else None,
        "valid_percent": 100.0 * sum(seen.n_valid.values()) / expected if expected else None,
    }
