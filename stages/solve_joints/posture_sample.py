"""A sample of frames of fixed size, spread over the joint's postures; the recording may be of any length.

The child's rotation, seen from the parent, falls into a cell of a cubic grid of rotation vectors; of each
cell a few frames are kept. A posture held for a minute then weighs no more than one passed in a moment,
and the extremes, which say most about the centre, are all there. Which frames of a cell are kept follows
from their numbers alone, and the cells are doubled in size whenever there are too many of them, so the
sample is the same however the recording is cut into blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.skeleton.rotations import Array, conjugate, left_matrix
from shukotsu.stages.solve_joints.moments import RelativePoses

MAX_CELLS = 256
"""Postures told apart: a finger's joint through its range has some 30 along its axis and a few across."""

FRAMES_PER_CELL = 4
FIRST_CELL_RAD = np.radians(0.5)
"""Size of a cell before any doubling: about what a tracker's noise turns a receiver."""

_HALF = 1 << 15
_OFFSET = 1024 / 3  # a third or two into a cell of any size, so that no rounding moves the first frame
_SPREADING = np.uint64(
    0x9E3779B97F4A7C15
)  # 2^64 over the golden ratio (Knuth): the frames' lots are spread evenly

Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class SpreadFrames:
    """Frames of one joint, in the order of time.

    quaternion : (N, 4) child to parent frame; position_mm : (N, 3) child origin in the parent's frame.
    other : (N, K, 4) rotations of K other joints in the same frames, NaN where unknown. lone : (N,) whether
    the frame's posture was met in no other frame, as happens to readings that are wrong.
    """

    quaternion: Array
    position_mm: Array
    other: Array
    lone: npt.NDArray[np.bool_]

    def take(self, rows: npt.NDArray[np.bool_]) -> SpreadFrames:
        """Only some of the frames."""
        return SpreadFrames(self.quaternion[rows], self.position_mm[rows], self.other[rows], self.lone[rows])


class SpreadSample:
    """The sample of one joint; add blocks of frames in the order of time, then read `frames`."""

    def __init__(self, n_other: int) -> None:
        self._to_reference: Array | None = None
        self._seen = 0
        self._doublings = 0
        self._cells: Integers = np.zeros(0, np.int64)
        self._counts: Integers = np.zeros(0, np.int64)
        self._frame: Integers = np.zeros(0, np.int64)
        self._frame_cell: Integers = np.zeros(0, np.int64)
        self._last_lot: npt.NDArray[np.uint64] = np.zeros(0, np.uint64)
        self._n_other = n_other
        self._values: Array = np.zeros((0, 7 + 4 * n_other))

    def add(self, poses: RelativePoses, joint: int, others: Sequence[int]) -> None:
        """Add a block of the joint's frames; others : joints whose rotation is kept along."""
        rows = np.flatnonzero(poses.valid[:, joint])
        if len(rows):
            self._add_rows(poses, joint, others, rows)
        self._seen += len(poses.valid)

    def _add_rows(self, poses: RelativePoses, joint: int, others: Sequence[int], rows: Integers) -> None:
        turn = poses.quaternion[rows, joint].T
        if self._to_reference is None:
            self._to_reference = conjugate(turn[:, 0])
        cell, frame = _cells(left_matrix(self._to_reference) @ turn, self._doublings), self._seen + rows
        wanted = np.flatnonzero(self._count(cell, _lots(frame)))
        cell, frame = (
            np.concatenate(pair) for pair in ((self._frame_cell, cell[wanted]), (self._frame, frame[wanted]))
        )
        n_old = len(self._frame)
        doublings = self._double()
        if doublings:
            cell = _packed(_unpacked(cell) >> doublings)
        kept = self._few_of_each(cell, frame)
        values = _values(poses, joint, others, rows[wanted[kept[kept >= n_old] - n_old]])
        self._values = np.concatenate([self._values[kept[kept < n_old]], values])
        self._frame, self._frame_cell = frame[kept], cell[kept]

    def _count(self, cell: Integers, lots: npt.NDArray[np.uint64]) -> npt.NDArray[np.bool_]:
        """Count frames into their cells; give which (N,) are not behind all that their cell keeps."""
        known, wanted = np.zeros(len(cell), bool), np.ones(len(cell), bool)
        if len(self._cells):
            place = np.minimum(np.searchsorted(self._cells, cell), len(self._cells) - 1)
            known = self._cells[place] == cell
            wanted = ~known | (lots < self._last_lot[place])
            self._counts += np.bincount(place[known], minlength=len(self._cells))
        if not known.all():
            strange = cell[~known]
            self._merge(
                np.concatenate([self._cells, strange]), np.append(self._counts, np.ones_like(strange))
            )
        return wanted

    def _merge(self, cells: Integers, counts: Integers) -> None:
        """Keep different cells, sorted, and the sums of their counts."""
        self._cells, group = np.unique(cells, return_inverse=True)
        self._counts = np.bincount(group, counts).astype(np.int64)

    def _double(self) -> int:
        """Double the cells until they are few enough; give how often."""
        before = self._doublings
        while len(self._cells) > MAX_CELLS:
            self._doublings += 1
            self._merge(_packed(_unpacked(self._cells) >> 1), self._counts)
        return self._doublings - before

    def _few_of_each(self, cell: Integers, frame: Integers) -> Integers:
        """Indices (M,), ascending, of the few frames of each cell that are kept: those of the lowest lots."""
        place, lot = np.searchsorted(self._cells, cell), _lots(frame)
        order = np.lexsort((lot, place))
        rank = (
            np.arange(len(order)) - np.searchsorted(place[order], np.arange(len(self._cells)))[place[order]]
        )
        last = order[rank == FRAMES_PER_CELL - 1]
        self._last_lot = np.full(len(self._cells), np.iinfo(np.uint64).max)
        self._last_lot[place[last]] = lot[last]
        return np.sort(order[rank < FRAMES_PER_CELL])

    def frames(self) -> SpreadFrames:
        """Give the frames kept."""
        count = self._counts[np.searchsorted(self._cells, self._frame_cell)]
        other = self._values[:, 7:].reshape(len(self._values), self._n_other, 4)
        return SpreadFrames(self._values[:, :4], self._values[:, 4:7], other, count == 1)


