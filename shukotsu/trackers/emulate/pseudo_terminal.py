"""The emulator's pseudo-terminal, where the system has any: not on Windows."""

from __future__ import annotations

import errno
import os
import termios
import tty
from pathlib import Path

from shukotsu.errors import InputError
from shukotsu.trackers.emulate.server import READ_BYTES, Port

_BAUDS = {
    getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdecimal()
}


class PtyPort(Port):
    """A pseudo-terminal; bytes stay in it while nobody reads, until it is full. Nothing here waits.

    name : what a client is to open. link : where to put a symbolic link to it. baud : with a client at
    another speed, both read garbage.
    Raises InputError where the link cannot be made.
    """

    def __init__(self, link: Path | None = None, baud: int | None = None) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(self._slave)
        self._baud = baud
        self._link = link
        if link is not None:
            try:
                if link.is_symlink():
                    link.unlink()
                link.symlink_to(self.name)
            except OSError as error:
                raise InputError(
                    f"{link}: cannot be made a link to {self.name} ({error.strerror})"
                ) from error

    @property
    def readable(self) -> list[int]:
        """Descriptors that are readable when there is something to do."""
        return [self._master]

    def read(self) -> bytes:
        """Read what the client has sent."""
        try:
            data = os.read(self._master, READ_BYTES)
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EIO):
                return b""
            raise
        spoilt = self._client_baud(4)
        return data if spoilt is None else garbled(data, spoilt, self._baud or spoilt)

    def write(self, data: bytes) -> int:
        """Hand bytes to the client; none where it does not read."""
        spoilt = self._client_baud(5)
        sent = data if spoilt is None else garbled(data, self._baud or spoilt, spoilt)
        try:
            taken = os.write(self._master, sent)
        except BlockingIOError:
            return 0
        return taken if spoilt is None else len(data)

    def close(self) -> None:
        """Hang up, and take the link away."""
        os.close(self._master)
        os.close(self._slave)
        if self._link is not None and self._link.is_symlink():
            self._link.unlink()

    def _client_baud(self, place: int) -> int | None:
        """The client's speed where it is not the device's."""
        if self._baud is None:
            return None
        speed = termios.tcgetattr(self._slave)[place]
        baud = _BAUDS.get(speed, 0)
        return None if baud == self._baud else max(baud, 50)


def garbled(data: bytes, sender_baud: int, receiver_baud: int) -> bytes:
    """Return bytes as a receiver of another speed reads them: the line's level sampled at its own times.

    It looks at the middle of each of its bits and takes every ten of them for a byte.
    """
    import numpy as np

    if not data:
        return b""
    levels = np.ones((len(data), 10), np.uint8)  # a start bit of 0, eight bits from the lowest, a stop bit
    levels[:, 0] = 0
    levels[:, 1:9] = np.unpackbits(np.frombuffer(data, np.uint8)[:, None], axis=1, bitorder="little")
    count = -(-len(data) * receiver_baud // sender_baud)
    place = ((np.arange(count * 10) + 0.5) * sender_baud / receiver_baud).astype(np.int64)
    seen = np.append(levels.ravel(), 1)[np.minimum(place, levels.size)].reshape(count, 10)
    return np.packbits(seen[:, 1:9], axis=1, bitorder="little").tobytes()
