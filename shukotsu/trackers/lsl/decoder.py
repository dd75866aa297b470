"""Samples of an LSL stream as records: a record an object whose seven numbers are all there.

What passes is kept in frames that can be read alone: MARK, CRC-32 of the next four bytes (its lower half),
kind and length of the body (u32, kind above bit 24), CRC-32 of the body, the body. All is little-endian.
"""

from __future__ import annotations

import struct
import zlib
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.files.xdf_streams import SAMPLE_BYTES
from shukotsu.trackers.protocols.piecewise import PiecewiseDecoder, gaps
from shukotsu.trackers.protocols.pose_numbers import doubtful_poses
from shukotsu.trackers.protocols.records import Bytes, Decoded, Records, Reply, empty_records
from shukotsu.trackers.protocols.stream_settings import StreamSettings

MARK = b"LS"
DESCRIPTION, SAMPLES, OFFSET = 1, 2, 3
"""Kinds: the stream's description (XML); the number (u32) of the first of some samples, then of each its
stamp (float64, s) and its channels; a clock offset, two float64 [s]: the sender's time, what to add to it."""

HEADER, FIRST, CLOCK = struct.Struct("<2sHII"), struct.Struct("<I"), struct.Struct("<dd")
MOST_BODY_BYTES = 1 << 18
LATEST_S = 9e9
"""No clock shows more: seconds since 1970 in the year 2255."""


class Frame(NamedTuple):
    """Hold one frame: its first byte in what was searched, the first byte after, and its body."""

    start: int
    end: int
    kind: int
    body: bytes


def framed(kind: int, body: bytes) -> bytes:
    """Give the frame of a body."""
    word = kind << 24 | len(body)
    return HEADER.pack(MARK, zlib.crc32(FIRST.pack(word)) & 0xFFFF, word, zlib.crc32(body)) + body


def frames_in(data: bytes, *, final: bool = True) -> tuple[list[Frame], int]:
    """Give the sound frames, and how many bytes are decided; `final` says that nothing follows."""
    frames: list[Frame] = []
    place = data.find(MARK)
    while place >= 0 and place + HEADER.size <= len(data):
        _, check, word, crc = HEADER.unpack_from(data, place)
        body, size = place + HEADER.size, word & 0xFFFFFF
        end, sound = body + size, zlib.crc32(data[place + 4 : place + 8]) & 0xFFFF == check
        if sound and end > len(data) and size <= MOST_BODY_BYTES and not final:
            return frames, place
        if sound and end <= len(data) and zlib.crc32(data[body:end]) == crc:
            frames.append(Frame(place, end, word >> 24, data[body:end]))
        place = data.find(MARK, frames[-1].end if frames and frames[-1].start == place else place + 1)
    if place < 0 or final:
        place = len(data) - (data.endswith(MARK[:1]) and not final)
    return frames, place


def sample_type(number_format: str, channel_count: int) -> np.dtype[Any]:
    """Give the bytes of a sample: its stamp and its channels. Raises KeyError where these are no numbers."""
    number = f"<{'i' if number_format.startswith('int') else 'f'}{SAMPLE_BYTES[number_format]}"
    return np.dtype([("stamp", "<f8"), ("values", number, (channel_count,))])


class LslDecoder(PiecewiseDecoder):
    """Decoder of an LSL stream.

    Of settings.options: `format` and `channel_count` of the samples, and `channels`, station -> its channels
    of x, y, z, w, x, y, z. Each record of a frame has a byte of it and the last one the rest; a frame
    without a pose is a reply. Stamps are corrected by the newest clock offset.
    """

    def __init__(self, settings: StreamSettings) -> None:
        super().__init__()
        self._offset_s = 0.0
        options, known = settings.options, False
        self._stations, self._mm = np.array(settings.stations), settings.mm_per_unit
        try:
            self._channels = np.array([options["channels"][str(s)] for s in settings.stations], np.int64)
            self._sample = sample_type(options["format"], int(options["channel_count"]))
            used = self._channels.ravel().tolist()
            known = self._channels.shape[1:] == (7,) and len(set(used)) == len(used)
            known = known and min(used) >= 0 and max(used) < int(options["channel_count"])
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
            pass
        if not known:
            raise InputError("settings of the tracker: do not say where a stream's poses are; copy it again")

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        frames, decided = frames_in(b.tobytes(), final=final)
        size = self._sample.itemsize
        samples, offset_s = [], []
        for frame in frames:
            if frame.kind == SAMPLES and len(frame.body) % size == FIRST.size < len(frame.body):
                samples.append(frame)
                offset_s.append(self._offset_s)
            elif frame.kind == OFFSET and len(frame.body) == CLOCK.size:
                self._offset_s = CLOCK.unpack(frame.body)[1]
        records, of_frame = self._records(samples, offset_s)
        held = {samples[index].start for index in set(of_frame.tolist())}
        replies = tuple(Reply(f.start, 0, f.kind, 0, f.body) for f in frames if f.start not in held)
        edges = np.array([frame[:2] for frame in frames], np.int64).reshape(-1, 2)
        return Decoded(records, gaps(edges[:, 0], edges[:, 1], decided), replies), decided

    def _records(self, frames: list[Frame], offset_s: list[float]) -> tuple[Records, npt.NDArray[np.int64]]:
        """Read frames of samples; give the records, and in which frame each is."""
        counts = np.array([len(frame.body) // self._sample.itemsize for frame in frames], np.int64)
        samples = np.frombuffer(b"".join(frame.body[FIRST.size :] for frame in frames), self._sample)
        poses = samples["values"][:, self._channels].astype(float)
        row, column = np.nonzero(~np.isnan(poses).any(-1))
        of_frame = np.repeat(np.arange(len(frames)), counts)
        first = np.array([FIRST.unpack_from(frame.body)[0] for frame in frames], np.int64)[of_frame]
        cycle = (first + np.arange(len(first)) - np.searchsorted(of_frame, of_frame))[row]
        of_frame = of_frame[row]
        start, end = np.array([frame[:2] for frame in frames], np.int64).reshape(-1, 2)[of_frame].T
        records = empty_records(len(row))
        place = start + np.arange(len(row)) - np.searchsorted(of_frame, of_frame)
        is_last = np.diff(of_frame, append=-1) != 0
        records.offset[:], records.size[:] = place, np.where(is_last, end - place, 1)
        records.station[:] = self._stations[column]
        records.cycle[:] = cycle
        stamp = samples["stamp"][row] + np.array(offset_s)[of_frame]
        with np.errstate(over="ignore", invalid="ignore"):
            records.position_mm[:] = poses[row, column, :3] * self._mm
            records.quaternion[:] = poses[row, column, 3:]
            dated = (stamp >= 0) & (stamp < LATEST_S)
            records.stamp_ns[dated] = np.rint(stamp[dated] * 1e9).astype(np.int64)
            finite = np.isfinite(records.position_mm).all(-1)
            records.doubtful[:] = doubtful_poses(records, position=False) | ~finite | ~dated
        return records, of_frame
