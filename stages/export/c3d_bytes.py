"""The C3D container: header, parameter section, points and rotations, as bytes (C3D user guide, www.c3d.org).

Written here and not by ezc3d, which reads it back in the tests: for 100 000 frames of a hand that takes
3.4 GB of memory, and what 16 bits cannot count (frames, start of the rotations) wraps there in silence.
Numbers are little-endian 32-bit floats; frames are streamed. Points come frame by frame, four numbers each:
x, y, z and the residual, -1 where the point is not known. Rotations begin at a block of their own: 4x4
matrices, column by column, and a reliability, -1 where the pose is not known.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from shukotsu.files.whole_files import replacing

Floats = npt.NDArray[np.float32]
Value = str | int | float | Sequence[str] | Sequence[int] | Sequence[float]
"""Of a parameter: text, a whole number from 0 to 65535, a real number, or several of one kind (up to 255)."""

BLOCK = 512
MOST = 255
"""Entries of a parameter and characters of a text: what a byte counts."""
MOST_FRAMES = 65535
"""What 16 bits count; from there on TRIAL:ACTUAL_END_FIELD and POINT:LONG_FRAMES count, too."""
LAST_START = 32767
"""The last block that rotations can start at: readers take its 16 bits as signed."""

_INTEL = 84
_SIGN = 0x50


@dataclass(frozen=True)
class Content:
    """Hold what is to be written.

    labels, descriptions : of the P points. rotations : labels of the R rotations. frames : T, at least 1.
    first_frame : number of the first, so that the last one is below 65535; 1 where there are more.
    groups : parameters by group and name, beside those that the format needs.
    """

    labels: Sequence[str]
    descriptions: Sequence[str]
    rotations: Sequence[str]
    frames: int
    first_frame: int
    rate_hz: float
    unit: str
    groups: Mapping[str, Mapping[str, Value]]

    @property
    def points_bytes(self) -> int:
        """Length of the points."""
        return self.frames * len(self.labels) * 16


def can_hold_rotations(content: Content) -> bool:
    """Tell whether rotations would begin at a block that their start can name, and 16 bits count the frames.

    Of more frames ezc3d reads 65535 where there are rotations, and all where there are none.
    """
    return (
        content.frames <= MOST_FRAMES and _rotations_start(content, _parameter_blocks(content)) <= LAST_START
    )


def write(path: Path, content: Content, points: Iterable[Floats], rotations: Iterable[Floats]) -> None:
    """Write a file whole or not at all.

    points : parts of (T, P, 4), in order. rotations : likewise of (T, R, 17), none where R is 0.
    """
    blocks = _parameter_blocks(content)
    starts = 2 + blocks, _rotations_start(content, blocks)
    with replacing(path) as temporary, temporary.open("wb") as stream:
        stream.write(_header(content, starts[0]))
        stream.write(_parameters(content, *starts))
        for part in points:
            stream.write(part.astype("<f4").tobytes())
        _fill(stream)
        for part in rotations:
            stream.write(part.astype("<f4").tobytes())
        _fill(stream)


def _fill(stream: IO[bytes]) -> None:
    stream.write(bytes(-stream.tell() % BLOCK))


def _parameter_blocks(content: Content) -> int:
    return len(_parameters(content, 1, 1)) // BLOCK


def _rotations_start(content: Content, parameter_blocks: int) -> int:
    return 2 + parameter_blocks - (-content.points_bytes // BLOCK)


def _header(content: Content, data_start: int) -> bytes:
    last = min(content.first_frame + content.frames - 1, MOST_FRAMES)
    header = struct.pack(
        "<BBHHHHHfHHf",
        *(2, _SIGN, len(content.labels), 0, content.first_frame, last, 0, -1.0, data_start, 0),
        content.rate_hz,
    )
    return header.ljust(BLOCK, b"\0")


def _parameters(content: Content, data_start: int, rotations_start: int) -> bytes:
    """The parameter section, filled up to whole blocks."""
    groups = _needed(content, data_start, rotations_start)
    for group, values in content.groups.items():
        groups[group] = {**groups.get(group, {}), **values}
    body = b""
    for number, (group, values) in enumerate(groups.items(), 1):
        body += _entry(group, -number, b"")
        for name, value in values.items():
            body += _entry(name, number, _value(value))
    body += bytes(2)
    length = 4 + len(body)
    blocks = -(-length // BLOCK)
    assert blocks <= MOST, "parameters take more blocks than a byte counts"
    return (bytes((1, _SIGN, blocks, _INTEL)) + body).ljust(blocks * BLOCK, b"\0")


def _needed(content: Content, data_start: int, rotations_start: int) -> dict[str, Mapping[str, Value]]:
    """POINT, ANALOG (without channels), and where there are any ROTATION; TRIAL where frames are many."""
    frames, many = content.frames, content.frames >= MOST_FRAMES
    point: dict[str, Value] = {
        "USED": len(content.labels),
        "SCALE": -1.0,
        "RATE": float(content.rate_hz),
        "DATA_START": data_start,
        "FRAMES": min(frames, MOST_FRAMES),
        **({"LONG_FRAMES": float(frames)} if many else {}),
        "UNITS": [content.unit],
        **split("LABELS", content.labels),
        **split("DESCRIPTIONS", content.descriptions),
    }
    groups: dict[str, Mapping[str, Value]] = {"POINT": point, "ANALOG": {"USED": 0, "RATE": 0.0}}
    if many:
        field = {"ACTUAL_START_FIELD": _words(1), "ACTUAL_END_FIELD": _words(frames)}
        groups["TRIAL"] = field
    if content.rotations:
        groups["ROTATION"] = {
            "USED": len(content.rotations),
            "DATA_START": rotations_start,
            "RATE": float(content.rate_hz),
            "RATIO": 1,
            **split("LABELS", content.rotations),
        }
    return groups


def split(name: str, texts: Sequence[str]) -> dict[str, Sequence[str]]:
    """Parameters NAME, NAME2 and so on, of 255 texts each."""
    parts = [texts[start : start + MOST] for start in range(0, len(texts), MOST)] or [texts]
    return {f"{name}{number if number > 1 else ''}": part for number, part in enumerate(parts, 1)}


def _words(number: int) -> list[int]:
    """A whole number as two of 16 bits, the lower first."""
    return [number % 65536, number // 65536]


def _entry(name: str, group: int, value: bytes) -> bytes:
    """A group (a number below 0, no value) or one of its parameters."""
    encoded = name.encode("ascii")
    following = struct.pack("<H", 2 + len(value) + 1)
    return struct.pack("<Bb", len(encoded), group) + encoded + following + value + b"\0"


def _value(value: Value) -> bytes:
    """Type, dimensions and data of a parameter."""
    if isinstance(value, str):
        return _texts([value], alone=True)
    if isinstance(value, int | float):
        return _numbers([value], alone=True)
    kind = type(value[0]) if len(value) else str
    return _texts(value) if kind is str else _numbers(value)


def _texts(texts: Sequence[Any], *, alone: bool = False) -> bytes:
    cells = [text.encode("ascii") for text in texts]
    width = max((len(cell) for cell in cells), default=0)
    assert width <= MOST, "a text is longer than a byte counts"
    assert len(cells) <= MOST, "there are more texts than a byte counts"
    size = (width,) if alone else (width, len(cells))
    return struct.pack(f"<bB{len(size)}B", -1, len(size), *size) + b"".join(c.ljust(width) for c in cells)


def _numbers(numbers: Sequence[Any], *, alone: bool = False) -> bytes:
    whole = isinstance(numbers[0], int)
    size = () if alone else (len(numbers),)
    head = struct.pack(f"<bB{len(size)}B", 2 if whole else 4, len(size), *size)
    return head + struct.pack(f"<{len(numbers)}{'H' if whole else 'f'}", *numbers)
