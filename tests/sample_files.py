"""Small valid files, as bytes or in a folder: recordings of every format, poses, and events."""

import struct
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import captures
import mido
import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq
from pyarrow import csv
from recording_files import write_c3d
from simulated_poses import write_poses
from tracker_streams import pose, settings

from shukotsu.hand.rotations import Array, matrix
from shukotsu.simulate.recording import tidy
from shukotsu.tables.poses import Poses

RATE_HZ = 240.0


def bytes_of(name: str, write: Callable[[Path], object]) -> bytes:
    """Return the bytes that a function writes into a file of a given name."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder, name))
        return Path(folder, name).read_bytes()


def poses_of(folder: Path, **key: str) -> Path:
    """Write the poses table of one segment over 20 s."""
    key = {"subject": "01", "hand": "right", "task": "piece", "trial": "2"} | key
    still = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1, 1))
    valid = np.ones((3, 1), bool)
    poses = Poses(("hand",), np.arange(3), np.linspace(0, 20, 3), still[..., 1:], still, valid)
    return write_poses(folder / "poses.parquet", poses, key.pop("hand"), key.pop("task"), **key)


# --- events ---------------------------------------------------------------------------------------------


def records_of(folder: Path, pulses_s: npt.NDArray[np.float64], length_s: float = 0.05) -> Path:
    """Write a raw capture of one station over 20 s, with the sync input on for length_s from each pulse."""
    since_s = np.arange(20 * int(RATE_HZ))[:, None] / RATE_HZ - pulses_s
    on = ((since_s >= 0) & (since_s < length_s)).any(-1)
    return flags_of(folder / "records.arrows", [(frame, 1, int(sync), 0) for frame, sync in enumerate(on)])


def flags_of(path: Path, rows: Sequence[tuple[int, int, int, int]]) -> Path:
    """Write a raw capture of records; rows : frame, station, sync and button of each."""
    items, stations = (9, 12, 10, 3, 7), tuple(sorted({station for _, station, _, _ in rows}))
    records = []
    for frame, station, sync, button in rows:
        body = struct.pack("<Iii7f", frame, sync, button, 20, 5, -3, 1, 0, 0, 0)
        records.append(b"LY" + struct.pack("<BBBBh", station, ord("C"), 0, 0, len(body)) + body)
    return captures.write(path, records, settings("liberty", items, stations))


def midi_of(folder: Path, pulses_s: npt.NDArray[np.float64]) -> Path:
    """Write a MIDI file: note 24 at each pulse, and a quarter of a second later note 60."""
    notes = [(time + 0.25 * (key == 60), key) for time in pulses_s for key in (24, 60)]
    times = [(time, "note_on", key) for time, key in notes]
    times += [(time + 0.1, "note_off", key) for time, key in notes]
    file, tick = mido.MidiFile(type=0, tracks=[mido.MidiTrack()]), 0
    for time, status, key in sorted(times):
        gap = round(2 * file.ticks_per_beat * time) - tick  # 120 quarter notes per minute
        file.tracks[0].append(mido.Message(status, note=key, time=gap))
        tick += gap
    file.save(folder / "take.mid")
    return folder / "take.mid"


def xdf_chunk(tag: int, content: bytes) -> bytes:
    """Return a chunk of an XDF file."""
    return struct.pack("<BIH", 4, 2 + len(content), tag) + content


TYPES = [f"Position{axis}" for axis in "XYZ"] + [f"Orientation{part}" for part in "ABCD"]


def xdf_header(
    owners: Sequence[str],
    name: str = "tracker",
    kind: str = "MoCap",
    unit: str = "meters",
    types: Sequence[str] = TYPES,
    field: str = "marker",
    number: str = "double64",
) -> bytes:
    """Return the header of a stream of poses, with a channel for each owner's numbers."""
    channels = "".join(
        f"<channel><label>{owner}_{kind}</label><{field}>{owner}</{field}><type>{kind}</type>"
        f"<unit>{unit if kind.startswith('Position') else ''}</unit></channel>"
        for owner in owners
        for kind in types
    )
    return (
        f"<info><name>{name}</name><type>{kind}</type>"
        f"<channel_count>{len(owners) * len(types)}</channel_count>"
        f"<nominal_srate>240</nominal_srate><channel_format>{number}</channel_format>"
        f"<desc><channels>{channels}</channels></desc></info>"
    ).encode()


def _xdf_stream(
    number: int,
    head: bytes,
    time_s: Sequence[float] | npt.NDArray[np.float64],
    samples: Sequence[bytes],
    offsets: Sequence[tuple[float, float]],
) -> bytes:
    """Return a stream's chunks: header, samples in pairs, clock offsets and footer; NaN times are left
    out.
    """
    of_stream = struct.pack("<I", number)
    data = xdf_chunk(2, of_stream + head)
    stamps = [b"\0" if np.isnan(time) else struct.pack("<Bd", 8, time) for time in time_s]
    rows = [stamp + sample for stamp, sample in zip(stamps, samples, strict=True)]
    for start in range(0, len(rows), 2):
        pair = rows[start : start + 2]
        data += xdf_chunk(3, of_stream + struct.pack("<BB", 1, len(pair)) + b"".join(pair))
    data += b"".join(xdf_chunk(4, of_stream + struct.pack("<dd", *offset)) for offset in offsets)
    footer = f"<info><sample_count>{len(rows)}</sample_count></info>".encode()
    return data + xdf_chunk(6, of_stream + footer)


def pose_stream(
    number: int,
    head: bytes,
    time_s: npt.NDArray[np.float64],
    values: npt.NDArray[np.float64],
    offsets: Sequence[tuple[float, float]] = (),
) -> bytes:
    """Return a stream of numbers."""
    code = "<f4" if b"float32" in head else "<f8"
    return _xdf_stream(number, head, time_s, [row.astype(code).tobytes() for row in values], offsets)


