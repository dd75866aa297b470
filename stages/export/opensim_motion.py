"""Tables of numbers for OpenSim: coordinates over time (.mot) and markers over time (.trc).

Both are tab-separated lines under a header of their own; numbers have as few digits as they need.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc

from shukotsu.files.whole_files import replacing
from shukotsu.schemas import PROGRAM, VERSION
from shukotsu.skeleton.posing import Bools, Origin, PosedRecording, known_points
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.export.kinematic_tree import JointForm
from shukotsu.stages.export.motion import BLOCK_FRAMES, require_times
from shukotsu.stages.export.opensim_markers import Triad

ALONE_HZ = 60.0
"""Rate in the header of a file of one frame, whose rate nobody knows."""

_ANGLE_DECIMALS = 9
_METRE_DECIMALS = 12
_MM_DECIMALS = 6
_TIME_DECIMALS = 9


def seconds(motion: PosedRecording, path: Path, program: str) -> Array:
    """Device times (T,) from the first frame on, s, to the nanosecond.

    program : which wants times that grow. Raises InputError where there is none, or it does not.
    """
    if len(motion.time_s) == 1:
        return np.zeros(1)
    time_s = (motion.time_s - motion.time_s[0]).round(_TIME_DECIMALS)
    require_times(motion, time_s, path, program)
    return np.asarray(time_s)


def write_mot(path: Path, title: str, origin: Origin, time_s: Array, forms: Sequence[JointForm]) -> None:
    """Write all coordinates over time: turns in degrees, shifts in metres; title : one line of ASCII."""
    names = {key: getattr(origin.recording, key) for key in ("subject", "session", "hand", "task", "trial")}
    facts = {"program": f"{PROGRAM} {VERSION}", **names, "model": origin.model, "licence": origin.licence}
    # an equals sign would make a line a key of the header
    whose = [" ".join(f"{key}: {fact}".replace("=", ":").split()) for key, fact in facts.items() if fact]
    names = ["time", *(coordinate.name for form in forms for coordinate in form.coordinates)]
    header = [
        title,
        "version=1",
        f"nRows={len(time_s)}",
        f"nColumns={len(names)}",
        "inDegrees=yes",
        "",
        *whose,
        "",
        "endheader",
        "\t".join(names),
    ]
    with replacing(path) as temporary, temporary.open("wb") as stream:
        stream.write(("\n".join(header) + "\n").encode())
        for start in range(0, len(time_s), BLOCK_FRAMES):
            rows = slice(start, start + BLOCK_FRAMES)
            columns = [time_s[rows]]
            for form in forms:
                columns += [np.degrees(c.values[rows]).round(_ANGLE_DECIMALS) for c in form.turns]
                columns += [(c.values[rows] * 1e-3).round(_METRE_DECIMALS) for c in form.shifts]
            _write_rows(stream, [pa.array(column + 0.0) for column in columns])


def write_trc(
    path: Path, title: str, time_s: Array, motion: PosedRecording, receivers: Sequence[Triad]
) -> None:
    """Write all markers over time in mm, blank where a receiver was not valid; title : one line of ASCII.

    Frames without any marker are left out, as inverse kinematics stops at them. Lines end with a tab:
    OpenSim's reader drops one empty cell at the end of a line, which may be a marker's.
    """
    names = [marker for triad in receivers for marker in triad.markers]
    rate = f"{motion.rate_hz if np.isfinite(motion.rate_hz) else ALONE_HZ:.9g}"
    seen = seen_frames(motion, receivers)
    count = int(seen.sum())
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{title}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{count}\t{len(names)}\tmm\t{rate}\t1\t{count}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t\t",
        "\t\t" + "\t".join(f"{axis}{n}" for n in range(1, len(names) + 1) for axis in "XYZ") + "\t",
        "",
    ]
    number = np.cumsum(seen)
    with replacing(path) as temporary, temporary.open("wb") as stream:
        stream.write(("\n".join(lines) + "\n").encode("ascii"))
        for start in range(0, len(seen), BLOCK_FRAMES):
            rows = slice(start, start + BLOCK_FRAMES)
            own, part = seen[rows], motion.take(rows).receivers
            columns = [pa.array(number[rows][own]), pa.array(time_s[rows][own])]
            for triad in receivers:
                flat = triad.measured_mm(part)[own].round(_MM_DECIMALS) + 0.0
                columns += [pa.array(column, from_pandas=True) for column in flat.T]
            _write_rows(stream, [*columns, pa.nulls(int(own.sum()), pa.float64())])


def seen_frames(motion: PosedRecording, receivers: Sequence[Triad]) -> Bools:
    """Frames (T,) in which any of the receivers is valid."""
    own = motion.receivers
    known = known_points(own.position_mm, own.quaternion)
    return np.asarray(known[:, [triad.receiver for triad in receivers]].any(1))


def _write_rows(stream: BinaryIO, columns: Sequence[pa.Array]) -> None:
    table = pa.table(list(columns), names=[str(number) for number in range(len(columns))])
    options = pc.WriteOptions(include_header=False, delimiter="\t", quoting_style="none")
    pc.write_csv(table, stream, options)
