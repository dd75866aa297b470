"""The streams of an XDF file (XDF 1.0), each chunk looked at before anything is believed.

pyxdf alone takes a damaged file's counts at their word, and of a file that is cut off inside a sample it
gives numbers that were never recorded. So it is given only the chunks of one stream that are whole.
"""

from __future__ import annotations

import gzip
import io
import logging
import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.files.limits import MEMORY_BYTES, MEMORY_PER_BYTE, read_whole
from shukotsu.files.text_files import reading

SAMPLE_BYTES = {"double64": 8, "float32": 4, "int64": 8, "int32": 4, "int16": 2, "int8": 1}
"""Bytes of one number of every channel format that holds numbers."""

TEXT = "string"
"""The channel format that holds texts, each with its length before it."""

POSITION = ("positionx", "positiony", "positionz")
QUATERNION = ("orientationa", "orientationb", "orientationc", "orientationd")
"""A is the scalar; B, C and D are the axial components x, y and z."""

EULER = ("orientationp", "orientationh", "orientationr")

_MAGIC = b"XDF:"
_FILE_HEADER, _STREAM_HEADER, _SAMPLES, _CLOCK_OFFSET, _BOUNDARY, _STREAM_FOOTER = range(1, 7)
_OF_STREAM = (_STREAM_HEADER, _SAMPLES, _CLOCK_OFFSET, _STREAM_FOOTER)
_MOST_CHANNELS = 100_000


@dataclass(frozen=True)
class Chunk:
    """One chunk: where it starts in the file, what kind it is, and its bytes as they are in the file.

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
    """Hold what a stream's header says of one channel; empty where it says nothing."""

    index: int
    label: str
    owner: str
    type: str
    unit: str


@dataclass(frozen=True)
class Stream:
    """Hold what a stream's header says. rate_hz : nominal, 0 where it is irregular."""

    number: int
    name: str
    type: str
    format: str
    channel_count: int
    rate_hz: float
    channels: tuple[Channel, ...]


def owners(stream: Stream) -> list[str]:
    """The markers and objects that have a position or an orientation, in the order of the channels."""
    posed = (*POSITION, *QUATERNION, *EULER)
    return list(dict.fromkeys(c.owner for c in stream.channels if c.type in posed and c.owner))


def check_described(where: str, stream: Stream) -> None:
    """Raise InputError unless a stream holds numbers and its header describes every channel."""
    if stream.format not in SAMPLE_BYTES:
        raise InputError(f"{where}: holds {stream.format or 'no format'}; expected numbers")
    if len(stream.channels) != stream.channel_count:
        raise InputError(
            f"{where}: has {stream.channel_count} channels, but its header describes {len(stream.channels)}; "
            "the sender must describe each (label, marker or object, type, unit)"
        )


def pose_channels(where: str, stream: Stream, owner: str) -> list[Channel]:
    """Give the channels of x, y, z and A, B, C, D of a marker or object. Raises InputError for others."""
    where = f"{where}, {owner}"
    own = [channel for channel in stream.channels if channel.owner == owner]
    if any(c.type in EULER for c in own) and not any(c.type in QUATERNION for c in own):
        raise InputError(
            f"{where}: has angles (OrientationP, H, R), whose order XDF does not say; record quaternions"
        )
    types = [channel.type for channel in own]
    for kind in (*POSITION, *QUATERNION):
        if types.count(kind) != 1:
            spelled = kind.capitalize()[:-1] + kind[-1].upper()
            raise InputError(
                f"{where}: has {types.count(kind) or 'no'} channels of type {spelled}; expected one"
            )
    return [own[types.index(kind)] for kind in (*POSITION, *QUATERNION)]


def read_streams(path: Path) -> list[Stream]:
    """Give the streams of a file, in its order. Raises InputError where it is no XDF file or is damaged."""
    streams: dict[int, Stream] = {}
    for chunk in _chunks(path):
        if chunk.tag == _STREAM_HEADER and chunk.whole:
            if chunk.stream in streams:
                raise _damaged(path, chunk.start, f"stream {chunk.stream} begins again")
            where = f"{path}: header of stream {chunk.stream}"
            streams[chunk.stream] = described(where, chunk.content, chunk.stream)
    return list(streams.values())


def whole_chunks_of(path: Path, stream: Stream) -> tuple[io.BytesIO, int | None]:
    """Give an XDF file in memory of that stream alone, and the byte at which the file is cut off, if it is.

    Raises InputError where a chunk is not what it says.
    """
    kept = [_MAGIC]
    cut_off = None
    for chunk in _chunks(path):
        if not chunk.whole:
            cut_off = chunk.start
        elif chunk.tag in _OF_STREAM and chunk.stream == stream.number:
            _check_chunk(path, chunk, stream)
            kept.append(chunk.raw)
    return io.BytesIO(b"".join(kept)), cut_off


