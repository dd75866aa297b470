"""Decode the poses of a growing archive piece by piece, each frame as soon as it is complete.

The pieces come from a recorded archive or from a recorder process, which stores every byte independently of
the coach.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from shukotsu.arrays import Array, Bools
from shukotsu.readers import jumps, segment_rows
from shukotsu.study.layout import Layout
from shukotsu.tables.poses import Poses, joined_poses
from shukotsu.tracker.archive import FollowedArchive, Piece, open_archive
from shukotsu.tracker.stream import PieceReader, Tally
from shukotsu.tracker.survey import SOURCE_FAILURES

MOST_FRAMES = 6000
"""Largest number of frames kept for estimates; of longer recordings every second, then every fourth frame is
kept. A fit selects its frames from 1500."""
LATE_FRAMES = 2
"""A frame is complete when a frame later by this number has begun."""
_RECORD = np.dtype([("frame", "i8"), ("segment", "i8"), ("numbers", "f8", 7)])
"""A record waiting for its frame to be complete; segment : index in the layout, -1 if it is not in it."""


class LivePoses:
    """Decoder of an archive's pieces, in order, into poses. where : name of the archive, for messages."""

    def __init__(self, layout: Layout, where: Path) -> None:
        self._layout = layout
        self._reader = PieceReader(where, Tally())
        self._segment = {layout.segments[name].receiver: index for index, name in enumerate(layout.measured)}
        self._first: int | None = None
        self._waiting = np.zeros(0, _RECORD)
        self._mirrored = np.ones(len(layout.measured))
        self._before = np.full((len(layout.measured), 3), np.nan)

    @property
    def ended(self) -> bool:
        """Whether the recorder closed the archive."""
        return self._reader.tally.summary is not None

    def add(self, piece: Piece) -> Poses | None:
        """Add a piece; return the frames that it completes, or None."""
        self._reader.add(piece)
        decoder = self._reader.decoder
        if decoder is None or not (decoder.waiting_bytes or self.ended):
            return None
        block = decoder.decode(final=self.ended)
        records = block.records.take(block.good)
        numbers = np.concatenate([records.position_mm, records.quaternion], -1)
        numbers[np.isin(records.error, list(SOURCE_FAILURES))] = np.nan
        rows = np.zeros(len(numbers), _RECORD)
        rows["frame"], rows["numbers"] = records.frame, numbers
        rows["segment"] = [self._segment.get(station, -1) for station in records.station.tolist()]
        self._waiting = np.concatenate([self._waiting, rows])
        return self._whole(block.settings.rate_hz)

    def _whole(self, rate_hz: float) -> Poses | None:
        last = int(self._waiting["frame"].max(initial=0))
        whole = self._waiting["frame"] <= (last if self.ended else last - LATE_FRAMES)
        ready, self._waiting = self._waiting[whole], self._waiting[~whole]
        if not len(ready):
            return None
        frame, row = np.unique(ready["frame"], return_inverse=True)
        numbers, worn = np.full((len(frame), len(self._layout.measured), 7), np.nan), ready["segment"] >= 0
        numbers[row[worn], ready["segment"][worn]] = ready["numbers"][worn]
        if self._first is None:
            self._first = int(frame[0])
        time_s = np.asarray((frame - self._first) / rate_hz, float)
        valid = np.isfinite(numbers).all(-1)
        norm = np.linalg.norm(numbers[..., 3:], axis=-1)
        valid &= np.abs(norm - 1) <= segment_rows.NORM_TOLERANCE
        numbers[..., 3:] /= np.where(valid, norm, 1.0)[..., None]
        for column in range(valid.shape[1]):
            rows = np.flatnonzero(valid[:, column])
            if len(rows):
                valid[rows, column] = self._on_one_side(numbers[rows, column, :3], column)
                rows = rows[valid[rows, column]]
                valid[rows[jumps.spikes(numbers[rows, column])], column] = False
        measured = self._layout.measured
        return Poses(measured, frame, time_s, numbers[..., :3], numbers[..., 3:], valid)

    def _on_one_side(self, at_mm: Array, column: int) -> Bools:
        """Return whether positions (N, 3) are on the side of the transmitter on which the receiver began."""
        before = np.concatenate([self._before[[column]], at_mm[:-1]])
        step, mirrored = np.linalg.norm(at_mm - before, axis=1), np.linalg.norm(at_mm + before, axis=1)
        flips = (step > MIRROR_STEP_MM) & (mirrored < MIRROR_SHARE * step)
        sign = self._mirrored[column] * np.cumprod(np.where(flips, -1.0, 1.0))
        self._mirrored[column], self._before[column] = sign[-1], at_mm[-1]
        return np.asarray(sign > 0)


