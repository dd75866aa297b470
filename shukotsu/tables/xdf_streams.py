"""Read the streams of an XDF file (XDF 1.0) with pyxdf.

With a damaged file pyxdf logs the damage and continues, and it completes a truncated sample with numbers that
were never recorded. The file object passed to it therefore raises an error at the end of the file, and a file
for which pyxdf logs an error is refused.
"""

from __future__ import annotations

import gzip
import io
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from shukotsu.arrays import Array
from shukotsu.errors import InputError
from shukotsu.tables.limits import MEMORY_BYTES, MEMORY_PER_BYTE, check_regular
from shukotsu.tables.text_files import reading

NUMBERS = ("double64", "float32", "int64", "int32", "int16", "int8")
TEXT = "string"
"""Channel formats of numbers and of text."""

POSITION = ("positionx", "positiony", "positionz")
QUATERNION = ("orientationa", "orientationb", "orientationc", "orientationd")
"""A is the scalar part; B, C and D are the components x, y and z."""

EULER = ("orientationp", "orientationh", "orientationr")


@dataclass(frozen=True)
class Stream:
    """Header of a stream; rate_hz : nominal rate, 0 if irregular."""

    number: int
    name: str
    type: str
    format: str
    channel_count: int
    rate_hz: float


@dataclass(frozen=True)
class StreamChannel:
    """Description of a channel in a stream's header; fields that the header lacks are ""."""

    index: int
    label: str
    owner: str
    type: str
    unit: str


@dataclass(frozen=True)
class StreamSamples:
    """The T samples of a stream.

    Attributes
    ----------
    channels : tuple of StreamChannel
        Channels in order.
    time_s : array, shape (T,)
        Times corrected by the clock offsets, if any; not smoothed.
    values : array or list
        By sample and channel.
    offsets : array, shape (N, 2)
        Time on the stream's clock and the correction to add to it, s.
    notes : tuple of str
        Remarks on the stream, such as a truncated file.

    """

    channels: tuple[StreamChannel, ...]
    time_s: Array
    values: Any
    offsets: Array
    notes: tuple[str, ...]


def owners(channels: tuple[StreamChannel, ...]) -> list[str]:
    """Return the markers and objects with a position or an orientation, in the order of the channels."""
    posed = (*POSITION, *QUATERNION, *EULER)
    return list(dict.fromkeys(c.owner for c in channels if c.type in posed and c.owner))


def pose_channels(where: str, channels: tuple[StreamChannel, ...], owner: str) -> list[StreamChannel]:
    """Return the channels x, y, z and A, B, C, D of a marker or object. Raises InputError if incomplete."""
    where = f"{where}, {owner}"
    by_owner = [channel for channel in channels if channel.owner == owner]
    types = [channel.type for channel in by_owner]
    if set(types) & set(EULER) and not set(types) & set(QUATERNION):
        raise InputError(
            f"{where}: has angles (OrientationP, H, R), whose order XDF does not define; record quaternions"
        )
    for kind in (*POSITION, *QUATERNION):
        if types.count(kind) != 1:
            spelled = kind.capitalize()[:-1] + kind[-1].upper()
            raise InputError(
                f"{where}: has {types.count(kind) or 'no'} channels of type {spelled}; expected one"
            )
    return [by_owner[types.index(kind)] for kind in (*POSITION, *QUATERNION)]


def read_streams(path: Path) -> list[Stream]:
    """Read the headers of all streams, in order. Raises InputError if the file is not XDF or is damaged."""
    import pyxdf

    with _open_file(path) as (file, _):
        infos = pyxdf.resolve_streams(file)
    if len({info["stream_id"] for info in infos}) < len(infos):
        raise InputError(f"{path}: is damaged: a stream begins again; copy it again")
    streams = []
    for info in infos:
        name, kind, form = ((info[key] or "").strip() for key in ("name", "type", "channel_format"))
        number, channel_count, rate_hz = info["stream_id"], info["channel_count"], info["nominal_srate"]
        streams.append(Stream(number, name, kind, form, channel_count, rate_hz))
    return streams


