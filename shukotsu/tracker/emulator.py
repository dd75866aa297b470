"""Run the emulated tracker in real time on a pseudo-terminal or a TCP port; neither blocks."""

from __future__ import annotations

import errno
import os
import random
import select
import socket
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.errors import InputError
from shukotsu.tracker.archive import ArchiveWriter
from shukotsu.tracker.emulated_device import EmulatedLiberty, PlayedMotion
from shukotsu.tracker.liberty import FULL_LIST
from shukotsu.tracker.records import TRACK, StreamSettings

SECOND_NS, READ_BYTES = 1_000_000_000, 4096
MOST_WAITING_BYTES = 8 << 20
"""Largest amount of data buffered for a slow client; beyond it, complete cycles are dropped."""
_IDLE_S = 0.02
"""Longest wait for a client while nothing is streamed."""


class Emulator:
    """An emulated device with a clock. The caller provides the time, in ns from any origin, never decreasing.

    write : sends bytes to the client and returns how many were sent. waiting : bytes that were not sent yet.
    """

    def __init__(self, device: EmulatedLiberty, write: Callable[[bytes], int], now_ns: int) -> None:
        self.device = device
        self._write = write
        self._rate = device.rate
        self._from_cycle, self._from_ns = device.cycle, now_ns
        self.waiting = bytearray()

    @property
    def due_ns(self) -> int:
        """Time of the next cycle, ns."""
        passed = self.device.cycle - self._from_cycle
        return self._from_ns + passed * SECOND_NS * self._rate.denominator // self._rate.numerator

    def receive(self, data: bytes, now_ns: int) -> None:
        """Pass the client's bytes to the device and send its answer."""
        self.run(now_ns)
        self.waiting += self.device.receive(data)
        if self.device.rate != self._rate:
            self._from_ns, self._from_cycle = self.due_ns, self.device.cycle
            self._rate = self.device.rate
        self._send()

    def run(self, now_ns: int) -> None:
        """Run all cycles that are due."""
        while self.due_ns <= now_ns:
            data = self.device.next_cycle()
            if len(self.waiting) < MOST_WAITING_BYTES:
                self.waiting += data
        self._send()

    def _send(self) -> None:
        if self.waiting:
            taken = self._write(bytes(self.waiting))
            del self.waiting[:taken]