MIRROR_STEP_MM, MIRROR_SHARE = 60.0, 0.3
"""Smallest step of a flip, and largest distance from the mirror image after it, as a share of the step."""


class EvenFrames:
    """Evenly spaced frames of a recording of any length.

    At most MOST_FRAMES are kept; when there are more, every second one is dropped.
    """

    def __init__(self) -> None:
        self._parts: list[Poses] = []
        self._stride, self._seen = 1, 0

    def add(self, poses: Poses) -> None:
        """Add frames, in order."""
        rows = np.arange(self._seen, self._seen + len(poses.frame)) % self._stride == 0
        self._seen += len(poses.frame)
        self._parts.append(poses.take(np.flatnonzero(rows)))
        while self._seen > MOST_FRAMES * self._stride:
            self._stride *= 2
            self._parts = [self.poses().take(slice(None, None, 2))]

    def poses(self) -> Poses:
        """Return the frames kept, in order."""
        self._parts = [joined_poses(self._parts)]
        return self._parts[0]


ENDS_WITHIN_S = 20.0


class Replayed:
    """The pieces of a recorded archive, replayed at the pace of the recording.

    speed : 2 for twice as fast, 0 for as fast as possible.
    """

    def __init__(self, path: Path, speed: float) -> None:
        self._pieces = open_archive(path).pieces()
        self._next: Piece | None = next(self._pieces, None)
        self._speed = speed
        self._first_ns: int | None = None
        self._began_s = time.perf_counter()

    @property
    def ended(self) -> bool:
        """Whether all pieces have been read."""
        return self._next is None

    def read(self) -> list[Piece]:
        """Return the next piece if its time has come, else nothing."""
        piece = self._next
        if piece is None:
            return []
        if self._speed and len(piece.host_ns):
            self._first_ns = int(piece.host_ns[0]) if self._first_ns is None else self._first_ns
            passed_s = (time.perf_counter() - self._began_s) * self._speed
            if (int(piece.host_ns[-1]) - self._first_ns) * 1e-9 > passed_s:
                return []
        self._next = next(self._pieces, None)
        return [piece]


class Recorder:
    """A recorder process, and the archive that it writes. notes : lines of the process's output."""

    def __init__(self, out: Path, options: Sequence[str]) -> None:
        self._archive = FollowedArchive(out)
        self.notes: list[str] = []
        self._process = subprocess.Popen(
            [sys.executable, "-m", "shukotsu", "record", *options, f"--out={out}", "--quiet"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,  # Ctrl-C reaches only the coach, which then stops the recorder
        )
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        self.notes.extend(line.rstrip() for line in self._process.stdout)

    @property
    def ended(self) -> bool:
        """Whether the recording has ended."""
        return self._archive.ended or self._process.poll() is not None

    def read(self) -> list[Piece]:
        """Return the pieces written since the last call."""
        return self._archive.read()

    def stop(self) -> int:
        """End the recording; return the recorder's exit code."""
        code = -1
        by_itself = [self._process.poll] if self._archive.ended else []
        for insist in (*by_itself, self._process.terminate, self._process.kill):
            insist()
            with suppress(subprocess.TimeoutExpired):
                code = self._process.wait(ENDS_WITHIN_S)
                break
        self._listener.join(ENDS_WITHIN_S)
        return code


Source = Replayed | Recorder | FollowedArchive
"""Source of an archive's pieces."""
