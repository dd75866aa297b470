"""Poses -> the bytes of records, for a block of cycles and all stations at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.skeleton import rotations
from shukotsu.trackers.liberty.items import HEADER, HEADER_BYTES, ITEMS, record_type
from shukotsu.trackers.protocols.records import Array, Bools, Wholes

_CONSTANTS = {"blank": ord(" "), "cr": ord("\r"), "lf": ord("\n")}


@dataclass(frozen=True)
class Measured:
    """What T cycles of S stations measured, ready to be sent.

    frame, device_ms : (T,); position (T, S, 3) in the unit that is sent; quaternion (T, S, 4); present (T, S)
    whether the station sends a record.
    """

    stations: tuple[int, ...]
    frame: Wholes
    device_ms: Wholes
    position: Array
    quaternion: Array
    present: Bools


def encode(
    measured: Measured, lists: Mapping[int, Sequence[int]], tag: bytes, command: int, *, binary: bool
) -> list[bytes]:
    """Return the bytes of each cycle; lists : station -> its output list.

    In text the list is that of power-up (position, angles, a line end), whatever was asked for.
    """
    records = [
        _binary_records(measured, column, lists[station], tag, command)
        if binary
        else _text_records(measured, column)
        for column, station in enumerate(measured.stations)
    ]
    return [
        b"".join(station[cycle] for station, there in zip(records, present, strict=True) if there)
        for cycle, present in enumerate(measured.present)
    ]


def _binary_records(
    measured: Measured, column: int, items: Sequence[int], tag: bytes, command: int
) -> list[bytes]:
    kind = record_type(items)
    rows = np.zeros(len(measured.frame), kind)
    head = {"tag": tag, "command": command, "size": kind.itemsize - HEADER_BYTES}
    for name, value in {**head, "station": measured.stations[column]}.items():
        rows[name] = value
    numbers = _numbers(measured, column)
    fields = [field for item in items for field in ITEMS[item][0]]
    for name, field in zip((kind.names or ())[len(HEADER) :], fields, strict=True):
        rows[name] = _CONSTANTS[field] if field in _CONSTANTS else numbers[field]
    data, size = rows.tobytes(), kind.itemsize
    return [data[at : at + size] for at in range(0, len(data), size)]


def _text_records(measured: Measured, column: int) -> list[bytes]:
    numbers = _numbers(measured, column)
    columns = [numbers[name] for name in ("x", "y", "z", "azimuth", "elevation", "roll")]
    head, pattern = f"{measured.stations[column]:02d}  ", "%8.3f " * 6 + "\r\n"
    return [(head + pattern % row).encode() for row in zip(*columns, strict=True)]


def _numbers(measured: Measured, column: int) -> dict[str, Array | Wholes]:
    """Numbers of a station's records by the names of fields, each (T,)."""
    cosines = rotations.matrix(measured.quaternion[:, column])
    return {
        **{axis: measured.position[:, column, i] for i, axis in enumerate("xyz")},
        **{f"q{part}": measured.quaternion[:, column, i] for i, part in enumerate("wxyz")},
        **{f"cosine_{a}{b}": cosines[:, i, j] for i, a in enumerate("xyz") for j, b in enumerate("xyz")},
        "azimuth": np.degrees(np.arctan2(cosines[:, 1, 0], cosines[:, 0, 0])),
        "elevation": np.degrees(np.arcsin(np.clip(-cosines[:, 2, 0], -1, 1))),
        "roll": np.degrees(np.arctan2(cosines[:, 2, 1], cosines[:, 2, 2])),
        "frame": measured.frame,
        "device_ms": measured.device_ms,
        **dict.fromkeys(("button", "distortion", "sync"), np.zeros(len(measured.frame), np.int64)),
    }
