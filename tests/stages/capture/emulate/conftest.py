"""The emulator as its users run it, and a client that knows nothing of the project's decoders."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import pytest

REPOSITORY = Path(__file__).resolve().parents[4]


class Client:
    """A program at the tracker's serial line."""

    def __init__(self, path: str) -> None:
        self.descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.descriptor)
        termios.tcflush(self.descriptor, termios.TCIFLUSH)

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self.descriptor)

    def send(self, data: bytes) -> None:
        """Write bytes."""
        os.write(self.descriptor, data)

    def until_silent(self, silence_s: float = 0.1) -> bytes:
        """Read until nothing has come for that long."""
        out = bytearray()
        while select.select([self.descriptor], [], [], silence_s)[0]:
            out += self._read(4096)
        return bytes(out)

    def exactly(self, count: int, patience_s: float = 2.0) -> bytes:
        """Read that many bytes; fewer where nothing comes any longer."""
        out = bytearray()
        while len(out) < count and select.select([self.descriptor], [], [], patience_s)[0]:
            out += self._read(count - len(out))
        return bytes(out)

    def reply(self, command: bytes, silence_s: float = 0.06) -> bytes:
        """Send a command and read its answer."""
        self.send(command)
        return self.until_silent(silence_s)

    def during(self, seconds: float) -> bytes:
        """Read all that comes in that time."""
        out = bytearray()
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            if select.select([self.descriptor], [], [], left)[0]:
                out += self._read(65536)
        return bytes(out)

    def _read(self, most: int) -> bytes:
        data = os.read(self.descriptor, most)
        if not data:
            raise EOFError("the line has hung up")
        return data


@dataclass(frozen=True)
class Running:
    """An emulator that runs: what it says a client is to open, and its process."""

    name: str
    process: subprocess.Popen[str]

    def open(self) -> Client:
        """Be a client at its pseudo-terminal."""
        return Client(self.name)


Emulate = Callable[..., AbstractContextManager[Running]]


@contextmanager
def _emulated(*options: str, port: Sequence[str] = ("--pty",)) -> Iterator[Running]:
    command = [sys.executable, "-m", "stages.capture", "emulate", *port, *options]
    process = subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        name = process.stdout.readline().strip()
        assert name, "the emulator has ended"
        yield Running(name, process)
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        process.communicate(timeout=10)
        assert process.returncode == 0


@pytest.fixture
def emulated() -> Emulate:
    """Run the emulator with the given options while the context lasts."""
    return _emulated
