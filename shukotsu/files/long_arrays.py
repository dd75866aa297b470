"""Arrays over the frames of a recording: in memory where they are small, in a temporary file where not.

The positions and rotations of a hand in an hour are some gigabytes, made several times on their way into a
file. So they are made and read by points (`[:, index]`) or by some frames (`[rows]`), and what is large is
held on the disk between.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from tempfile import TemporaryFile
from typing import Any, cast

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

KEPT_BYTES = 100 * 10**6
"""Of all arrays that are in memory; the next is on the disk."""

BLOCK_FRAMES = 4096
"""Frames that a file is written of at a time."""

_kept = 0


class OnDisk:
    """An array (T, N, n) in a temporary file, point after point; it ends with the object."""

    def __init__(self, shape: tuple[int, int, int]) -> None:
        self.shape = shape
        self._file = TemporaryFile()  # noqa: SIM115 - open for as long as the array is
        self._file.truncate(8 * int(np.prod(shape)))

    def _mapped(self) -> npt.NDArray[np.float64]:
        """The file as an array, for one access: pages that stay mapped count as memory of the program."""
        frames, points, width = self.shape
        mapped = np.memmap(self._file, np.float64, "r+", shape=(points, frames, width))
        return mapped.transpose(1, 0, 2)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any) -> Array:
        if isinstance(key, tuple):
            return np.array(self._mapped()[key])
        return np.stack(
            [self[key, point] for point in range(self.shape[1])], -2
        )  # what is near is mapped too

    def __setitem__(self, key: Any, values: Any) -> None:
        self._mapped()[key] = values

    def copy(self) -> OnDisk:
        """Another one with the same numbers."""
        return cast(OnDisk, by_point(lambda values: values, cast(Array, self)))


def empty(frames: int, points: int, width: int) -> Array:
    """An array (frames, points, width) to be filled; where it is `OnDisk`, an index is all that it takes."""
    size = 8 * frames * points * width
    if size and _kept + size > KEPT_BYTES:  # a file without a byte cannot be mapped
        return cast(Array, OnDisk((frames, points, width)))
    array = np.empty((frames, points, width))
    _count(size)
    weakref.finalize(array, _count, -size)
    return array


def _count(more: int) -> None:
    global _kept
    _kept += more


def by_point(function: Callable[..., Array], *arrays: Array) -> Array:
    """Apply a function to the series (T, n) of every point, of arrays (T, N, n): (T', N, n')."""
    frames, points, width = arrays[0].shape
    if not points:
        return np.empty((len(function(*(np.ones((frames, width)) for _ in arrays))), 0, width))
    out = arrays[0]
    for index in range(points):
        series = function(*(array[:, index] for array in arrays))
        if not index:
            out = empty(len(series), points, series.shape[-1])
        out[:, index] = series
    return out


def chosen_points(array: Array, indices: Sequence[int]) -> Array:
    """Only some of the points, in that order."""
    out = empty(len(array), len(indices), array.shape[-1])
    for place, index in enumerate(indices):
        out[:, place] = array[:, index]
    return out


def chosen_rows(array: Array, rows: slice | npt.NDArray[Any]) -> Array:
    """Only some of the frames: a range, their indices, or a truth value a frame."""
    index = np.arange(len(array))[rows]
    if len(index) <= BLOCK_FRAMES or not array.shape[1]:
        return array[rows]
    return by_point(lambda series: series[index], array)
