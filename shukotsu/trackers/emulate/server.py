"""The emulator on a port, in real time; a pseudo-terminal has a module of its own."""

from __future__ import annotations

import select
import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Callable

from shukotsu.errors import InputError
from shukotsu.trackers.emulate.emulator import SECOND_NS, Emulator

READ_BYTES = 4096
_IDLE_S = 0.02
"""How long to wait for a client at most while nothing is streamed."""


class Port(ABC):
    """What a client opens, under its `name`. Nothing here waits."""

    name: str

    @property
    @abstractmethod
    def readable(self) -> list[int]:
        """Descriptors that are readable when there is something to do."""

    @abstractmethod
    def read(self) -> bytes:
        """Read what the client has sent."""

    @abstractmethod
    def write(self, data: bytes) -> int:
        """Hand bytes to the client; give how many it took."""

    @abstractmethod
    def close(self) -> None:
        """Hang up."""


class TcpPort(Port):
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


def serve(emulator: Emulator, port: Port, stopped: Callable[[], bool]) -> None:
    """Run until `stopped` says so or the device has vanished. Pace comes from the monotonic clock."""
    while not stopped() and not emulator.gone:
        now_ns = time.perf_counter_ns()
        emulator.run(now_ns)
        wait_s = max(0.0, (emulator.due_ns - time.perf_counter_ns()) / SECOND_NS)
        if not emulator.is_busy:
            wait_s = max(wait_s, _IDLE_S)
        readable, _, _ = select.select(port.readable, [], [], wait_s)
        if readable:
            emulator.receive(port.read(), time.perf_counter_ns())
