"""Count a C3D file's frames by its header, its parameters and its length: none alone is to be trusted.

A header has 16 bits for a frame's number: longer files have 65535 there, or what is left of it (C3D user
guide, www.c3d.org).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

BLOCK = 512
_INTEL, _DEC, MIPS = 84, 85, 86
"""Processor types: numbers have their low byte first but for MIPS; DEC's real numbers are a VAX's."""
_WORD, _FULL = 1 << 16, (1 << 16) - 1
"""What 16 bits count; as a count the last of them means so many or more."""
_16_BITS = ("the header", "POINT:FRAMES")
_READ_BYTES = 1 << 20


@dataclass(frozen=True)
class FrameCount:
    """Hold what there is to read of a file.

    head : its bytes before the frames. points, frame_bytes : of a frame. first : number of the first, from 1.
    frames : that are there. promised : that should be, more only where the file is cut off. doubt : what the
    counts do not agree on, a sentence or nothing. name_at : where `head` has the name of POINT:FRAMES, or 0.
    rotations : whether poses stand behind the points.
    """

    head: bytes
    points: int
    frame_bytes: int
    first: int
    frames: int
    promised: int
    doubt: str
    name_at: int
    rotations: bool

    def head_of(self, frames: int) -> bytes:
        """Give a head in which the header alone counts frames, and counts so many."""
        head = bytearray(self.head)
        struct.pack_into("<HH", head, 6, 1, frames)
        if self.name_at:
            head[self.name_at] = ord("_")
        return bytes(head)


def count_frames(path: Path) -> FrameCount | None:
    """Count a file's frames; None of one without points, or whose form is not known."""
    with path.open("rb") as stream:
        header = stream.read(BLOCK)
        points, analogs, first, last, _, _, block = struct.unpack_from("<HHHHHfH", header, 2)
        head = header + stream.read(max(0, BLOCK * (block - 1) - BLOCK))
        end = path.stat().st_size
        kind = head[BLOCK * (head[0] - 1) + 3 :][:1]
        if kind not in (bytes([_INTEL]), bytes([_DEC])) or not points:
            return None
        found = {name: (at, numbers) for name, at, numbers in _parameters(head, kind[0])}
        numbers = {name: own for name, (_, own) in found.items() if own}
        rotations = numbers.get("ROTATION:USED", [0])[0] > 0
        start = int(numbers.get("ROTATION:DATA_START", [0])[0]) if rotations else 0
        end = min(end, BLOCK * (start - 1)) if start > block else end
        is_real = header[13 + 2 * (kind[0] == _INTEL)] >= 0x80  # the scale, which is below 0 then
        frame_bytes = (4 * points + analogs) * (4 if is_real else 2)
        counts = _counts(numbers, first, last)
        filled_bytes = _filled_bytes(stream, len(head), end)
    room = max(0, (end - len(head)) // frame_bytes)
    frames, promised = _agreed(counts, filled_bytes / frame_bytes, room, BLOCK / frame_bytes)
    actual = _long(numbers.get("TRIAL:ACTUAL_START_FIELD", []))
    return FrameCount(
        head,
        points,
        frame_bytes,
        actual if actual % _WORD == first else first,
        frames,
        promised,
        _doubt(counts, frames, filled_bytes > frames * frame_bytes + BLOCK),
        found.get("POINT:FRAMES", (0, []))[0],
        rotations,
    )


def _counts(numbers: Mapping[str, list[float]], first: int, last: int) -> dict[str, int]:
    """Give what counts the frames, and how many it says."""
    counts = {"the header": (last - first + 1) % _WORD if last < _FULL else max(_FULL - first + 1, 0)}
    for name in ("POINT:FRAMES", "POINT:LONG_FRAMES"):
        if name in numbers:
            counts[name] = int(numbers[name][0])
    if "TRIAL:ACTUAL_END_FIELD" in numbers:
        actual = [_long(numbers.get(f"TRIAL:ACTUAL_{end}_FIELD", [])) for end in ("START", "END")]
        counts["TRIAL"] = actual[1] - max(actual[0], 1) + 1
    return counts


def _agreed(counts: Mapping[str, int], filled: float, room: int, slack: float) -> tuple[int, int]:
    """Give how many frames there are, and how many there should be.

    filled : frames up to the last byte that is not zero. room : whole frames up to the end. slack : frames
    that what fills a file's last block may seem to be.
    """
    filled_frames = math.ceil(filled)
    exact = sorted(counts.values(), key=lambda count: (count == _FULL, count))
    wrapped = [
        counts[name] + _WORD * math.ceil((filled_frames - counts[name]) / _WORD)
        for name in _16_BITS
        if name in counts
    ]
    beyond = [count for count in exact if count > room]
    open_end = [filled_frames] if not beyond and _FULL in counts.values() and filled_frames > _FULL else []
    for count in (*exact, *wrapped, *open_end):
        if filled_frames <= count <= room:
            return count, count
    behind = [count for count in exact if count <= room]
    near = [count for count in behind if filled <= count + slack]
    if near or not beyond:
        frames = max(near or behind)
        return frames, frames
    return room, min(beyond)


def _doubt(counts: Mapping[str, int], frames: int, more: bool) -> str:
    """Say what the counts do not agree on; more : whether the file goes on behind the frames."""
    others = [f"{name} says {count}" for name, count in counts.items() if count not in (frames, _FULL)]
    if more:
        others.append("behind them the file goes on with what nothing counts")
    elif frames > _FULL and frames not in counts.values():
        others.append("nothing counts those beyond 65535, which are read up to the last that is not zero")
    return f"{frames} frames are read, but {', '.join(others)}; see that this is all" if others else ""


def _filled_bytes(stream: BinaryIO, start: int, end: int) -> int:
    """Give how many bytes there are from `start` to the last one before `end` that is not zero."""
    while end > start:
        begin = max(start, end - _READ_BYTES)
        stream.seek(begin)
        if filled := stream.read(end - begin).rstrip(b"\0"):
            return begin + len(filled) - start
        end = begin
    return 0


def _long(words: list[float]) -> int:
    """Give a number of 32 bits from its two words, the low one first."""
    return int(sum(word * _WORD**place for place, word in enumerate(words[:2])))


def _parameters(head: bytes, kind: int) -> Iterator[tuple[str, int, list[float]]]:
    """Give the parameters, as "GROUP:NAME", with the place of the name and the first two of their numbers."""
    groups, records = {}, []
    at = BLOCK * (head[0] - 1) + 4
    while at + 2 < len(head):
        letters, group = abs(struct.unpack_from("<b", head, at)[0]), struct.unpack_from("<b", head, at + 1)[0]
        after = at + 2 + letters
        if not letters or after + 5 > len(head):
            break
        name = head[at + 2 : after].decode("ascii", "replace").upper()
        if group < 0:
            groups[-group] = name
        else:
            records.append((group, name, at + 2, after + 2))
        link = struct.unpack_from("<H", head, after)[0]
        at = after + link if link else len(head)
    for group, name, name_at, value_at in records:
        yield f"{groups.get(group)}:{name}", name_at, _first_numbers(head, value_at, kind)


def _first_numbers(head: bytes, at: int, kind: int) -> list[float]:
    size, dimensions = struct.unpack_from("<bB", head, at)
    start = at + 2 + dimensions
    count = min(2, math.prod(head[at + 2 : start]), (len(head) - start) // max(size, 1))
    if size == 2:
        return [float(word) for word in struct.unpack_from(f"<{count}H", head, start)]
    if size != 4:
        return []
    words = [head[start + 4 * place :][:4] for place in range(count)]
    if kind == _DEC:
        return [struct.unpack("<f", word[2:] + word[:2])[0] / 4 for word in words]
    return [number if math.isfinite(number := struct.unpack("<f", word)[0]) else 0.0 for word in words]
