"""The emulator on a pseudo-terminal or a TCP port, in real time."""

from __future__ import annotations

import errno
import os
import select
import socket
import termios
import time
import tty
from collections.abc import Callable
from pathlib import Path

from shukotsu.errors import InputError
from shukotsu.trackers.emulate.emulator import SECOND_NS, Emulator

READ_BYTES = 4096
_IDLE_S = 0.02
"""How long to wait for a client at most while nothing is streamed."""

_BAUDS = {
    getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdecimal()
}


class PtyPort:
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


class TcpPort:
    """A TCP port on this machine for one client at a time; without one, bytes are lost. Nothing here waits.

    name : what a client is to open. Raises InputError where the port is taken.
    """

    def __init__(self, host: str, number: int) -> None:
        try:
            self._listener = socket.create_server((host, number))
        except OSError as error:
            raise InputError(f"--tcp: {host}:{number} cannot be listened on ({error.strerror})") from error
        self._listener.setblocking(False)
        self._client: socket.socket | None = None
        self.name = f"socket://{host}:{self._listener.getsockname()[1]}"

    @property
    def readable(self) -> list[int]:
        """Descriptors that are readable when there is something to do."""
        return [one.fileno() for one in (self._listener, self._client) if one is not None]

    def read(self) -> bytes:
        """Read what the client has sent; a second client is turned away."""
        self._accept()
        if self._client is None:
            return b""
        try:
            data = self._client.recv(READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._leave()
        return data

    def write(self, data: bytes) -> int:
        """Hand bytes to the client."""
        if self._client is None:
            return len(data)
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self._leave()
            return len(data)

    def close(self) -> None:
        """Close the connection and the port."""
        if self._client is not None:
            self._leave()
        self._listener.close()

    def _accept(self) -> None:
        try:
            client, _ = self._listener.accept()
        except OSError:
            return
        if self._client is not None:
            client.close()
            return
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = client

    def _leave(self) -> None:
        assert self._client is not None
        self._client.close()
        self._client = None


Port = PtyPort | TcpPort


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


def serve(emulator: Emulator, port: Port, stopped: Callable[[], bool]) -> None:
    """Run until `stopped` says so or the device has vanished. Pace comes from the monotonic clock."""
    while not stopped() and not emulator.gone:
        now_ns = time.monotonic_ns()
        emulator.run(now_ns)
        wait_s = max(0.0, (emulator.due_ns - time.monotonic_ns()) / SECOND_NS)
        if not emulator.is_busy:
            wait_s = max(wait_s, _IDLE_S)
        readable, _, _ = select.select(port.readable, [], [], wait_s)
        if readable:
            emulator.receive(port.read(), time.monotonic_ns())
