"""A poses file against what was declared about its recording."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pyarrow.compute as pc

from shukotsu.checks.checked_recording import LEFT_OUT, CheckedRecording, check_recording
from shukotsu.checks.declared import Declared
from shukotsu.study.layout import Layout
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.poses import read_poses, recording_name
from shukotsu.tables.typed_table import read_metadata, read_row_groups


def checked_poses(path: Path, layout: Layout, hand: str | None = None) -> CheckedRecording:
    """Check what was declared about a poses file's recording; hand : in place of its own."""
    parameters = read_metadata(path)["parameters"]
    declared = Declared.of(parameters.get("mapping"), parameters.get("orientation", ""))
    side = hand or recording_name(path).hand
    poses, broken = read_poses(path, layout.measured), parameters.get("breaks", ())
    return check_recording(poses, layout, side, declared, _left_out(path), broken)


def _left_out(path: Path) -> dict[str, Counter[str]]:
    """Return how many poses have each flag in LEFT_OUT that there is, by segment."""
    flagged: dict[str, Counter[str]] = {flag: Counter() for flag in LEFT_OUT}
    for rows in read_row_groups(path, POSES, ["segment", "flags"]):
        for flag, counts in flagged.items():
            counts.update(rows.filter(pc.match_substring(rows["flags"], flag))["segment"].to_pylist())
    return {flag: counts for flag, counts in flagged.items() if counts}
