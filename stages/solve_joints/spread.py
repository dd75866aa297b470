"""A sample of frames of fixed size, spread over the joint's postures; the recording may be of any length.

The child's rotation, seen from the parent, falls into a cell of a cubic grid of rotation vectors; of each
cell a few frames are kept. A posture held for a minute then weighs no more than one passed in a moment,
and the extremes, which say most about the centre, are all there. Which frames of a cell are kept follows
from their numbers alone, and the cells are doubled in size whenever there are too many of them, so the
sample is the same however the recording is cut into blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array, conjugate, left_matrix
from stages.solve_joints.moments import BLOCK_FRAMES, RelativePoses

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


class SpreadSample:
    """The sample of one joint; add blocks of frames in the order of time, then read `frames`."""

    def __init__(self, n_other: int) -> None:
        self._to_reference: Array | None = None
        self._seen = 0
        self._doublings = 0
        self._cells: Integers = np.zeros(0, np.int64)
        self._counts: Integers = np.zeros(0, np.int64)
        self._last_lot: npt.NDArray[np.uint64] = np.zeros(0, np.uint64)
        self._frame: Integers = np.zeros(0, np.int64)
        self._frame_cell: Integers = np.zeros(0, np.int64)
        self._n_other = n_other
        self._values: Array = np.zeros((0, 7 + 4 * n_other))

    def add(self, poses: RelativePoses, joint: int, others: tuple[int, ...]) -> None:
        """Add a block of the joint's frames; others : joints whose rotation is kept along."""
        valid = poses.valid(joint)
        for start in range(0, poses.n_frames, BLOCK_FRAMES):
            rows = start + np.flatnonzero(valid[start : start + BLOCK_FRAMES])
            if len(rows):
                self._add_rows(poses, joint, others, rows)
        self._seen += poses.n_frames

    def _add_rows(self, poses: RelativePoses, joint: int, others: tuple[int, ...], rows: Integers) -> None:
        quaternion = poses.of(joint, slice(rows[0], rows[-1] + 1)).quaternion(0)
        if len(rows) < quaternion.shape[1]:
            quaternion = quaternion[:, rows - rows[0]]
        if self._to_reference is None:
            self._to_reference = conjugate(quaternion[:, 0])
        cell = _cells(left_matrix(self._to_reference) @ quaternion, self._doublings)
        new = self._count(cell, self._seen + rows)
        if not len(new):
            return
        before = len(self._frame)
        self._frame = np.concatenate([self._frame, self._seen + rows[new]])
        self._frame_cell = np.concatenate([self._frame_cell, cell[new]])
        kept = self._thin()
        old, new = kept[kept < before], rows[new[kept[kept >= before] - before]]
        values = np.empty((len(kept), self._values.shape[1]))
        values[kept < before] = self._values[old]
        values[kept >= before] = _values(poses, joint, others, new)
        self._values = values

    def frames(self) -> SpreadFrames:
        """Give the frames kept."""
        order = np.argsort(self._frame)
        values = self._values[order]
        count = self._counts[np.searchsorted(self._cells, self._frame_cell[order])]
        other = values[:, 7:].reshape(len(values), self._n_other, 4)
        return SpreadFrames(values[:, :4], values[:, 4:7], other, count == 1)

    def _count(self, cell: Integers, frame: Integers) -> Integers:
        """Count frames into their cells; give those (M,) that are not behind all that their cell keeps."""
        known, wanted = np.zeros(len(cell), bool), np.ones(len(cell), bool)
        if len(self._cells):
            place = np.minimum(np.searchsorted(self._cells, cell), len(self._cells) - 1)
            known = self._cells[place] == cell
            wanted = ~known | (_lots(frame) < self._last_lot[place])
            self._counts += np.bincount(place[known], minlength=len(self._cells))
        strange, counts = np.unique(cell[~known], return_counts=True)
        self._cells = np.concatenate([self._cells, strange])
        self._counts = np.concatenate([self._counts, counts])
        return np.flatnonzero(wanted)

    def _thin(self) -> Integers:
        """Double the cells until there are few enough; give the few frames (M,) of each that stay."""
        self._sort_cells()
        before = self._doublings
        while len(self._cells) > MAX_CELLS:
            self._doublings += 1
            self._cells = _packed(_unpacked(self._cells) >> 1)
            self._sort_cells()
        if self._doublings > before:
            self._frame_cell = _packed(_unpacked(self._frame_cell) >> (self._doublings - before))
        place, lot = np.searchsorted(self._cells, self._frame_cell), _lots(self._frame)
        by_lot = np.argsort(lot)
        order = by_lot[np.argsort(place[by_lot].astype(np.uint16), kind="stable")]  # sorted by counting
        start = np.searchsorted(place[order], np.arange(len(self._cells)))
        rank = np.arange(len(order)) - start[place[order]]
        kept, last = order[rank < FRAMES_PER_CELL], order[rank == FRAMES_PER_CELL - 1]
        self._last_lot = np.full(len(self._cells), np.iinfo(np.uint64).max)
        self._last_lot[place[last]] = lot[last]
        self._frame, self._frame_cell = self._frame[kept], self._frame_cell[kept]
        return kept

    def _sort_cells(self) -> None:
        cells, group = np.unique(self._cells, return_inverse=True)
        self._counts = np.bincount(group, self._counts).astype(np.int64)
        self._cells = cells


def _values(poses: RelativePoses, joint: int, others: tuple[int, ...], rows: Integers) -> Array:
    """Quaternion, position, and quaternions of the others, NaN where unknown: (N, 7 + 4 K) of some frames."""
    own = poses.of(joint, rows)
    values = np.full((len(rows), 7 + 4 * len(others)), np.nan)
    values[:, :4], values[:, 4:7] = own.quaternion(0).T, own.position_mm(0).T
    for place, other in enumerate(others):
        known = np.flatnonzero(poses.valid(other)[rows])
        if len(known):
            turn = poses.of(other, rows[known]).quaternion(0)
            values[known, 7 + 4 * place : 11 + 4 * place] = turn.T
    return values


def _lots(frame: Integers) -> npt.NDArray[np.uint64]:
    """Which of a cell's frames are kept: those with the lowest of these numbers (N,)."""
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


def _packed(cell: Integers) -> Integers:
    """One number for the three of a cell (N, 3), each within 16 bits."""
    a, b, c = (cell + _HALF).T
    return np.asarray((a << 32) | (b << 16) | c)


def _unpacked(cell: Integers) -> Integers:
    return np.asarray(np.stack([cell >> 32, (cell >> 16) & 0xFFFF, cell & 0xFFFF], -1) - _HALF)