def load_stream(path: Path, stream: Stream) -> tuple[npt.NDArray[np.float64], Any, tuple[str, ...]]:
    """Time stamps (T,), values by sample and channel, and notes of a stream, read by pyxdf.

    Time is corrected by the stream's clock offsets where it has any, and not smoothed. Raises InputError
    where the stream has no samples, and as `whole_chunks_of`.
    """
    import pyxdf

    file, cut_off = whole_chunks_of(path, stream)
    try:
        with _quiet():
            streams, _ = pyxdf.load_xdf(file, dejitter_timestamps=False)
    except Exception as error:  # pyxdf raises whatever its code runs into
        why = f"{path}: stream {stream.name}: pyxdf cannot read it ({error}); copy the file again"
        raise InputError(why) from error
    time_s = np.asarray(streams[0]["time_stamps"], float)
    if not len(time_s):
        raise InputError(f"{path}: stream {stream.name}: has no samples")
    notes = []
    if cut_off is not None:
        notes.append(f"the file is cut off in the chunk at byte {cut_off}; what comes before it is read")
    return time_s, streams[0]["time_series"], tuple(notes)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep pyxdf from writing to stderr: what a reader must know is a sentence of its own."""
    logger = logging.getLogger("pyxdf.pyxdf")
    before = logger.disabled
    logger.disabled = True
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.disabled = before


def clock_offsets(path: Path, stream: Stream) -> npt.NDArray[np.float64]:
    """The stream's clock offsets, (N, 2): time on the stream's clock, and what is to be added to it, in s."""
    pairs = [
        struct.unpack("<dd", chunk.content)
        for chunk in _chunks(path)
        if chunk.whole and (chunk.tag, chunk.stream) == (_CLOCK_OFFSET, stream.number)
        if len(chunk.content) == 16
    ]
    return np.array(pairs, float).reshape(-1, 2)


def _chunks(path: Path) -> Iterator[Chunk]:
    """Give every chunk; the last one may be cut off."""
    data = _unpacked(path)
    if not data.startswith(_MAGIC):
        raise InputError(f"{path}: is no XDF file; it does not begin with {_MAGIC.decode()}")
    start = len(_MAGIC)
    while start < len(data):
        width = data[start]
        if width not in (1, 4, 8):
            raise _damaged(path, start, "no chunk starts there; copy it again")
        body = start + 1 + width
        end = body + int.from_bytes(data[start + 1 : body], "little")
        if body > len(data) or end > len(data):
            yield Chunk(start, 0, 0, b"", b"", whole=False)
            return
        tag = int.from_bytes(data[body : body + 2], "little")
        content = body + (6 if tag in _OF_STREAM else 2)
        if content > end or not _FILE_HEADER <= tag <= _STREAM_FOOTER:
            raise _damaged(path, start, "a chunk of no known kind; copy it again")
        number = int.from_bytes(data[body + 2 : content], "little")
        yield Chunk(start, tag, number, data[start:end], data[content:end], whole=True)
        start = end


def _unpacked(path: Path) -> bytes:
    with reading(path):
        data = read_whole(path, "a recording")
    if not data.startswith(b"\x1f\x8b"):
        return data
    most = MEMORY_PER_BYTE * len(data) + MEMORY_BYTES
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as packed:
            unpacked = packed.read(most + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be read ({error}); copy it again") from error
    if len(unpacked) > most:
        raise InputError(
            f"{path}: unpacks from {len(data) / 1e6:.1f} MB to more than {most / 1e6:.0f} MB; unpack it "
            "with gunzip to an .xdf file"
        )
    return unpacked


def _damaged(path: Path, start: int, what: str) -> InputError:
    return InputError(f"{path}: is damaged at byte {start}: {what}")


def described(where: str, content: bytes, number: int = 0) -> Stream:
    """Read a stream's description (XML). Raises InputError where it is none."""
    root = _xml(where, content)
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
    names = _text(root, "name"), _text(root, "type"), _text(root, "channel_format")
    return Stream(number, *names, int(counted), rate_hz, channels)


def _check_chunk(path: Path, chunk: Chunk, stream: Stream) -> None:
    what, good = "", True
    if chunk.tag == _SAMPLES:
        what = "a chunk of samples"
        good = _samples_fill(chunk.content, stream)
    elif chunk.tag == _CLOCK_OFFSET:
        what, good = "a clock offset", len(chunk.content) == 16
    elif chunk.tag == _STREAM_FOOTER:
        counted = _text(_xml(f"{path}: footer of stream {stream.number}", chunk.content), "sample_count")
        what, good = "a footer", counted.isdecimal() or not counted
    if not good:
        raise _damaged(path, chunk.start, f"{what} is not as long as it says")


def _samples_fill(content: bytes, stream: Stream) -> bool:
    """Tell whether the samples, each with 8 bytes of time stamp or none, end where the chunk does."""
    if not content or content[0] not in (1, 4, 8) or len(content) <= content[0]:
        return False
    at = 1 + content[0]
    for _ in range(int.from_bytes(content[1:at], "little")):
        if at >= len(content) or content[at] not in (0, 8):
            return False
        at += 1 + content[at]
        if stream.format != TEXT:
            at += stream.channel_count * SAMPLE_BYTES[stream.format]
            continue
        for _ in range(stream.channel_count):
            if at >= len(content) or content[at] not in (1, 4, 8):
                return False
            start = at + 1 + content[at]
            at = start + int.from_bytes(content[at + 1 : start], "little")
    return at == len(content)


def _xml(where: str, content: bytes) -> ElementTree.Element:
    if b"<!" in content.replace(b"<![CDATA[", b"").replace(b"<!--", b""):
        raise InputError(f"{where}: declares a document type, as no recorder does; record the file again")
    try:
        root = ElementTree.fromstring(content.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise InputError(f"{where}: is no UTF-8 text; copy the file again") from error
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{where}: is damaged ({error}); copy the file again") from error
    if root.tag != "info":
        raise InputError(f"{where}: holds {root.tag!r}; expected 'info'")
    return root


def _text(element: ElementTree.Element, tag: str) -> str:
    return (element.findtext(tag) or "").strip()