def _values(poses: RelativePoses, joint: int, others: Sequence[int], rows: Integers) -> Array:
    """Quaternion, position, and quaternions of the others, NaN where unknown: (N, 7 + 4 K) of some frames."""
    turns = [
        np.where(poses.valid[rows, other, None], poses.quaternion[rows, other], np.nan) for other in others
    ]
    return np.concatenate([poses.quaternion[rows, joint], poses.position_mm[rows, joint], *turns], -1)


def _lots(frame: Integers) -> npt.NDArray[np.uint64]:
    """Say which of a cell's frames are kept: those with the lowest of these numbers (N,)."""
    return np.asarray(frame.astype(np.uint64) * _SPREADING)


def rotation_vector(quaternion: Array) -> Array:
    """Rotation vectors (..., 3) in rad, no longer than pi, of unit quaternions (..., 4)."""
    factor = _vector_factor(quaternion[..., 0], np.linalg.norm(quaternion[..., 1:], axis=-1))
    return np.asarray(quaternion[..., 1:] * factor[..., None])


def _vector_factor(cosine: Array, sine: Array) -> Array:
    """Rotation vector over the vector part of a quaternion, whose w and length of (x, y, z) these are."""
    turn = np.copysign(2.0 * np.arctan2(sine, np.abs(cosine)), cosine + 0.0)
    return np.asarray(np.where(sine > 1e-12, turn / np.maximum(sine, 1e-12), np.copysign(2.0, cosine + 0.0)))


def _cells(turn: Array, doublings: int) -> Integers:
    """Cells (N,) of rotations from the first frame, quaternions (4, N)."""
    x, y, z = turn[1:]
    factor = _vector_factor(turn[0], np.sqrt(x * x + y * y + z * z))
    fine = turn[1:] * factor
    fine /= FIRST_CELL_RAD
    fine += _OFFSET
    cell = np.floor(fine, out=fine).astype(np.int64)
    cell >>= doublings
    return _packed(cell.T)


def _unpacked(cell: Integers) -> Integers:
    """The three numbers (N, 3) of cells."""
    return np.asarray(np.stack([cell >> 32, (cell >> 16) & 0xFFFF, cell & 0xFFFF], -1) - _HALF)


def _packed(cell: Integers) -> Integers:
    """One number for the three of a cell (N, 3), each within 16 bits."""
    a, b, c = (cell + _HALF).T
    return np.asarray((a << 32) | (b << 16) | c)
