"""The chunks of an XDF file (XDF 1.0), each looked at before anything is believed.

pyxdf takes a damaged file's counts at their word and skips what it cannot read, saying so in a log alone. So
the chunks are checked here first, and pyxdf is given only those of one stream that are whole.
"""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO
from xml.etree import ElementTree

from schemas.errors import InputError

MAGIC = b"XDF:"

SAMPLE_BYTES = {"double64": 8, "float32": 4, "int64": 8, "int32": 4, "int16": 2, "int8": 1}
"""Bytes of one number of every channel format that holds numbers."""

_FILE_HEADER, _STREAM_HEADER, _SAMPLES, _CLOCK_OFFSET, _BOUNDARY, _STREAM_FOOTER = range(1, 7)
_OF_STREAM = (_STREAM_HEADER, _SAMPLES, _CLOCK_OFFSET, _STREAM_FOOTER)

_MOST_CHANNELS = 100_000
_PIECE = 1 << 20


@dataclass(frozen=True)
class Chunk:
    """One chunk: where it starts in the file, what kind it is, and its bytes as they stand in the file.

    content : without the length, the tag and the stream's number. whole : whether the file has all of it.
    """

    start: int
    tag: int
    stream: int
    raw: bytes
    content: bytes
    whole: bool


@dataclass(frozen=True)
class Channel:
    """What a stream's header says of one channel; empty where it says nothing."""

    index: int
    label: str
    owner: str
    type: str
    unit: str


@dataclass(frozen=True)
class Stream:
    """What a stream's header says. rate_hz : nominal, 0 where it is irregular."""

    number: int
    name: str
    type: str
    format: str
    channel_count: int
    rate_hz: float
    channels: tuple[Channel, ...]


def read_streams(path: Path) -> list[Stream]:
    """Give the streams of a file, in its order. Raises InputError where it is no XDF file or is damaged."""
    found: dict[int, Stream] = {}
    for chunk in _chunks(path):
        if chunk.tag == _STREAM_HEADER and chunk.whole:
            if chunk.stream in found:
                raise InputError(
                    f"{path}: is damaged at byte {chunk.start}: stream {chunk.stream} begins again"
                )
            found[chunk.stream] = _stream(path, chunk)
    return list(found.values())


def whole_chunks_of(path: Path, stream: Stream) -> tuple[io.BytesIO, int | None]:
    """Give an XDF file in memory of that stream alone, and the byte at which the file is cut off, if it is.

    Raises InputError where a chunk is not what it says.
    """
    kept = io.BytesIO()
    kept.write(MAGIC)
    for chunk in _chunks(path):
        if not chunk.whole:
            kept.seek(0)
            return kept, chunk.start
        if chunk.tag in _OF_STREAM and chunk.stream == stream.number:
            _check_chunk(path, chunk, stream)
            kept.write(chunk.raw)
    kept.seek(0)
    return kept, None


def _chunks(path: Path) -> Iterator[Chunk]:
    """Give every chunk; the last one may be cut off."""
    try:
        with _opened(path) as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise InputError(f"{path}: is no XDF file; it does not begin with {MAGIC.decode()}")
            start = len(MAGIC)
            while chunk := _next_chunk(path, file, start):
                yield chunk
                start += len(chunk.raw)
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; expected a recording") from error
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be read ({error}); copy it again") from error


def _opened(path: Path) -> BinaryIO:
    with path.open("rb") as file:
        packed = file.read(2) == b"\x1f\x8b"
    return gzip.open(path, "rb") if packed else path.open("rb")  # type: ignore[return-value]


def _next_chunk(path: Path, file: BinaryIO, start: int) -> Chunk | None:
    lead = file.read(1)
    if not lead:
        return None
    width = lead[0]
    if width not in (1, 4, 8):
        raise InputError(f"{path}: is damaged at byte {start}: no chunk starts there; copy it again")
    size = file.read(width)
    length = int.from_bytes(size, "little")
    body = _read_up_to(file, length) if len(size) == width else b""
    raw = lead + size + body
    if len(size) < width or len(body) < length:
        return Chunk(start, 0, 0, raw, b"", whole=False)
    tag = int.from_bytes(body[:2], "little")
    head = 6 if tag in _OF_STREAM else 2
    if length < head or not _FILE_HEADER <= tag <= _STREAM_FOOTER:
        raise InputError(f"{path}: is damaged at byte {start}: a chunk of no known kind; copy it again")
    return Chunk(start, tag, int.from_bytes(body[2:head], "little"), raw, body[head:], whole=True)


def _read_up_to(file: BinaryIO, length: int) -> bytes:
    """Read piece by piece: a damaged length may be more than any memory."""
    pieces = []
    while length > 0 and (piece := file.read(min(length, _PIECE))):
        pieces.append(piece)
        length -= len(piece)
    return b"".join(pieces)


def _stream(path: Path, chunk: Chunk) -> Stream:
    where = f"{path}: header of stream {chunk.stream}"
    root = _xml(where, chunk.content)
    counted = _text(root, "channel_count")
    if not counted.isdecimal() or not 1 <= int(counted[:9]) <= _MOST_CHANNELS:
        raise InputError(f"{where}: channel_count is {counted!r}; expected a whole number above 0")
    try:
        rate_hz = float(_text(root, "nominal_srate"))
    except ValueError as error:
        raise InputError(f"{where}: nominal_srate is no number; expected Hz, or 0") from error
    channels = tuple(
        Channel(
            index,
            _text(channel, "label"),
            _text(channel, "marker") or _text(channel, "object"),
            _text(channel, "type").lower(),
            _text(channel, "unit").lower(),
        )
        for index, channel in enumerate(root.findall("./desc/channels/channel"))
    )
    kind = _text(root, "channel_format")
    return Stream(
        chunk.stream, _text(root, "name"), _text(root, "type"), kind, int(counted), rate_hz, channels
    )


def _check_chunk(path: Path, chunk: Chunk, stream: Stream) -> None:
    what = {_SAMPLES: "a chunk of samples", _CLOCK_OFFSET: "a clock offset"}.get(chunk.tag, "a footer")
    good = True
    if chunk.tag == _SAMPLES:
        good = _samples_fill(chunk.content, stream.channel_count * SAMPLE_BYTES[stream.format])
    elif chunk.tag == _CLOCK_OFFSET:
        good = len(chunk.content) == 16
    elif chunk.tag == _STREAM_FOOTER:
        counted = _text(_xml(f"{path}: footer of stream {stream.number}", chunk.content), "sample_count")
        good = counted.isdecimal() or not counted
    if not good:
        raise InputError(f"{path}: is damaged at byte {chunk.start}: {what} is not as long as it says")


def _samples_fill(content: bytes, numbers_bytes: int) -> bool:
    """Whether the samples, each with 8 bytes of time stamp or none, end where the chunk does."""
    if not content or content[0] not in (1, 4, 8) or len(content) <= content[0]:
        return False
    at = 1 + content[0]
    for _ in range(int.from_bytes(content[1:at], "little")):
        if at >= len(content) or content[at] not in (0, 8):
            return False
        at += 1 + content[at] + numbers_bytes
    return at == len(content)


def _xml(where: str, content: bytes) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(content.decode("utf-8"))
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{where}: is damaged ({error}); copy the file again") from error
    if root.tag != "info":
        raise InputError(f"{where}: holds {root.tag!r}; expected 'info'")
    return root


def _text(element: ElementTree.Element, tag: str) -> str:
    return (element.findtext(tag) or "").strip()
