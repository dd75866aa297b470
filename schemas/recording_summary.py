"""Make a recording's row of the recordings table, from its poses table's rows and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc

from shukotsu.errors import InputError, TableError
from shukotsu.schemas.catalogue import POSES
from shukotsu.schemas.device_clock import Array, device_clock
from shukotsu.schemas.findings import NOTE, REFUSED, Finding, worded
from shukotsu.schemas.study import Recording
from shukotsu.schemas.tables import column_array, read_metadata, read_row_groups

Row = dict[str, Any]


def recording_row(recording: Recording, poses: Path) -> tuple[Row, list[Finding]]:
    """Return the recording's row of the recordings table, and the problems with it.

    poses : the recording's poses table; an excluded recording needs none.
    """
    row: Row = {
        **recording.key,
        "role": recording.role,
        "file": recording.file_as_written,
        "status": "used",
        "n_frames": 0,
        "n_receivers": 0,
        "message": "",
    }
    if recording.exclude:
        return row | {"status": "excluded", "message": recording.exclude}, []
    try:
        n_rows, n_valid, time_s = _summed(poses)
    except InputError as error:
        failed = worded("recording", REFUSED, str(error))
        return row | {"status": "failed", "message": failed.message}, [failed]
    parameters = read_metadata(poses)["parameters"]
    notes, absent, losses = (_texts(poses, parameters, name) for name in ("notes", "absent", "losses"))
    missing = parameters.get("missing_frames", 0)
    if not isinstance(missing, int):
        raise TableError(
            f"{poses}: its metadata have no number of missing_frames; make it with shukotsu.stages.capture"
        )
    dead = dict.fromkeys([*absent, *(segment for segment, count in n_valid.items() if not count)])
    problems = [Finding("recording", NOTE, "no-pose", {"segments": [*dead]})] if dead else []
    problems += [worded("recording", NOTE, loss) for loss in losses]
    row["message"] = "; ".join(dict.fromkeys([*(one.message for one in problems), *notes]))
    n_frames = n_rows // max(len(n_valid), 1)
    expected = (n_frames + missing) * len({*n_valid, *absent})
    row["tracker"] = str(parameters.get("tracker", ""))
    row["n_frames"] = n_frames
    row["n_receivers"] = sum(1 for count in n_valid.values() if count)
    row["duration_s"] = device_clock(time_s)[0]
    row["valid_percent"] = 100.0 * sum(n_valid.values()) / expected if expected else None
    return row, problems


def _texts(path: Path, parameters: Mapping[str, Any], name: str) -> list[str]:
    """A list of texts of the poses table's parameters; TableError where it is something else."""
    texts = parameters.get(name, [])
    if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
        raise TableError(f"{path}: its metadata have no list of {name}; make it with shukotsu.stages.capture")
    return texts


def _summed(poses: Path) -> tuple[int, dict[str, int], Array]:
    """Count rows, and valid ones by segment; return the frames' times (T,), of the first segment with one."""
    n_rows, n_valid, seen, time_s = 0, dict[str, int](), dict[str, int](), np.zeros(0)
    for rows in read_row_groups(poses, POSES, ["segment", "time_s", "valid"]):
        n_rows += rows.num_rows
        for segment in pc.unique(rows["segment"]).to_pylist():
            own = rows.filter(pc.equal(rows["segment"], segment))
            start, end = seen.get(segment, 0), seen.get(segment, 0) + own.num_rows
            n_valid[segment] = n_valid.get(segment, 0) + pc.sum(own["valid"]).as_py()
            time_s = np.concatenate([time_s, np.full(max(0, end - len(time_s)), np.nan)])
            times = time_s[start:end]
            np.copyto(times, column_array(own, "time_s"), where=np.isnan(times))
            seen[segment] = end
    return n_rows, n_valid, time_s
