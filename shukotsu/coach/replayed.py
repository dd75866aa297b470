"""A recorded archive as it came, at any speed."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from shukotsu.coach.live_poses import marks_in
from shukotsu.trackers.archive import END, Archive, Piece, open_archive


class Replayed:
    """The pieces of an archive, each no earlier than it came; speed : 2 for twice as fast, 0 for as fast as
    they are read. What was entered meanwhile stands behind the archive's end, and comes when it was entered.
    """

    def __init__(self, path: Path, speed: float) -> None:
        self.ended = False
        self._speed = speed
        self._pieces: Iterator[Piece] = _in_time(open_archive(path))
        self._next: Piece | None = next(self._pieces, None)
        self._first_ns: int | None = None
        self._began = time.perf_counter()

    def read(self) -> list[Piece]:
        """Give what has come by now."""
        found: list[Piece] = []
        while self._next is not None and self._is_due(self._next) and not (found and not self._speed):
            found.append(self._next)
            self._next = next(self._pieces, None)
        self.ended = self._next is None
        return found

    def _is_due(self, piece: Piece) -> bool:
        if not self._speed or not len(piece.host_ns):
            return True
        if self._first_ns is None:
            self._first_ns = int(piece.host_ns[0])
        return (int(piece.host_ns[-1]) - self._first_ns) * 1e-9 <= (
            time.perf_counter() - self._began
        ) * self._speed


def _in_time(archive: Archive) -> Iterator[Piece]:
    """The pieces of an archive up to its end, and the marks behind that before the piece that came next."""
    ended, marks = False, list[dict[str, Any]]()
    for piece in archive.pieces():
        marks += marks_in(piece, archive.path) if ended else []
        ended |= END in piece.kind
    entries: list[tuple[str, int, Mapping[str, Any]]] = sorted(
        (("mark", mark["host_ns"], mark) for mark in marks), key=lambda entry: entry[1]
    )
    for piece in archive.pieces():
        yield from with_marks(piece, entries)
        if END in piece.kind:
            return


def with_marks(piece: Piece, entries: list[tuple[str, int, Mapping[str, Any]]]) -> Iterator[Piece]:
    """A piece, behind those entries (name, host_ns and details, in time) that were made before its last
    row, or before the end; they are taken off the list.
    """
    last_ns = piece.host_ns.max(initial=0)
    due = sum(END in piece.kind or host_ns <= last_ns for _, host_ns, _ in entries)
    if due:
        yield Piece.of_events(entries[:due])
        del entries[:due]
    yield piece
