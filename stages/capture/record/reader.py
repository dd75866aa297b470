"""The thread that reads: it does nothing but stamp what came, so that nothing else can make it late."""

from __future__ import annotations

import queue
import threading
import time
from dataclasses import dataclass

from stages.capture.record.port import Port, PortGoneError


@dataclass(frozen=True)
class Chunk:
    """Bytes that came together, and the host's monotonic time [ns] when they had come."""

    data: bytes
    host_ns: int


class Reader:
    """Reads a port from now on until it is closed.

    gone : why the port is gone, and when; None while it is there.
    """

    def __init__(self, port: Port) -> None:
        self.gone: tuple[str, int] | None = None
        self._port = port
        self._chunks: queue.SimpleQueue[Chunk] = queue.SimpleQueue()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read, name="reader", daemon=True)
        self._thread.start()

    def take(self, wait_s: float = 0.0) -> list[Chunk]:
        """Give all that came since the last call, waiting so long for a first chunk."""
        taken = []
        try:
            taken.append(self._chunks.get(timeout=wait_s) if wait_s > 0 else self._chunks.get_nowait())
            while True:
                taken.append(self._chunks.get_nowait())
        except queue.Empty:
            return taken

    def close(self) -> None:
        """Stop reading; the port is free to be closed when this returns."""
        self._ended.set()
        self._thread.join(timeout=5)

    def _read(self) -> None:
        while not self._ended.is_set():
            try:
                data = self._port.read()
            except PortGoneError as error:
                self.gone = (str(error), time.monotonic_ns())
                return
            if data:
                self._chunks.put(Chunk(data, time.monotonic_ns()))
