"""The way out of the device: a FIFO of 2300 bytes, emptied no faster than the line carries bytes.

What does not fit is lost a whole cycle at a time, and nothing tells of it but the frame count. Source:
LIBERTY User Manual URM03PH156 (USB FIFO); that RS-232 loses whole cycles too is assumed.
"""

from __future__ import annotations

from collections.abc import Callable

FIFO_BYTES = 2300


class Line:
    """The FIFO and the line behind it.

    bytes_per_s : what the line carries; None is without limit, so that only the reader is one.
    """

    def __init__(self, bytes_per_s: float | None = None) -> None:
        self._bytes_per_s = bytes_per_s
        self._waiting = bytearray()
        self._ready = 0.0  # bytes at the FIFO's head that the line has had the time to carry
        self._last_s = 0.0
        self.buffered = True
        """Whether the device keeps cycles for a line that is busy; else it sends only when all is gone."""
        self.offset = 0
        """How many bytes were put in so far: where the next one stands in the stream."""

    def __len__(self) -> int:
        return len(self._waiting)

    def has_room(self, size: int) -> bool:
        """Whether a cycle of that many bytes is taken now; the first always is, however long."""
        room = FIFO_BYTES if self.buffered else size
        return not self._waiting or len(self._waiting) + size <= room

    def put(self, data: bytes) -> None:
        """Put bytes in; replies are put in without asking for room, for the device waits with them."""
        self._waiting += data
        self.offset += len(data)

    def run(self, now_s: float, write: Callable[[bytes], int]) -> None:
        """Let the line carry what it can until `now_s`; `write` gives how many bytes the reader took."""
        if self._bytes_per_s is None:
            allowed = len(self._waiting)
        else:
            self._ready += max(0.0, now_s - self._last_s) * self._bytes_per_s
            self._ready = min(self._ready, float(len(self._waiting)))
            allowed = int(self._ready)
        self._last_s = max(self._last_s, now_s)
        if allowed:
            taken = write(bytes(self._waiting[:allowed]))
            del self._waiting[:taken]
            self._ready -= taken
