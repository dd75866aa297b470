"""The recorder as a process of its own: it keeps every byte whatever becomes of the coach.

What is entered meanwhile the coach keeps, and puts into the archive once that is closed.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from shukotsu.coach.replayed import with_marks
from shukotsu.errors import InputError
from shukotsu.trackers.archive import FollowedArchive, Piece, append_events

MOST_NOTES = 20
ENDS_WITHIN_S = 20.0


class Recorder:
    """Records into an archive until `stop`, and gives what it has written.

    notes : what it last said, newest last.
    """

    def __init__(self, out: Path, options: Sequence[str]) -> None:
        argv = [sys.executable, "-m", "shukotsu", "record", *options, f"--out={out}", "--quiet"]
        self._archive = FollowedArchive(out)
        self._entering = threading.Lock()
        self._entries: list[tuple[str, int, Mapping[str, Any]]] = []
        self._waiting: list[tuple[str, int, Mapping[str, Any]]] = []  # for a piece that came later
        self.notes: deque[str] = deque(maxlen=MOST_NOTES)
        self._process = subprocess.Popen(
            argv,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,
        )
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.notes.append(line.rstrip())

    @property
    def exit_code(self) -> int | None:
        """Give how it ended; None while it records."""
        return self._process.poll()

    @property
    def ended(self) -> bool:
        """Say whether no more will come."""
        return self._archive.ended or self.exit_code is not None

    def read(self) -> list[Piece]:
        """Return what was written since the last call, and what was entered meanwhile, as a replay does."""
        pieces = self._archive.read()
        with self._entering:
            return [each for piece in pieces for each in with_marks(piece, self._waiting)]

    def send(self, entry: Mapping[str, Any]) -> None:
        """Keep an entry for the archive. Raises InputError where the recorder is gone."""
        if self.exit_code is not None:
            raise InputError(f"the recorder has ended ({self.last_note}); begin again")
        with self._entering:
            made = ("mark", time.perf_counter_ns(), entry)
            self._entries.append(made)
            self._waiting.append(made)

    @property
    def last_note(self) -> str:
        """Give what it said last; empty where it said nothing."""
        return self.notes[-1] if self.notes else ""

    def stop(self) -> int:
        """End the recording, and put what was entered into the archive; return the recorder's exit code."""
        code = -1
        for insist in (self._process.terminate, self._process.kill):
            insist()
            with suppress(subprocess.TimeoutExpired):
                code = self._process.wait(ENDS_WITHIN_S)
                break
        if self._entries and self._archive.path.exists():
            try:
                append_events(self._archive.path, self._entries)
            except (InputError, OSError) as error:
                self.notes.append(f"note: what was entered is not in the archive: {error}")
        return code
