"""Poses -> the bytes of records, for a block of cycles and all stations at once.

Sources: LIBERTY User Manual URM03PH156, table of output items and reply framing; FASTRAK User Manual
OPM00PI002, output list command.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from kinematics import rotations
from stages.capture.trackers.liberty.items import ITEMS, TAGS

Array = npt.NDArray[np.float64]
Wholes = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]

BLANK = ord(" ")


@dataclass(frozen=True)
class Measured:
    """What T cycles of S stations measured, ready to be sent.

    frame, device_ms, sync : (T,); position (T, S, 3) in the unit that is sent; quaternion (T, S, 4);
    present (T, S) whether the station sends a record; letter (T, S) the error letter's code, 0 for none;
    distortion, button (T, S).
    """

    stations: tuple[int, ...]
    frame: Wholes
    device_ms: Wholes
    position: Array
    quaternion: Array
    present: npt.NDArray[np.bool_]
    letter: Bytes
    distortion: Wholes
    button: Wholes
    sync: Wholes

    def __len__(self) -> int:
        return len(self.frame)


@dataclass(frozen=True)
class Block:
    """Records of T cycles, one cycle after the other.

    data : the bytes. sizes : (T, S) bytes of each record, 0 where a station sent none.
    frame, device_ms : (T,) as in the records.
    """

    stations: tuple[int, ...]
    data: Bytes
    sizes: Wholes
    frame: Wholes
    device_ms: Wholes

    @property
    def bounds(self) -> Wholes:
        """First byte of every cycle and the end of the last, (T + 1,)."""
        return np.concatenate([[0], np.cumsum(self.sizes.sum(1))]).astype(np.int64)


def euler_deg(quaternion: Array) -> Array:
    """Azimuth, elevation and roll in degrees (..., 3) of unit quaternions: M = Rz(az) Ry(el) Rx(roll)."""
    m = rotations.matrix(quaternion)
    angles = [
        np.arctan2(m[..., 1, 0], m[..., 0, 0]),
        np.arcsin(np.clip(-m[..., 2, 0], -1, 1)),
        np.arctan2(m[..., 2, 1], m[..., 2, 2]),
    ]
    return np.asarray(np.degrees(np.stack(angles, -1)))


def from_euler_deg(azimuth: float, elevation: float, roll: float) -> Array:
    """Quaternion (4,) of azimuth, elevation and roll in degrees."""
    turns = zip(np.eye(3)[::-1], np.radians([azimuth, elevation, roll]), strict=True)
    z, y, x = (rotations.about_axis(axis, angle) for axis, angle in turns)
    return rotations.multiply(rotations.multiply(z, y), x)


def _cosines(m: Measured, s: int) -> Array:
    return rotations.matrix(m.quaternion[:, s]).reshape(len(m), 9)


def _cosine_row(row: int) -> Callable[[Measured, int], Array]:
    return lambda m, s: rotations.matrix(m.quaternion[:, s])[:, row]


def _nothing(m: Measured, _s: int) -> Array:
    return np.empty((len(m), 0))


_Values = Callable[[Measured, int], npt.NDArray[np.float64] | Wholes]

_VALUES: Mapping[str, _Values] = {
    "position": lambda m, s: m.position[:, s],
    "euler": lambda m, s: euler_deg(m.quaternion[:, s]),
    "quaternion": lambda m, s: m.quaternion[:, s],
    "cosines": _cosines,
    "cosines_x": _cosine_row(0),
    "cosines_y": _cosine_row(1),
    "cosines_z": _cosine_row(2),
    "device_ms": lambda m, _s: m.device_ms[:, None],
    "frame": lambda m, _s: m.frame[:, None],
    "button": lambda m, s: m.button[:, s, None],
    "button_letters": lambda m, s: np.stack([np.full(len(m), BLANK), ord("0") + m.button[:, s]], -1),
    "distortion": lambda m, s: m.distortion[:, s, None],
    "sync": lambda m, _s: m.sync[:, None],
    "text": _nothing,
}


@dataclass(frozen=True)
class Field:
    """One output item: which values, their NumPy type in binary, and how they are printed in ASCII.

    An item whose values are "text" is that text in binary too. binary_values : where they are others.
    """

    values: str
    kind: str
    text: str
    binary_values: str = ""


_EXTENDED = "% .6E "
"""C prints two digits of the exponent; the third is put in afterwards."""

_LINE = "%8.5f " * 3 + "\r\n"
_LIBERTY_FORMS = {
    0: ("text", " "),
    1: ("text", "\r\n"),
    2: ("position", "%8.3f " * 3),
    3: ("position", _EXTENDED * 3),
    4: ("euler", "%8.3f " * 3),
    5: ("euler", _EXTENDED * 3),
    6: ("cosines", _LINE * 3),
    7: ("quaternion", "%8.5f " * 4),
    8: ("device_ms", "%d"),
    9: ("frame", "%d"),
    10: ("button", "%d"),
    11: ("distortion", "%d"),
    12: ("sync", "%d"),
}
LIBERTY_FIELDS = {
    item: Field(values, f"<{ITEMS[item].kind}", text) for item, (values, text) in _LIBERTY_FORMS.items()
}
"""Output items of LIBERTY and PATRIOT."""

_FASTRAK_VALUES = {
    2: "position",
    4: "euler",
    5: "cosines_x",
    6: "cosines_y",
    7: "cosines_z",
    11: "quaternion",
}
_FASTRAK_WIDTHS = {2: "%7.2f" * 3, 4: "%7.2f" * 3, 11: "%7.4f" * 4}
FASTRAK_FIELDS = {
    0: Field("text", "u1", " "),
    1: Field("text", "u1", "\r\n"),
    16: Field("button", "u1", " %d", "button_letters"),
    **{i: Field(v, "<f4", _FASTRAK_WIDTHS.get(i, "%7.4f" * 3)) for i, v in _FASTRAK_VALUES.items()},
    **{50 + i: Field(v, "<f4", _EXTENDED * (4 if i == 11 else 3)) for i, v in _FASTRAK_VALUES.items()},
}
"""Output items of FASTRAK; 5x is item x printed with more digits."""


@dataclass(frozen=True)
class Framing:
    """How a family frames records: its items, and the header of a record in binary and in ASCII.

    header : station, letter, body length -> bytes of a binary header, whose byte at `letter_at` is then
    the letter of each record; text_header : station and letter -> text.
    """

    fields: Mapping[int, Field]
    header: Callable[[int, int], bytes]
    letter_at: int
    text_header: Callable[[int, int], str]
    no_letter: int


def liberty_framing(family: str, command: int) -> Framing:
    """Framing of LIBERTY or PATRIOT for records that answer that command byte."""
    tag = TAGS[family]

    def header(station: int, body: int) -> bytes:
        return tag + bytes((station, command, 0, 0)) + body.to_bytes(2, "little")

    return Framing(LIBERTY_FIELDS, header, 4, lambda station, letter: f"{station:02d}{letter:c} ", 0)


FASTRAK_FRAMING = Framing(
    FASTRAK_FIELDS,
    lambda station, _body: f"0{station} ".encode(),
    2,
    lambda station, letter: f"0{station}{letter:c}",
    BLANK,
)


def encode(
    measured: Measured, lists: Mapping[int, Sequence[int]], framing: Framing, *, binary: bool
) -> Block:
    """Encode the cycles; lists : station -> its output list."""
    columns = range(len(measured.stations))
    items = [lists[station] for station in measured.stations]
    if binary:
        parts = [_binary_records(measured, s, items[s], framing) for s in columns]
        data, sizes = _joined(measured, parts)
    else:
        texts = [_text_records(measured, s, items[s], framing) for s in columns]
        data, sizes = _joined_texts(measured, texts)
    return Block(measured.stations, data, sizes, measured.frame, measured.device_ms)


def _binary_records(measured: Measured, s: int, items: Sequence[int], framing: Framing) -> Bytes:
    """Records of one station in binary, (T, bytes)."""
    parts = []
    for item in items:
        field = framing.fields[item]
        if field.values == "text":
            constant = np.frombuffer(field.text.encode(), np.uint8)
            parts.append(np.broadcast_to(constant, (len(measured), len(constant))))
            continue
        values = np.ascontiguousarray(
            _VALUES[field.binary_values or field.values](measured, s).astype(field.kind)
        )
        parts.append(values.view(np.uint8).reshape(len(measured), -1))
    body = sum(part.shape[1] for part in parts)
    header = np.frombuffer(framing.header(measured.stations[s], body), np.uint8)
    heads = np.tile(header, (len(measured), 1))
    heads[:, framing.letter_at] = np.where(measured.letter[:, s], measured.letter[:, s], framing.no_letter)
    return np.concatenate([heads, *parts], 1)


def _text_records(measured: Measured, s: int, items: Sequence[int], framing: Framing) -> list[bytes]:
    """Records of one station in ASCII."""
    fields = [framing.fields[item] for item in items]
    pattern = "".join(field.text for field in fields)
    values = [np.asarray(_VALUES[field.values](measured, s), float) for field in fields]
    rows = np.concatenate(values, 1).tolist() if values else [[]] * len(measured)
    heads = [framing.text_header(measured.stations[s], letter or BLANK) for letter in measured.letter[:, s]]
    texts = [head + pattern % tuple(row) for head, row in zip(heads, rows, strict=True)]
    if _EXTENDED in pattern:
        texts = [text.replace("E+", "E+0").replace("E-", "E-0") for text in texts]
    return [text.encode() for text in texts]


def _joined(measured: Measured, parts: Sequence[Bytes]) -> tuple[Bytes, Wholes]:
    widths = np.array([part.shape[1] for part in parts], np.int64)
    if not parts:
        return np.empty(0, np.uint8), np.zeros((len(measured), 0), np.int64)
    whole = np.concatenate(parts, 1)
    if not measured.present.all():
        whole = whole[np.repeat(measured.present, widths, axis=1)]
    return whole.ravel(), measured.present * widths


def _joined_texts(measured: Measured, parts: Sequence[Sequence[bytes]]) -> tuple[Bytes, Wholes]:
    sizes = np.zeros(measured.present.shape, np.int64)
    chosen = []
    for t, s in np.argwhere(measured.present):
        sizes[t, s] = len(parts[s][t])
        chosen.append(parts[s][t])
    return np.frombuffer(b"".join(chosen), np.uint8), sizes
