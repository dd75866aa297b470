"""Emulated trackers at the other end of a real line, and programs of the project as a user runs them."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from program_files import REPOSITORY

from shukotsu.tracker.emulated_device import EmulatedLiberty

SHUKOTSU = [sys.executable, "-m", "shukotsu"]
PATIENCE_S = 60.0
"""How long a test waits for what it asserts before it gives up."""


@contextmanager
def emulator(*options: str, port: Sequence[str] = ("--pty",)) -> Iterator[str]:
    """Run the emulator while the context lasts; yields the port to open. It must end with exit code 0."""
    command = [*SHUKOTSU, "emulate", *port, *options]
    process = subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        name = process.stdout.readline().strip()
        assert name, "the emulator has ended"
        yield name
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0


@contextmanager
def at_a_port(device: Any) -> Iterator[str]:
    """Let a stand-in for a tracker answer and stream at a pseudo-terminal; yields the port to open.

    device : take(data) answers commands; while `streaming`, cycle() is what it sends every period_s. Once it
    is `gone`, the port is, too.
    """
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    ended = threading.Event()
    open_ends = [master, slave]

    def serve() -> None:
        due = time.monotonic()
        while not ended.is_set():
            if select.select([master], [], [], 0.002)[0]:
                os.write(master, device.take(os.read(master, 4096)))
            if device.streaming and time.monotonic() >= due:
                due = max(due + device.period_s, time.monotonic() - 0.1)
                os.write(master, device.cycle())
            if getattr(device, "gone", False):
                time.sleep(0.1)  # the client reads it
                while open_ends:
                    os.close(open_ends.pop())
                return

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        ended.set()
        thread.join()
        for descriptor in open_ends:
            os.close(descriptor)


def shukotsu(*words: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    pipes = {"capture_output": True, "stdin": subprocess.DEVNULL, "timeout": 2 * PATIENCE_S}
    return subprocess.run([*SHUKOTSU, *words], cwd=REPOSITORY, text=True, check=False, **pipes)  # type: ignore[call-overload, no-any-return]


class StubbornTracker:
    """A stand-in for a tracker: the bytes `unheard` come to the device as `heard`."""

    streaming = True

    def __init__(self, device: EmulatedLiberty, unheard: bytes = b"no command", heard: bytes = b"") -> None:
        self.device = device
        self.period_s = float(1 / device.rate)
        self.unheard, self.heard = unheard, heard

    def take(self, data: bytes) -> bytes:
        """Answer commands."""
        return self.device.receive(data.replace(self.unheard, self.heard))

    def cycle(self) -> bytes:
        """Return what it sends in one cycle."""
        return self.device.next_cycle()