def marker_stream(
    number: int,
    name: str,
    values: Sequence[str] | Sequence[int],
    time_s: Sequence[float],
    offsets: Sequence[tuple[float, float]] = (),
    rate_hz: float = 0,
) -> bytes:
    """Return a stream of texts, or of 32-bit numbers."""
    kind = "string" if isinstance(values[0], str) else "int32"
    head = (
        f"<info><name>{name}</name><type>Markers</type><channel_count>1</channel_count>"
        f"<nominal_srate>{rate_hz}</nominal_srate><channel_format>{kind}</channel_format></info>"
    )
    samples = [
        struct.pack("<i", value)
        if isinstance(value, int)
        else struct.pack("<BI", 4, len(value.encode())) + value.encode()
        for value in values
    ]
    return _xdf_stream(number, head.encode(), time_s, samples, offsets)


def xdf_of(*streams: bytes) -> bytes:
    """Return an XDF file with the given streams."""
    return b"XDF:" + xdf_chunk(1, b"<info><version>1.0</version></info>") + b"".join(streams)


PULSES_S = np.array([1.0, 1.7, 3.6, 4.7])
EVENTS: Mapping[str, Callable[[], bytes]] = {
    "a.mid": lambda: bytes_of("take.mid", lambda path: midi_of(path.parent, PULSES_S)),
    "a.xdf": lambda: xdf_of(marker_stream(1, "cues", ["go", "stop"], [1.0, 2.0], [(0.0, 1.0), (5.0, 1.0)])),
    "a.arrows": lambda: bytes_of("records.arrows", lambda path: records_of(path.parent, PULSES_S)),
}
"""A small valid file of events of every kind, by file name, for tests to damage."""

# --- recordings -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Recording:
    """A file's name and content; mapping : None if the format needs none."""

    path: str
    content: bytes
    mapping: Mapping[str, Any] | None = None


FRAMES, SEGMENTS = 6, ("hand", "index_proximal")
DRAWN = np.array([[np.concatenate(pose(frame, station)) for station in (1, 2)] for frame in range(FRAMES)])
"""Positions in mm and quaternions (T, 2, 7) of both segments."""
TIMES_S, VALID, LABELS = np.arange(FRAMES) / 240, np.ones((FRAMES, 2), bool), ["H1", "H2", "H3"]
TIDY = tidy(Poses(SEGMENTS, np.arange(FRAMES), TIMES_S, DRAWN[..., :3], DRAWN[..., 3:], VALID))


def _mapped_csv() -> Recording:
    receivers = {
        segment: {"position": [f"{a}{n}" for a in "xyz"], "orientation": [f"{a}{n}" for a in "wijk"]}
        for n, segment in enumerate(SEGMENTS)
    }
    orientation, columns = {"kind": "quaternion", "order": "wxyz"}, {"time": "t", "time_unit": "ms"}
    mapping = {"format": "csv", "position_unit": "cm", "orientation": orientation, "receivers": receivers}
    lines = [",".join(["t", *(f"{a}{n}" for n in range(2) for a in "xyzwijk")])]
    lines += [",".join(map(str, [4.2 * t, *row])) for t, row in enumerate(DRAWN.reshape(FRAMES, -1).tolist())]
    return Recording("a.txt", "\r\n".join(lines).encode(), mapping | {"csv": columns})


def _write_capture(path: Path) -> None:
    captures.write(path, [captures.cycle(frame, (1, 2)) for frame in range(18)], captures.settings((1, 2)))


def _c3d() -> Recording:
    points = np.array([[0.0, 0, 0], [60, 0, 0], [20, 40, 0]]) + DRAWN[:, :1, :3]
    mapping = {"format": "c3d", "position_unit": "mm", "receivers": {"hand": {"markers": LABELS}}}
    return Recording("a.c3d", bytes_of("a.c3d", lambda path: write_c3d(path, points, LABELS)), mapping)


def sequence_of(segments: Sequence[str], poses: Array) -> Recording:
    """Return a sequence file of the poses (T, S, 7) of receivers that have the names of their segments."""
    lines = ["ObjectType = Image"]
    for frame, of_frame in enumerate(poses):
        for segment, numbers in zip(segments, of_frame, strict=True):
            whole = np.column_stack([matrix(numbers[3:]), numbers[:3]]).ravel()
            name = f"Seq_Frame{frame:04d}_{segment}ToTrackerTransform"
            lines += [f"{name} = {' '.join(map(str, whole))} 0 0 0 1", f"{name}Status = OK"]
        lines.append(f"Seq_Frame{frame:04d}_Timestamp = {frame / 60}")
    return Recording("a.mha", "\n".join([*lines, "ElementDataFile = LOCAL\n"]).encode() + b"\xff")


RECORDINGS: Mapping[str, Callable[[], Recording]] = {
    "csv": lambda: Recording("a.csv", bytes_of("a.csv", lambda path: csv.write_csv(TIDY, path))),
    "parquet": lambda: Recording("a.parquet", bytes_of("a", lambda path: pq.write_table(TIDY, path))),
    "capture": lambda: Recording("a.arrows", bytes_of("a", _write_capture)),
    "mapped csv": _mapped_csv,
    "c3d": _c3d,
    "xdf": lambda: Recording(
        "a.xdf", xdf_of(pose_stream(1, xdf_header(SEGMENTS), TIMES_S, DRAWN.reshape(FRAMES, -1)))
    ),
    "sequence": lambda: sequence_of(SEGMENTS, DRAWN),
}
