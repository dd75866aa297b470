"""A small valid recording of every file format, as bytes."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from event_files import pose_stream, xdf_header, xdf_of
from recording_files import write_c3d
from tracker_streams import cosines, liberty_binary, pose, settings

FRAMES = 6
SEGMENTS = {1: "hand", 2: "index_proximal"}


@dataclass(frozen=True)
class Recording:
    """files : name -> content; path : the name that is read; mapping : None where the format says enough."""

    path: str
    files: Mapping[str, bytes]
    mapping: Mapping[str, Any] | None = None


def _tidy_csv() -> Recording:
    lines = ["frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz"]
    for frame in range(FRAMES):
        for station, segment in SEGMENTS.items():
            position, q = pose(frame, station)
            lines.append(",".join(map(str, (frame, frame / 240, segment, *position, *q))))
    return Recording("a.csv", {"a.csv": "\n".join(lines).encode()})


def _tidy_parquet() -> Recording:
    import pyarrow.parquet as pq
    from pyarrow import csv

    out = io.BytesIO()
    pq.write_table(csv.read_csv(io.BytesIO(_tidy_csv().files["a.csv"])), out)
    return Recording("a.parquet", {"a.parquet": out.getvalue()})


def _numbers(frame: int) -> list[float]:
    """Poses of all segments in a frame, one after the other."""
    return [number for station in SEGMENTS for part in pose(frame, station) for number in part]


def capture_bytes() -> bytes:
    """A raw capture of a LIBERTY with two stations."""
    from shukotsu.tracker.archive import ArchiveWriter

    items = (8, 9, 11, 10, 12, 3, 7)
    with tempfile.TemporaryDirectory() as name:
        writer = ArchiveWriter(Path(name, "a.arrows"), {"note": "made up"}, lambda: 0)
        writer.settings(settings("liberty", items, (1, 2)).to_json(), 0)
        for frame in range(1, 3 * FRAMES):
            pieces = [liberty_binary(frame, station, items) for station in (1, 2)]
            writer.received(b"".join(pieces), frame * 4_166_667)
            if frame % 5 == 0:
                writer.flush()
        writer.close({"records": 2 * FRAMES}, FRAMES * 4_166_667)
        return Path(name, "a.arrows").read_bytes()


def _mapped_csv() -> Recording:
    receiver = {
        segment: {"position": [f"{a}{n}" for a in "xyz"], "orientation": [f"{a}{n}" for a in "wijk"]}
        for n, segment in SEGMENTS.items()
    }
    mapping = {
        "format": "csv",
        "position_unit": "cm",
        "orientation": {"kind": "quaternion", "order": "wxyz"},
        "receivers": receiver,
        "csv": {"time": "t", "time_unit": "ms"},
    }
    lines = [",".join(["t", *(f"{a}{n}" for n in SEGMENTS for a in "xyzwijk")])]
    lines += [",".join(map(str, [4.2 * frame, *_numbers(frame)])) for frame in range(FRAMES)]
    return Recording("a.txt", {"a.txt": "\r\n".join(lines).encode()}, mapping)


def _c3d() -> Recording:
    shape = np.array([[0.0, 0, 0], [60, 0, 0], [20, 40, 0]])
    points = np.array([shape + pose(frame, 1)[0] for frame in range(FRAMES)])
    with tempfile.TemporaryDirectory() as name:
        data = write_c3d(Path(name, "a.c3d"), points, ["H1", "H2", "H3"]).read_bytes()
    mapping = {"format": "c3d", "position_unit": "mm", "receivers": {"hand": {"markers": ["H1", "H2", "H3"]}}}
    return Recording("a.c3d", {"a.c3d": data}, mapping)


def _xdf() -> Recording:
    poses = np.array([_numbers(frame) for frame in range(FRAMES)])
    data = xdf_of(pose_stream(1, xdf_header(list(SEGMENTS.values())), np.arange(FRAMES) / 240, poses))
    return Recording("a.xdf", {"a.xdf": data})


def _sequence() -> Recording:
    lines = ["ObjectType = Image"]
    for frame in range(FRAMES):
        for station, segment in SEGMENTS.items():
            position, q = pose(frame, station)
            whole = np.column_stack([np.reshape(cosines(q), (3, 3)), position]).ravel()
            name = f"Seq_Frame{frame:04d}_{segment}ToTrackerTransform"
            lines += [f"{name} = {' '.join(map(str, whole))} 0 0 0 1", f"{name}Status = OK"]
        lines.append(f"Seq_Frame{frame:04d}_Timestamp = {frame / 60}")
    return Recording("a.mha", {"a.mha": "\n".join([*lines, "ElementDataFile = LOCAL\n"]).encode() + b"\xff"})


RECORDINGS: Mapping[str, Callable[[], Recording]] = {
    "csv": _tidy_csv,
    "parquet": _tidy_parquet,
    "capture": lambda: Recording("a.arrows", {"a.arrows": capture_bytes()}),
    "mapped csv": _mapped_csv,
    "c3d": _c3d,
    "xdf": _xdf,
    "sequence": _sequence,
}
