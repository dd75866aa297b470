"""A hand's recordings, gone through a block of frames at a time and as often as a stage has to.

Short ones are read once and kept; a recording of hours is read again on every pass, only the receivers that
the pass needs, so that memory does not grow with its length.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from kinematics.long_sample import LongSample
from schemas.catalogue import POSES
from schemas.poses import Poses, pose_blocks, read_poses
from schemas.tables import open_table

BLOCK_FRAMES = 1 << 14
_KEPT_RECEIVERS = 16
"""Recordings are kept where they have no more rows than a block of so many receivers."""


class Recordings:
    """Poses of one hand's recordings, in order; iterating gives blocks of frames with all segments.

    Raises InputError where a file is no poses table.
    """

    def __init__(
        self, paths: Sequence[Path], segments: Sequence[str], block_frames: int = BLOCK_FRAMES
    ) -> None:
        self.segments = tuple(segments)
        self._paths, self._block_frames = tuple(paths), block_frames
        short = sum(_n_rows(path) for path in paths) <= _KEPT_RECEIVERS * block_frames
        self._kept = [read_poses(path, self.segments) for path in paths] if short else None
        self._times: dict[Path, LongSample] = {}
        self._first = {} if short else {path: _first_of(path, self.segments) for path in paths}

    def __iter__(self) -> Iterator[Poses]:
        return self.blocks(*self.segments)

    def blocks(self, *segments: str) -> Iterator[Poses]:
        """Blocks of frames with the poses of those segments at least.

        time_s is that of all segments, of which some may lack it in a frame, once `n_frames` was asked for.
        Raises InputError where segments do not share their frames, or a file is damaged.
        """
        if self._kept is not None:
            yield from self._kept
            return
        for path in self._paths:
            times = self._times[path].pieces(self._block_frames) if path in self._times else iter(())
            for poses in self._read(path, segments):
                yield replace(poses, time_s=next(times, poses.time_s))

    def n_frames(self) -> int:
        """Count the frames, of every segment."""
        if self._kept is not None:
            return sum(len(poses.frame) for poses in self._kept)
        for path in self._paths:
            if path not in self._times:
                self._times[path] = self._all_times(path)
        return sum(map(len, self._times.values()))

    def every(self, step: int) -> Poses:
        """Give every so many frames, from the first on, of all segments."""
        found = [self._every(step, segment) for segment in self.segments]
        return replace(
            found[0],
            segments=self.segments,
            position_mm=np.concatenate([poses.position_mm for poses in found], 1),
            quaternion=np.concatenate([poses.quaternion for poses in found], 1),
            valid=np.concatenate([poses.valid for poses in found], 1),
        )

    def _every(self, step: int, segment: str) -> Poses:
        start, parts = 0, []
        for poses in self.blocks(segment):
            at, rows = [poses.index(segment)], np.arange(-start % step, len(poses.frame), step)
            some = poses.take(rows)
            numbers = (some.position_mm[:, at], some.quaternion[:, at], some.valid[:, at])
            parts.append((some.frame, some.time_s, *numbers))
            start += len(poses.frame)
        return Poses((segment,), *(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def _all_times(self, path: Path) -> LongSample:
        """Time of every frame, of the first segment that has one; the segments one after another."""
        times = LongSample()
        for segment in self.segments:
            found, known = LongSample(), times.pieces(self._block_frames)
            for poses in self._read(path, [segment]):
                time_s = next(known, poses.time_s)
                found.add(np.where(np.isnan(time_s), poses.time_s, time_s))
            times = found
        return times

    def _read(self, path: Path, segments: Sequence[str]) -> Iterator[Poses]:
        wanted = [name for name in self.segments if name in segments or name == self._first[path]]
        for poses in pose_blocks(path, wanted, self._block_frames):
            yield poses
            pa.default_memory_pool().release_unused()  # row groups come and go; freed, they would add up


def blocks_with(recordings: Iterable[Poses], *segments: str) -> Iterable[Poses]:
    """Blocks of recordings of which only those segments are needed; of poses in memory, as they are."""
    return recordings.blocks(*segments) if isinstance(recordings, Recordings) else recordings


def _first_of(path: Path, segments: Sequence[str]) -> str | None:
    """The first segment of which the file has a frame; read along, it says how many frames there are."""
    for segment in segments:
        if len(next(pose_blocks(path, (segment,), 1)).frame):
            return segment
    return None


def _n_rows(path: Path) -> int:
    with open_table(path, POSES) as file:
        return int(file.metadata.num_rows)
