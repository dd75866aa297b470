"""What a study's tables are put together from: hands' tables, and a row for every recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from schemas.catalogue import POSES, RECEIVERS
from schemas.errors import InputError
from schemas.results import FIT_TABLES, Part, Results
from schemas.study import Recording
from schemas.tables import ROW_GROUP_ROWS, Table, read_metadata, read_table, rows_of

Row = dict[str, Any]


def in_groups(table: Table, parts: Iterable[Part], problems: list[Row]) -> Iterator[pa.Table]:
    """One table over hands and models, some ROW_GROUP_ROWS at a time, for a study may not fit into memory.

    A part that failed becomes a row of problems.
    """
    bare = table.arrow_schema({}).remove_metadata()
    held: list[pa.Table] = []
    for part in parts:
        try:
            held.append(read_table(part.path, table).replace_schema_metadata(None).cast(bare))
        except InputError as error:
            problems.append({"where": part.whose, "stage": part.stage, "message": str(error)})
        if sum(own.num_rows for own in held) >= ROW_GROUP_ROWS:
            yield pa.concat_tables(held)
            held = []
    if held:
        yield pa.concat_tables(held)


def whole_table(table: Table, parts: Iterable[Part]) -> tuple[pa.Table, list[Row]]:
    """One table over hands and models, whole; a part that failed becomes a row of problems."""
    problems: list[Row] = []
    found = list(in_groups(table, parts, problems))
    return pa.concat_tables(found) if found else table.arrow_schema(
        {}
    ).remove_metadata().empty_table(), problems


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
        table = read_table(path, POSES, ["segment", "frame", "time_s", "valid"])
        parameters = read_metadata(path)["parameters"]
    except InputError as error:
        problems.append(problem | {"message": str(error)})
        return row | {"status": "failed", "message": str(error)}
    absent = parameters.get("absent", [])
    dead = _dead(table, absent)
    doubts = [f"no usable pose of {', '.join(dead)}; check that receiver"] if dead else []
    doubts += [parameters["doubt"]] if parameters.get("doubt") else []
    doubts += parameters.get("losses", [])
    problems += [problem | {"message": doubt} for doubt in doubts]
    said = "; ".join(dict.fromkeys([*doubts, *parameters.get("notes", [])]))
    return row | _counts(table, absent, parameters.get("missing_frames", 0)) | {"message": said}


def _dead(table: pa.Table, absent: Sequence[str]) -> list[str]:
    """Segments of which no pose may be used, those that the recording lacks among them."""
    ever = set(table.filter(table["valid"])["segment"].unique().to_pylist())
    never = [segment for segment in table["segment"].unique().to_pylist() if segment not in ever]
    return list(dict.fromkeys([*absent, *never]))


def _counts(table: pa.Table, absent: Sequence[str], missing_frames: int) -> Row:
    segments = table.column("segment").unique().to_pylist()
    n_segments = len(segments)
    n_frames = table.num_rows // max(n_segments, 1)
    time_s = table.column("time_s").to_numpy()
    known = time_s[np.isfinite(time_s)]
    n_valid = int(np.sum(table.column("valid").to_numpy()))
    expected = (n_frames + missing_frames) * len({*segments, *absent})
    return {
        "n_frames": n_frames,
        "duration_s": float(np.ptp(known)) if len(known) else None,
        "valid_percent": 100.0 * n_valid / expected if expected else None,
    }
