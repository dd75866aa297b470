"""The recorder as a process of its own: it keeps every byte whatever becomes of the coach."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError
from shukotsu.trackers.archive import FollowedArchive, Piece

MOST_NOTES = 20
ENDS_WITHIN_S = 20.0


class Recorder:
    """Records into an archive until `stop`, and gives what it has written.

    notes : what it last said, newest last.
    """

    def __init__(self, out: Path, options: Sequence[str]) -> None:
        argv = [sys.executable, "-m", "shukotsu", "record", *options, f"--out={out}", "--marks", "--quiet"]
        self._archive = FollowedArchive(out)
        self._sending = threading.Lock()
        self.notes: deque[str] = deque(maxlen=MOST_NOTES)
        self._process = subprocess.Popen(
            argv,
            stdin=subprocess.PIPE,
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
        """Give what was written since the last call."""
        return self._archive.read()

    def send(self, entry: Mapping[str, Any]) -> None:
        """Have an entry put into the archive. Raises InputError where the recorder is gone."""
        assert self._process.stdin is not None
        try:
            with self._sending:
                self._process.stdin.write(json.dumps(entry) + "\n")
                self._process.stdin.flush()
        except (OSError, ValueError) as error:
            raise InputError(f"the recorder has ended ({self.last_note or error}); begin again") from error

    @property
    def last_note(self) -> str:
        """Give what it said last; empty where it said nothing."""
        return self.notes[-1] if self.notes else ""

    def stop(self) -> int:
        """End the recording; give the recorder's exit code."""
        with suppress(InputError):
            self.send({"kind": "stop"})
        for insist in (None, self._process.terminate, self._process.kill):
            if insist is not None:
                insist()
            with suppress(subprocess.TimeoutExpired):
                return self._process.wait(ENDS_WITHIN_S)
        return -1
