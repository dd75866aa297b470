"""Emulated trackers at real ports, and the project's commands in separate processes."""

import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from program_files import REPOSITORY

from shukotsu.tracker.emulated_device import EmulatedLiberty
from shukotsu.tracker.emulator import Emulator, PtyPort, serve

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

    device : has the attributes of EmulatedLiberty that Emulator uses. When its attribute `gone` is true, the
    port is closed.
    """
    port, ended = PtyPort(), threading.Event()
    emulated = Emulator(device, port.write, time.perf_counter_ns())

    def run() -> None:
        serve(emulated, port, lambda: ended.is_set() or getattr(device, "gone", False))
        time.sleep(0.1)  # time for the client to read
        port.close()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield port.name
    finally:
        ended.set()
        thread.join()


def shukotsu(*words: str) -> subprocess.CompletedProcess[str]:
    """Run a shukotsu command and wait for its end."""
    pipes = {"capture_output": True, "stdin": subprocess.DEVNULL, "timeout": 2 * PATIENCE_S}
    return subprocess.run([*SHUKOTSU, *words], cwd=REPOSITORY, text=True, check=False, **pipes)  # type: ignore[call-overload, no-any-return]


class StubbornTracker(EmulatedLiberty):
    """A simulated tracker that receives the bytes `heard` instead of `unheard`."""

    unheard, heard = b"no command", b""

    def receive(self, data: bytes) -> bytes:
        """Return the answers to commands."""
        return super().receive(data.replace(self.unheard, self.heard))
