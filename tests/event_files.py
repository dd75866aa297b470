"""Small files of a recording with events: poses, a tracker's records with sync pulses, MIDI and XDF files."""

from __future__ import annotations

import struct
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from shukotsu.tables.catalogue import POSES
from shukotsu.tables.typed_table import Provenance, Table, write_table
from shukotsu.tracker.archive import ArchiveWriter
from shukotsu.tracker.families import StreamSettings

RATE_HZ = 240.0
TICKS_A_SECOND = 960
"""480 a quarter note, 120 of which are a minute where a file names no tempo."""


def filled(table: Table, rows: int, columns: Mapping[str, Any]) -> dict[str, Any]:
    """The columns of a table: those given, else null, 0, False or empty."""
    empty = {pa.string(): "", pa.bool_(): False}
    return {
        c.name: pa.nulls(rows, c.type) if c.nullable else [empty.get(c.type, 0)] * rows for c in table.columns
    } | dict(columns)


def poses_of(
    folder: Path, first_s: float = 0.0, last_s: float = 20.0, file: Path | None = None, **key: str
) -> Path:
    """A poses table of one segment, imported from that file."""
    names = {"subject": "01", "hand": "right", "task": "piece", "trial": "2", **key}
    columns = {"segment": ["hand"] * 3, "frame": np.arange(3), "time_s": np.linspace(first_s, last_s, 3)}
    path = folder / "poses.parquet"
    provenance = Provenance.of([] if file is None else [file], **names)
    write_table(path, POSES, filled(POSES, 3, columns), provenance)
    return path


def records_of(folder: Path, pulses_s: npt.NDArray[np.float64], length_s: float = 0.05) -> Path:
    """A raw capture of one station over 20 s, the sync input on for a while from each pulse."""
    time_s = np.arange(20 * int(RATE_HZ)) / RATE_HZ
    since_s = time_s[:, None] - pulses_s
    on = ((since_s >= 0) & (since_s < length_s)).any(-1)
    return flags_of(folder / "records.arrows", [(frame, 1, int(sync), 0) for frame, sync in enumerate(on)])


def flags_of(path: Path, rows: Sequence[tuple[int, int, int, int]]) -> Path:
    """A raw capture of records that are sent when measured; rows : frame, station, sync and button."""
    items, stations = (9, 12, 10, 3, 7), tuple(sorted({station for _, station, _, _ in rows}))
    settings = StreamSettings("liberty", "binary", "cm", RATE_HZ, stations, dict.fromkeys(stations, items))
    writer = ArchiveWriter(path, {}, lambda: 0)
    writer.settings(settings.to_json(), 0)
    for frame, station, sync, button in rows:
        body = struct.pack("<Iii7f", frame, sync, button, 20, 5, -3, 1, 0, 0, 0)
        head = b"LY" + struct.pack("<BBBBh", station, ord("C"), 0, 0, len(body))
        writer.received(head + body, round(frame * 1e9 / RATE_HZ))
    writer.close({}, round(frame * 1e9 / RATE_HZ))
    return path


def midi_of(folder: Path, pulses_s: npt.NDArray[np.float64]) -> Path:
    """A MIDI file: note 24 at each pulse, and a quarter of a second later note 60."""
    notes = sorted([(time, 24) for time in pulses_s] + [(time + 0.25, 60) for time in pulses_s])
    content, tick = b"", 0
    for time, key in notes:
        for at, status in (
            (round(time * TICKS_A_SECOND), 0x90),
            (round((time + 0.1) * TICKS_A_SECOND), 0x80),
        ):
            gap = at - tick
            content += bytes([gap >> 14 & 0x7F | 0x80, gap >> 7 & 0x7F | 0x80, gap & 0x7F])
            content += bytes([status, key, 64])
            tick = at
    content += b"\x00\xff\x2f\x00"
    head = b"MThd\0\0\0\6\0\0\0\1" + (TICKS_A_SECOND // 2).to_bytes(2, "big")
    path = folder / "take.mid"
    path.write_bytes(head + b"MTrk" + len(content).to_bytes(4, "big") + content)
    return path


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
    """Return the header of a stream of poses, a channel a number of each owner."""
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


def pose_stream(
    number: int,
    head: bytes,
    time_s: npt.NDArray[np.float64],
    values: npt.NDArray[np.float64],
    offsets: Sequence[tuple[float, float]] = (),
) -> bytes:
    """A stream's chunks: header, samples two a chunk, clock offsets, footer; a NaN time is left out."""
    of = struct.pack("<I", number)
    data = xdf_chunk(2, of + head)
    code = "<f4" if b"float32" in head else "<f8"
    for start in range(0, len(time_s), 2):
        samples = b""
        rows = range(start, min(start + 2, len(time_s)))
        for row in rows:
            stamp = b"\0" if np.isnan(time_s[row]) else struct.pack("<Bd", 8, time_s[row])
            samples += stamp + values[row].astype(code).tobytes()
        data += xdf_chunk(3, of + struct.pack("<BB", 1, len(rows)) + samples)
    for offset in offsets:
        data += xdf_chunk(4, of + struct.pack("<dd", *offset))
    footer = f"<info><sample_count>{len(time_s)}</sample_count></info>".encode()
    return data + xdf_chunk(6, of + footer)


def marker_stream(
    number: int,
    name: str,
    values: Sequence[Sequence[str] | Sequence[int]],
    time_s: Sequence[float],
    offsets: Sequence[tuple[float, float]] = (),
    rate_hz: float = 0,
) -> bytes:
    """A stream of texts, or of 32-bit numbers, a sample a chunk."""
    texts = not values or isinstance(values[0][0], str)
    head = (
        f"<info><name>{name}</name><type>Markers</type><channel_count>{len(values[0]) if values else 1}"
        f"</channel_count><nominal_srate>{rate_hz}</nominal_srate>"
        f"<channel_format>{'string' if texts else 'int32'}</channel_format></info>"
    )
    of = struct.pack("<I", number)
    data = xdf_chunk(2, of + head.encode())
    for sample, time in zip(values, time_s, strict=True):
        content = struct.pack("<BBBd", 1, 1, 8, time)
        for value in sample:
            if isinstance(value, str):
                content += struct.pack("<BI", 4, len(value.encode())) + value.encode()
            else:
                content += struct.pack("<i", value)
        data += xdf_chunk(3, of + content)
    for offset in offsets:
        data += xdf_chunk(4, of + struct.pack("<dd", *offset))
    footer = f"<info><sample_count>{len(values)}</sample_count></info>"
    return data + xdf_chunk(6, of + footer.encode())


def xdf_of(*streams: bytes) -> bytes:
    """An XDF file of those streams."""
    return b"XDF:" + xdf_chunk(1, b"<info><version>1.0</version></info>") + b"".join(streams)


def _bytes_of(write: Callable[[Path], Path]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return write(Path(folder)).read_bytes()


PULSES_S = np.array([1.0, 1.7, 3.6, 4.7])
SAMPLES: Mapping[str, Callable[[], bytes]] = {
    "a.mid": lambda: _bytes_of(lambda folder: midi_of(folder, PULSES_S)),
    "a.xdf": lambda: xdf_of(
        marker_stream(1, "cues", [["go"], ["stop"]], [1.0, 2.0], [(0.0, 1.0), (5.0, 1.0)])
    ),
    "a.arrows": lambda: _bytes_of(lambda folder: records_of(folder, PULSES_S)),
}
"""A small valid file of every kind, by a name of that ending: what tests spoil."""
