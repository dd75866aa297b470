"""Arrays over a recording's frames that memory need not hold: in a file where they are long, block by block.

Such an array is mapped to a file that has no name, in the folder for temporary files (TMPDIR). Who goes
through it block by block gives the memory back with `release`.
"""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import IO, TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from schemas.errors import InputError

if TYPE_CHECKING:
    from stages.export.motion import SkeletonMotion

BLOCK_FRAMES = 4096
IN_MEMORY_BYTES = 16 << 20
"""An array that is longer goes to a file."""

Values = npt.NDArray[Any]


class Growing:
    """An array that grows along its first dimension until it is `finished`."""

    def __init__(self) -> None:
        self._parts: list[Values] = []
        self._bytes = 0
        self._file: IO[bytes] | None = None

    def append(self, part: Values) -> None:
        """Put (n, ...) more at the end, all of one type and shape; InputError where no room is left."""
        self._parts.append(part)
        self._bytes += part.nbytes
        if self._bytes <= IN_MEMORY_BYTES:
            return
        try:
            self._file = self._file or tempfile.TemporaryFile()  # noqa: SIM115
            for piece in self._parts:
                self._file.write(np.ascontiguousarray(piece).data)
        except OSError as error:
            raise InputError(
                f"{tempfile.gettempdir()}: cannot be written ({error.strerror}); "
                "say another folder for temporary files with TMPDIR"
            ) from error
        self._parts = [part[:0]]

    def finished(self) -> Values:
        """Give the array; at least one part must have come."""
        if self._file is None:
            return self._parts[0] if len(self._parts) == 1 else np.concatenate(self._parts)
        self._file.flush()
        kind, shape = self._parts[0].dtype, self._parts[0].shape
        mapped = mmap.mmap(self._file.fileno(), self._bytes)
        self._file.close()
        return np.frombuffer(mapped, kind).reshape(-1, *shape[1:])


def release(*arrays: Values) -> None:
    """Give back the memory of arrays that are mapped to files; they stay what they are."""
    for array in arrays:
        base: Any = array
        while isinstance(base, np.ndarray | memoryview):
            base = base.base if isinstance(base, np.ndarray) else base.obj
        if isinstance(base, mmap.mmap):
            base.madvise(mmap.MADV_DONTNEED)


def slices(count: int, size: int | None = None) -> Iterator[slice]:
    """Give the rows of each block in turn; none where there is no frame."""
    size = BLOCK_FRAMES if size is None else size
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))


def blocks(motion: SkeletonMotion) -> Iterator[SkeletonMotion]:
    """Give a motion block by block, in order; none where there is no frame."""
    for rows in slices(len(motion.frame)):
        yield motion.take(rows)
        release_motion(motion)


def changed(motion: SkeletonMotion, change: Callable[[SkeletonMotion], SkeletonMotion]) -> SkeletonMotion:
    """Apply to the blocks of a motion what changes each frame by itself, and the rest always in one way."""
    if len(motion.frame) <= BLOCK_FRAMES:
        return change(motion)
    grown = [Growing() for _ in range(5)]
    out = motion
    for block in blocks(motion):
        out = change(block)
        for one, part in zip(grown, _arrays(out), strict=True):
            one.append(part)
    position, turn, receiver_mm, receiver_turn, valid = (one.finished() for one in grown)
    return replace(
        out,
        frame=motion.frame,
        time_s=motion.time_s,
        position_mm=position,
        quaternion=turn,
        receivers=replace(out.receivers, position_mm=receiver_mm, quaternion=receiver_turn, valid=valid),
    )


def regrouped(parts: Iterable[Values], length: int) -> Iterator[Values]:
    """Put arrays together, or cut them, to that length along the first dimension; the last may be shorter."""
    held: list[Values] = []
    count = 0
    for part in parts:
        held.append(part)
        count += len(part)
        while count >= length:
            whole = np.concatenate(held)
            yield whole[:length]
            held, count = [whole[length:]], count - length
    if count:
        yield np.concatenate(held)


def _arrays(motion: SkeletonMotion) -> tuple[Values, ...]:
    there = motion.receivers
    return motion.position_mm, motion.quaternion, there.position_mm, there.quaternion, there.valid


def release_motion(motion: SkeletonMotion) -> None:
    """Give back the memory of a motion whose arrays are mapped to files."""
    release(*_arrays(motion))
