"""Marks: what another program says of a recording while it is made, a line of JSON each, and its end."""

from __future__ import annotations

import json
import os
import queue
import threading
import time
from contextlib import suppress
from typing import Any, NamedTuple

from shukotsu.errors import shortened
from shukotsu.trackers.record.recording_terminal import StopRequest

MOST_BYTES = 1 << 15
"""Of a line."""

MOST_WAITING = 64
"""More marks than the recording takes wait in the pipe, and their sender with them."""


class Mark(NamedTuple):
    """An event that a line became, and when [ns] it was read; reason : why it is none, else empty."""

    name: str
    host_ns: int
    details: dict[str, Any]
    reason: str = ""


class Marks:
    """Lines that a thread reads from a file descriptor, and nothing else: a recording waits for none.

    stop : is asked where a line of kind stop comes, also while the tracker is set up.
    """

    def __init__(self, descriptor: int, stop: StopRequest) -> None:
        self._descriptor, self._stop = descriptor, stop
        self._waiting: queue.Queue[Mark] = queue.Queue(MOST_WAITING)
        threading.Thread(target=self._read, name="marks", daemon=True).start()

    def taken(self) -> list[Mark]:
        """Give what came since the last call."""
        return [self._waiting.get_nowait() for _ in range(self._waiting.qsize())]

    def _read(self) -> None:
        """Read to the end of the input; sys.stdin's own lock would keep the program from ending."""
        line = b""
        while data := self._came():
            host_ns = time.perf_counter_ns()
            *whole, rest = data.split(b"\n")
            for part in whole:
                self._put(_mark(line + part, host_ns))
                line = b""
            line = (line + rest)[: MOST_BYTES + 1]
        if line:
            self._put(_mark(line, time.perf_counter_ns()))
        self._waiting.put(Mark("marks-ended", time.perf_counter_ns(), {}))

    def _came(self) -> bytes:
        try:
            return os.read(self._descriptor, MOST_BYTES)
        except OSError:  # it is gone, as at its end
            return b""

    def _put(self, mark: Mark) -> None:
        if mark.details.get("kind") == "stop":
            with suppress(queue.Full):  # nobody takes any while the tracker is set up
                self._waiting.put_nowait(mark)
            self._stop.ask("stop on standard input")
        else:
            self._waiting.put(mark)


def _mark(line: bytes, host_ns: int) -> Mark:
    try:
        if len(line) > MOST_BYTES:
            raise ValueError(f"is longer than {MOST_BYTES} bytes")
        try:
            said = json.loads(line)
            json.dumps(said, ensure_ascii=False, allow_nan=False).encode()  # what comes can be written too
        except (ValueError, RecursionError):
            raise ValueError("is no JSON") from None
        if not isinstance(said, dict) or not (isinstance(said.get("kind"), str) and said["kind"]):
            raise ValueError("is no object with a kind")
    except ValueError as error:
        text = shortened(line.decode("utf-8", "replace"), 100)
        return Mark("mark-refused", host_ns, {"line": text, "reason": str(error)}, str(error))
    return Mark("mark", host_ns, said)
