"""A recording's row says the same however its poses lie in the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_samples.hand_tables import write_hand_tables
from report_samples.made_study import make_study

from schemas.catalogue import POSES
from schemas.results import Results
from schemas.study import Recording, read_study
from schemas.tables import Provenance, read_metadata, read_table, write_table
from stages.gather.parts import recording_row


@pytest.fixture
def recording(tmp_path: Path) -> tuple[Recording, Results]:
    """One recording of a study, and where its poses are."""
    file, folder = make_study(tmp_path, n_frames=40, models=("paper-fig4",))
    study, results = read_study(file), Results(folder)
    write_hand_tables(study, results)
    return next(r for r in study.recordings if results.poses(r).is_file()), results


def write_poses(path: Path, row_group_rows: int, **changed: Any) -> int:
    """Write the poses again, some columns changed, in such row groups; give the rows of a segment."""
    found = read_table(path, POSES)
    parameters = read_metadata(path)["parameters"]
    columns = {column.name: found.column(column.name) for column in POSES.columns} | changed
    write_table(path, POSES, columns, Provenance((), parameters), row_group_rows=row_group_rows)
    return found.num_rows // len(found["segment"].unique())


@pytest.mark.parametrize("what", ["all valid", "some not", "a segment never", "no time", "a time missing"])
def test_row_groups_of_one_segment_and_of_all(recording: tuple[Recording, Results], what: str) -> None:
    path = recording[1].poses(recording[0])
    found = read_table(path, POSES)
    segment = np.array(found["segment"].to_pylist())
    valid, time_s = np.ones(len(segment), bool), np.arange(len(segment)) % 40 / 240.0 + 3.0
    if what == "some not":
        valid[::7] = False
    elif what == "a segment never":
        valid[segment == segment[0]] = False
    elif what == "no time":
        time_s[:] = np.nan
    elif what == "a time missing":
        time_s[:5] = np.nan
    n_frames = write_poses(path, len(segment), valid=valid, time_s=time_s)
    told: list[dict[str, Any]] = []
    row = recording_row(*recording, told)
    assert row["n_frames"] == n_frames
    assert row["valid_percent"] == pytest.approx(100.0 * valid.mean())
    known = time_s[np.isfinite(time_s)]
    assert row["duration_s"] == (np.ptp(known) if len(known) else None)
    assert [problem["message"].startswith("no usable pose of") for problem in told][:1] == (
        [True] if what == "a segment never" else []
    )
    for rows in (n_frames, 9):  # row groups of one segment each, and of parts of one or two
        write_poses(path, rows)
        again: list[dict[str, Any]] = []
        assert (recording_row(*recording, again), again) == (row, told)