def load_stream(path: Path, stream: Stream) -> StreamSamples:
    """Read the samples of a stream. Raises InputError if it has none, or is damaged."""
    import pyxdf

    where = f"{path}: stream {stream.name}"
    with _open_file(path) as (file, damages):
        (loaded,), _ = pyxdf.load_xdf(file, select_streams=stream.number, dejitter_timestamps=False)
    if damages:
        raise InputError(f"{where}: is damaged ({damages[0]}); copy the file again")
    time_s, values, notes = np.asarray(loaded["time_stamps"], float), loaded["time_series"], []
    if "footer" not in loaded:
        notes.append("the file is cut off before the stream's end; it is read up to there")
        if stream.format == TEXT:  # the last text may be truncated
            time_s, values = time_s[:-1], values[:-1]
    if not len(time_s):
        raise InputError(f"{where}: has no samples")
    offsets = np.array([loaded["clock_times"], loaded["clock_values"]], float).T
    return StreamSamples(_channels(loaded["info"]), time_s, values, offsets, tuple(notes))


class _Complete(io.BufferedReader):
    """A file that raises EOFError if it ends within a requested range."""

    def readinto(self, buffer: Any) -> int:
        count = super().readinto(buffer)
        if count < len(buffer):
            raise EOFError("the file is cut off")
        return count


@contextmanager
def _open_file(path: Path) -> Iterator[tuple[_Complete, list[str]]]:
    """Open a file, gzipped or not, with a list of the errors that pyxdf logs before the end of the file."""
    damages: list[str] = []

    def note(record: logging.LogRecord) -> bool:
        if record.levelno >= logging.ERROR and file.peek(1):
            damages.append(record.getMessage())
        return False

    with reading(path):
        size = check_regular(path, "a recording")
        with path.open("rb") as stream:
            is_packed = stream.read(2) == b"\x1f\x8b"
        raw = gzip.GzipFile(path) if is_packed else io.FileIO(path)
    file = _Complete(cast(io.RawIOBase, raw))
    logger = logging.getLogger("pyxdf.pyxdf")
    logger.addFilter(note)
    try:
        most = MEMORY_PER_BYTE * size + MEMORY_BYTES
        if is_packed and raw.seek(most + 1) > most:
            raise InputError(
                f"{path}: unpacks from {size / 1e6:.1f} MB to more than {most / 1e6:.0f} MB; unpack it "
                "with gunzip to an .xdf file"
            )
        raw.seek(0)
        if file.peek(4)[:4] != b"XDF:":
            raise InputError(f"{path}: is not an XDF file; it does not begin with XDF:")
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield file, damages
    except (InputError, MemoryError):
        raise
    except Exception as error:  # pyxdf has no exception type of its own for damaged files
        raise InputError(f"{path}: is damaged: pyxdf cannot read it ({error}); copy it again") from error
    finally:
        logger.removeFilter(note)
        file.close()


def _channels(info: Any) -> tuple[StreamChannel, ...]:
    """Return the channels of a stream's header, in which pyxdf represents every element as a list."""
    described = info.get("desc", [None])[0] or {}
    listed = (described.get("channels", [None])[0] or {}).get("channel", [])
    channels = []
    for index, channel in enumerate(listed):
        owner = _text(channel, "marker") or _text(channel, "object")
        kind, unit = _text(channel, "type").lower(), _text(channel, "unit").lower()
        channels.append(StreamChannel(index, _text(channel, "label"), owner, kind, unit))
    return tuple(channels)


def _text(element: Any, tag: str) -> str:
    """Return the text of a header element, or "" if it is absent."""
    text = element.get(tag, [""])[0] if isinstance(element, dict) else ""
    return text.strip() if isinstance(text, str) else ""
