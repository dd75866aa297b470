"""Emulated trackers at real ports, and the project's commands in separate processes."""

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
"""Longest time that a test waits for an asserted event."""


@contextmanager
def emulator(*options: str, port: Sequence[str] = ("--pty",)) -> Iterator[str]:
    """Run the emulator, yield its port, and check at the end that it exits with 0."""
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
    """Let a simulated tracker answer and stream at a pseudo-terminal, and yield the port.

    device : take(data) returns the answers to commands; while `streaming`, cycle() returns the data sent
    every period_s. When its attribute `gone` is true, the port is closed.
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
                time.sleep(0.1)  # time for the client to read
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
    """Run a shukotsu command and wait for its end."""
    pipes = {"capture_output": True, "stdin": subprocess.DEVNULL, "timeout": 2 * PATIENCE_S}
    return subprocess.run([*SHUKOTSU, *words], cwd=REPOSITORY, text=True, check=False, **pipes)  # type: ignore[call-overload, no-any-return]


class StubbornTracker:
    """A simulated tracker that receives the bytes `heard` instead of `unheard`."""

    streaming = True

    def __init__(self, device: EmulatedLiberty, unheard: bytes = b"no command", heard: bytes = b"") -> None:
        self.device = device
        self.period_s = float(1 / device.rate)
        self.unheard, self.heard = unheard, heard

    def take(self, data: bytes) -> bytes:
        """Return the answers to commands."""
        return self.device.receive(data.replace(self.unheard, self.heard))

    def cycle(self) -> bytes:
        """Return the data of one cycle."""
        return self.device.next_cycle()