class TcpPort:
    """A TCP port of this machine for one client at a time; without a client, bytes are lost.

    name : URL for the client to open. readable : file descriptors to wait for. Raises InputError if the port
    is in use.
    """

    def __init__(self, host: str, number: int) -> None:
        try:
            self._listener = socket.create_server((host, number))
        except OSError as error:
            raise InputError(f"--tcp: {host}:{number} cannot be listened on ({error.strerror})") from error
        self._listener.setblocking(False)
        self._client: socket.socket | None = None
        self.name = f"socket://{host}:{self._listener.getsockname()[1]}"
        self.readable = [self._listener.fileno()]

    def read(self) -> bytes:
        """Return the bytes that the client has sent; reject a second client."""
        with suppress(OSError):
            client, _ = self._listener.accept()
            if self._client is not None:
                client.close()
            else:
                client.setblocking(False)
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._client = client
                self.readable.append(client.fileno())
        if self._client is None:
            return b""
        try:
            data = self._client.recv(READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._hang_up()
        return data

    def write(self, data: bytes) -> int:
        """Send bytes to the client; return how many were sent or, without a client, lost."""
        if self._client is None:
            return len(data)
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self._hang_up()
            return len(data)

    def close(self) -> None:
        """Close the connection and the port."""
        self._hang_up()
        self._listener.close()

    def _hang_up(self) -> None:
        if self._client is not None:
            self.readable.pop()
            self._client.close()
            self._client = None


class PtyPort:
    """A pseudo-terminal; it buffers unread bytes until it is full.

    name, readable : as in `TcpPort`. link : symbolic link to create. Raises InputError if the link cannot be
    created, or if the system has no pseudo-terminals.
    """

    def __init__(self, link: Path | None = None) -> None:
        if not hasattr(os, "openpty"):
            raise InputError("--pty: this system has no pseudo-terminals; give --tcp 4001")
        import tty

        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.name, self.readable = os.ttyname(self._slave), [self._master]
        self._link = link
        if link is not None:
            try:
                if link.is_symlink():
                    link.unlink()
                link.symlink_to(self.name)
            except OSError as error:
                why = error.strerror
                raise InputError(f"{link}: cannot be made a link to {self.name} ({why})") from error

    def read(self) -> bytes:
        """Return the bytes that the client has sent."""
        try:
            return os.read(self._master, READ_BYTES)
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EIO):
                return b""
            raise

    def write(self, data: bytes) -> int:
        """Send bytes to the client; return how many were sent, 0 if the buffer is full."""
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Close the terminal and remove the link."""
        os.close(self._master)
        os.close(self._slave)
        if self._link is not None and self._link.is_symlink():
            self._link.unlink()


def serve(emulator: Emulator, port: TcpPort | PtyPort, stopped: Callable[[], bool]) -> None:
    """Run the emulator by the monotonic clock until `stopped` returns true."""
    while not stopped():
        emulator.run(time.perf_counter_ns())
        shortest_s = 0.0 if emulator.device.streaming or emulator.waiting else _IDLE_S
        wait_s = max(shortest_s, (emulator.due_ns - time.perf_counter_ns()) / SECOND_NS)
        readable, _, _ = select.select(port.readable, [], [], wait_s)
        if readable:
            emulator.receive(port.read(), time.perf_counter_ns())


BEGINNING_NS = 3_360_000_000
"""Simulated host time when the recorder starts the stream."""
PIECE_NS, MOST_JITTER_NS, _MOST_HELD_BACK_BYTES = 10_000_000, 1_000_000, 80


def write_archive(device: EmulatedLiberty, out: Path, about: Mapping[str, Any]) -> None:
    """Write an archive of the emulated device from the first to the last frame of its motion.

    Positions are stored as float32 centimetres, which keeps them within 1e-4 mm up to 1 m from the
    transmitter. The hemisphere is one that no receiver leaves, or else tracking.

    device : the emulated tracker. out : the archive to write; InputError if it exists. about : description to
    store.
    """
    archive = ArchiveWriter(out, {"emulated": True, **about}, utc_offset_ns=lambda: 0)
    vector, items = home_hemisphere(device.motion), ",".join(map(str, FULL_LIST))
    begin = b"F1\rU1\rO*,%s\rH*,%g,%g,%g\rQ0\rC\r" % (items.encode(), *vector)
    by_station = dict.fromkeys(device.stations, FULL_LIST), dict.fromkeys(device.stations, vector)
    of_stream = float(device.rate), device.active(), *by_station, {"whoami": device.whoami}
    settings = StreamSettings(device.family, "binary", "cm", *of_stream)
    archive.settings(settings.to_json(), BEGINNING_NS)
    archive.sent(begin, BEGINNING_NS)
    emulator = Emulator(device, lambda _: 0, BEGINNING_NS)  # its bytes wait until a piece below takes them
    device.receive(begin)
    begun_ns = emulator.due_ns
    end_ns = begun_ns + len(device.motion.poses) * SECOND_NS // int(device.rate) - 1
    ticks_ns = [*range(begun_ns + PIECE_NS, end_ns, PIECE_NS), end_ns]
    for pieces, due_ns in enumerate(ticks_ns, 1):
        emulator.run(due_ns)
        draw = random.Random(pieces)
        now_ns = due_ns + draw.randrange(MOST_JITTER_NS)
        held_back = 0 if due_ns == end_ns else draw.randrange(_MOST_HELD_BACK_BYTES)
        count = len(emulator.waiting) - held_back  # the rest is in the next piece
        if count > 0:
            archive.received(bytes(emulator.waiting[:count]), now_ns)
            del emulator.waiting[:count]
        if pieces % (SECOND_NS // PIECE_NS) == 0:
            archive.flush()
    archive.sent(b"P", now_ns)
    archive.received(device.receive(b"P"), now_ns)
    archive.close({"reason": "duration", "duration_s": (end_ns + 1 - begun_ns) / SECOND_NS}, now_ns)


def home_hemisphere(motion: PlayedMotion) -> tuple[float, float, float]:
    """Return the axis nearest to the receivers' mean position if all stay on its side, else TRACK."""
    positions = motion.poses[..., :3].reshape(-1, 3)
    positions = positions[np.isfinite(positions).all(-1)]
    mean = positions.mean(0) if len(positions) else np.zeros(3)
    axis = int(np.argmax(np.abs(mean)))
    if not (positions[:, axis] * np.sign(mean[axis]) > 0).all():
        return TRACK
    x, y, z = np.where(np.arange(3) == axis, np.sign(mean), 0.0).tolist()
    return (x, y, z)
