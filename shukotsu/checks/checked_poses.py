"""A poses file against what was declared about its recording."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pyarrow.compute as pc

from shukotsu.checks.checked_recording import LEFT_OUT, CheckedRecording, check_recording
from shukotsu.checks.declared import Declared
from shukotsu.schemas.catalogue import POSES
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.poses import read_poses, recording_name
from shukotsu.schemas.tables import read_metadata, read_table


def checked_poses(path: Path, layout: Layout, hand: str | None = None) -> CheckedRecording:
    """Check what was declared about the recording of a poses file; hand : in place of the file's own.

    Raises InputError as reading does.
    """
    parameters = read_metadata(path)["parameters"]
    declared = Declared.of(parameters.get("mapping"), parameters.get("orientation", ""))
    flags = read_table(path, POSES, ["segment", "flags"])
    flagged = {
        flag: Counter(flags.filter(pc.match_substring(flags["flags"], flag))["segment"].to_pylist())
        for flag in LEFT_OUT
    }
    left_out = {flag: counts for flag, counts in flagged.items() if counts}
    poses, side = read_poses(path, layout.measured), hand or recording_name(path).hand
    return check_recording(poses, layout, side, declared, left_out)
