"""Where the pieces of an archive come from: one that was recorded, or the recorder as a process of its own.

The recorder keeps every byte whatever becomes of the coach.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from shukotsu.tracker.archive import FollowedArchive, Piece, open_archive

ENDS_WITHIN_S = 20.0


class Replayed:
    """The pieces of a recorded archive, each no earlier than it came; speed : 2 for twice as fast, 0 for as
    fast as they are read.
    """

    def __init__(self, path: Path, speed: float) -> None:
        self._pieces = open_archive(path).pieces()
        self._next: Piece | None = next(self._pieces, None)
        self._speed = speed
        self._first_ns: int | None = None
        self._began_s = time.perf_counter()

    @property
    def ended(self) -> bool:
        """Whether no more will come."""
        return self._next is None

    def read(self) -> list[Piece]:
        """Return the next piece, if it has come by now."""
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
    """Records into an archive until `stop`, and reads what it has written. notes : what it said."""

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
            start_new_session=True,  # Ctrl-C is the coach's, which ends it in turn
        )
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        self.notes.extend(line.rstrip() for line in self._process.stdout)

    @property
    def ended(self) -> bool:
        """Whether no more will come."""
        return self._archive.ended or self._process.poll() is not None

    def read(self) -> list[Piece]:
        """Return what was written since the last call."""
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
"""What is read for the pieces of an archive, as they come."""
