"""Poses -> the bytes of records, for a block of cycles and all stations at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from shukotsu.skeleton import rotations
from shukotsu.trackers.protocols.output_items import CONSTANT_BYTES, EXTENDED, OutputItems
from shukotsu.trackers.protocols.records import Array, Bytes, Wholes


@dataclass(frozen=True)
class Measured:
    """Hold what T cycles of S stations measured, ready to be sent.

    frame, device_ms : (T,); position (T, S, 3) in the unit that is sent; quaternion (T, S, 4); present (T, S)
    whether the station sends a record.
    """

    stations: tuple[int, ...]
    frame: Wholes
    device_ms: Wholes
    position: Array
    quaternion: Array
    present: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.frame)


@dataclass(frozen=True)
class Block:
    """Records of T cycles, one cycle after the other.

    data : the bytes. sizes : (T, S) bytes of each record, 0 where a station sent none.
    """

    data: Bytes
    sizes: Wholes

    def __len__(self) -> int:
        return len(self.sizes)

    @cached_property
    def _ends(self) -> Wholes:
        """First byte of every cycle and the end of the last, (T + 1,)."""
        return np.concatenate([[0], np.cumsum(self.sizes.sum(1))]).astype(np.int64)

    def cycle(self, index: int) -> tuple[bytes, tuple[int, ...]]:
        """The bytes of one cycle, and the first byte of each of its records."""
        sizes = self.sizes[index][self.sizes[index] > 0]
        starts = (0, *np.cumsum(sizes)[:-1].tolist()) if len(sizes) else ()
        return self.data[self._ends[index] : self._ends[index + 1]].tobytes(), starts


@dataclass(frozen=True)
class Framing:
    """Hold how a family frames records.

    header : field of a binary header -> its value; `station` comes from the record. station_byte : what is
    added to a station's number in binary. text_header : of a station's number, in ASCII.
    """

    items: OutputItems
    header: Mapping[str, bytes | int]
    station_byte: int
    text_header: str


def encode(
    measured: Measured, lists: Mapping[int, Sequence[int]], framing: Framing, *, binary: bool
) -> Block:
    """Encode the cycles; lists : station -> its output list."""
    one_station = _binary_records if binary else _text_records
    parts = [
        one_station(measured, s, tuple(lists[station]), framing)
        for s, station in enumerate(measured.stations)
    ]
    records = [
        [part[t] for part, present in zip(parts, row, strict=True) if present]
        for t, row in enumerate(measured.present)
    ]
    sizes = np.zeros(measured.present.shape, np.int64)
    sizes[measured.present] = [len(record) for row in records for record in row]
    data = b"".join(record for row in records for record in row)
    return Block(np.frombuffer(data, np.uint8), sizes)


def _binary_records(measured: Measured, s: int, items: tuple[int, ...], framing: Framing) -> list[bytes]:
    """Records of one station in binary, T of them."""
    rows = np.zeros(len(measured), framing.items.record_type(items))
    names = list(rows.dtype.names or ())
    for name, value in framing.header.items():
        rows[name] = value
    if "size" in names:
        rows["size"] = rows.dtype.itemsize - framing.items.header_bytes
    rows["station"] = measured.stations[s] + framing.station_byte
    values = _values(measured, s)
    fields = [field for item in items for field in framing.items.items[item].fields]
    for name, field in zip(names[len(framing.items.header) :], fields, strict=True):
        if field in CONSTANT_BYTES:
            rows[name] = CONSTANT_BYTES[field]
        elif rows.dtype[name] == np.uint8:
            rows[name] = ord("0") + values[field]
        else:
            rows[name] = values[field]
    data, size = rows.tobytes(), rows.dtype.itemsize
    return [data[at : at + size] for at in range(0, len(data), size)]


def _text_records(measured: Measured, s: int, items: tuple[int, ...], framing: Framing) -> list[bytes]:
    """Records of one station in ASCII, T of them."""
    pattern = "".join(framing.items.items[item].text for item in items)
    values = _values(measured, s)
    fields = [field for item in items for field in framing.items.items[item].fields]
    columns = [np.asarray(values[field], float) for field in fields if field not in CONSTANT_BYTES]
    numbers = np.stack(columns, -1).tolist() if columns else [[]] * len(measured)
    head = framing.text_header % measured.stations[s]
    texts = [head + pattern % tuple(row) for row in numbers]
    if EXTENDED in pattern:  # C prints two digits of the exponent, the trackers three
        texts = [text.replace("E+", "E+0").replace("E-", "E-0") for text in texts]
    return [text.encode() for text in texts]


def _values(measured: Measured, s: int) -> dict[str, Array | Wholes]:
    """Numbers of a station's records by the names of fields, each (T,)."""
    cosines = rotations.matrix(measured.quaternion[:, s])
    return {
        **{axis: measured.position[:, s, i] for i, axis in enumerate("xyz")},
        **{f"moved_{axis}": np.zeros(len(measured)) for axis in "xyz"},
        **{f"q{part}": measured.quaternion[:, s, i] for i, part in enumerate("wxyz")},
        **{f"cosine_{a}{b}": cosines[:, i, j] for i, a in enumerate("xyz") for j, b in enumerate("xyz")},
        "azimuth": np.degrees(np.arctan2(cosines[:, 1, 0], cosines[:, 0, 0])),
        "elevation": np.degrees(np.arcsin(np.clip(-cosines[:, 2, 0], -1, 1))),
        "roll": np.degrees(np.arctan2(cosines[:, 2, 1], cosines[:, 2, 2])),
        "frame": measured.frame,
        "device_ms": measured.device_ms,
        **dict.fromkeys(("button", "distortion", "sync"), np.zeros(len(measured), np.int64)),
    }
