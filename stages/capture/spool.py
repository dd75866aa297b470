"""Columns that wait their turn: in memory while they are few, in a file that has no name when they are many.

A recording comes frame by frame and leaves segment by segment, so all of it must be kept in between.
"""

from __future__ import annotations

import tempfile
from collections.abc import Hashable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from schemas.errors import InputError

MEMORY_BYTES = 16 << 20
"""How much is kept in memory before the rest goes to a file."""

Columns = tuple[npt.NDArray[Any], ...]


@dataclass(frozen=True)
class _Written:
    """Columns in a file: where each begins, its type and its shape."""

    places: tuple[tuple[int, np.dtype[Any], tuple[int, ...]], ...]


@dataclass
class _Queue:
    """What was added under one key, in order, and the file of those that are not in memory."""

    chunks: list[Columns | _Written] = field(default_factory=list)
    file: IO[bytes] | None = None


class Spool:
    """Queues of chunks, each some columns; a context manager that gives its files back to the disk.

    folder : where files are made; they are unlinked at once, so that none is left behind whatever happens.
    """

    def __init__(self, folder: Path, memory_bytes: int = MEMORY_BYTES) -> None:
        self._folder = folder
        self._left = memory_bytes
        self._queues: dict[Hashable, _Queue] = {}
        self._files = ExitStack()

    def __enter__(self) -> Spool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._files.close()

    def keys(self) -> list[Hashable]:
        """The queues that there are."""
        return list(self._queues)

    def add(self, key: Hashable, columns: Columns) -> None:
        """Put a chunk at the end of a queue; its arrays must not change from here on."""
        queue = self._queues.setdefault(key, _Queue())
        size = sum(column.nbytes for column in columns)
        if size <= self._left:
            self._left -= size
            queue.chunks.append(columns)
            return
        try:
            queue.chunks.append(_Written(tuple(self._write(queue, column) for column in columns)))
        except OSError as error:
            raise InputError(f"{self._folder}: cannot be written ({error.strerror or error})") from error

    def chunks(self, key: Hashable, columns: Sequence[int] | None = None) -> Iterator[Columns]:
        """Give the chunks of a queue in order, or only some of their columns."""
        queue = self._queues.get(key, _Queue())
        for chunk in queue.chunks:
            places = range(len(chunk.places if isinstance(chunk, _Written) else chunk))
            wanted = places if columns is None else columns
            if isinstance(chunk, _Written):
                yield tuple(_read(queue, *chunk.places[index]) for index in wanted)
            else:
                yield tuple(chunk[index] for index in wanted)

    def take(self, key: Hashable) -> Iterator[Columns]:
        """Give the chunks of a queue, which is gone then, its file too; memory is given back as they go."""
        queue = self._queues.pop(key, _Queue())
        for index, chunk in enumerate(queue.chunks):
            queue.chunks[index] = ()
            if isinstance(chunk, _Written):
                yield tuple(_read(queue, *place) for place in chunk.places)
            else:
                self._left += sum(column.nbytes for column in chunk)
                yield chunk
        if queue.file is not None:
            queue.file.close()

    def _write(self, queue: _Queue, column: npt.NDArray[Any]) -> tuple[int, np.dtype[Any], tuple[int, ...]]:
        if queue.file is None:
            self._folder.mkdir(parents=True, exist_ok=True)
            queue.file = self._files.enter_context(tempfile.TemporaryFile(dir=self._folder))  # noqa: SIM115
        place = queue.file.seek(0, 2)
        queue.file.write(np.ascontiguousarray(column).data)
        return place, column.dtype, column.shape


def _read(queue: _Queue, place: int, kind: np.dtype[Any], shape: tuple[int, ...]) -> npt.NDArray[Any]:
    assert queue.file is not None, "a chunk that was written has a file"
    queue.file.seek(place)
    column = np.empty(shape, kind)
    queue.file.readinto(column.data)  # type: ignore[attr-defined]
    return column
