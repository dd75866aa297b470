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

from kinematics.rotations import Array, conjugate, multiply
from stages.solve_joints.moments import RelativePoses

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
        self._frame: Integers = np.zeros(0, np.int64)
        self._frame_cell: Integers = np.zeros(0, np.int64)
        self._n_other = n_other
        self._values: Array = np.zeros((0, 7 + 4 * n_other))

    def add(self, poses: RelativePoses, joint: int, others: tuple[int, ...]) -> None:
        """Add a block of the joint's frames; others : joints whose rotation is kept along."""
        rows = np.flatnonzero(poses.valid[:, joint])
        frame = self._seen + rows
        self._seen += len(poses.valid)
        if not len(rows):
            return
        quaternion = poses.quaternion[rows, joint]
        if self._to_reference is None:
            self._to_reference = conjugate(quaternion[0])
        beside = [
            np.where(poses.valid[rows, other, None], poses.quaternion[rows, other], np.nan)
            for other in others
        ]
        fine = rotation_vector(multiply(self._to_reference, quaternion)) / FIRST_CELL_RAD + _OFFSET
        cell = _packed(np.floor(fine).astype(np.int64) >> self._doublings)
        self._cells = np.concatenate([self._cells, cell])
        self._counts = np.concatenate([self._counts, np.ones(len(cell), np.int64)])
        self._frame = np.concatenate([self._frame, frame])
        self._frame_cell = np.concatenate([self._frame_cell, cell])
        self._values = np.concatenate(
            [self._values, np.concatenate([quaternion, poses.position_mm[rows, joint], *beside], 1)]
        )
        self._thin()

    def frames(self) -> SpreadFrames:
        """Give the frames kept."""
        order = np.argsort(self._frame)
        values = self._values[order]
        count = self._counts[np.searchsorted(self._cells, self._frame_cell[order])]
        other = values[:, 7:].reshape(len(values), self._n_other, 4)
        return SpreadFrames(values[:, :4], values[:, 4:7], other, count == 1)

    def _thin(self) -> None:
        """Double the cells until there are few enough; keep a few frames of each."""
        self._count_cells()
        while len(self._cells) > MAX_CELLS:
            self._doublings += 1
            self._cells = _packed(_unpacked(self._cells) >> 1)
            self._frame_cell = _packed(_unpacked(self._frame_cell) >> 1)
            self._count_cells()
        lot = self._frame.astype(np.uint64) * _SPREADING
        order = np.lexsort((lot, self._frame_cell))
        cell = self._frame_cell[order]
        start = np.flatnonzero(np.concatenate([[True], cell[1:] != cell[:-1]]))
        rank = np.arange(len(cell)) - np.repeat(start, np.diff([*start, len(cell)]))
        kept = order[rank < FRAMES_PER_CELL]
        self._frame, self._frame_cell, self._values = (
            self._frame[kept],
            self._frame_cell[kept],
            self._values[kept],
        )

    def _count_cells(self) -> None:
        cells, group = np.unique(self._cells, return_inverse=True)
        self._counts = np.bincount(group, self._counts).astype(np.int64)
        self._cells = cells


def rotation_vector(quaternion: Array) -> Array:
    """Rotation vectors (..., 3) in rad, no longer than pi, of unit quaternions (..., 4)."""
    sine = np.linalg.norm(quaternion[..., 1:], axis=-1)
    shortest = np.where(quaternion[..., 0] < 0, -1.0, 1.0)
    turn = 2.0 * np.arctan2(sine, np.abs(quaternion[..., 0]))
    factor = np.where(sine > 1e-12, shortest * turn / np.maximum(sine, 1e-12), 2.0 * shortest)
    return np.asarray(quaternion[..., 1:] * factor[..., None])


def _packed(cell: Integers) -> Integers:
    """One number for the three of a cell (N, 3), each within 16 bits."""
    a, b, c = (cell + _HALF).T
    return np.asarray((a << 32) | (b << 16) | c)


def _unpacked(cell: Integers) -> Integers:
    return np.asarray(np.stack([cell >> 32, (cell >> 16) & 0xFFFF, cell & 0xFFFF], -1) - _HALF)
