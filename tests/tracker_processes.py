"""Emulated trackers at the other end of a real line, and programs of the project as a user runs them."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import termios
import threading
import time
import tty
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shukotsu.tracker.conversation import Conversation
from shukotsu.tracker.emulated_device import EmulatedLiberty
from shukotsu.tracker.families import StreamSettings
from shukotsu.tracker.port import open_port
from shukotsu.tracker.request import RecordingRequest
from shukotsu.tracker.session import DRIVERS

REPOSITORY = Path(__file__).resolve().parents[1]
CAPTURE = [sys.executable, "-m", "shukotsu"]
PATIENCE_S = 60.0
"""How long a test waits for what it asserts before it gives up."""


@dataclass(frozen=True)
class RunningEmulator:
    """An emulator that runs: what it says a client is to open, and its process."""

    name: str
    process: subprocess.Popen[str]


@contextmanager
def emulator(*options: str, port: Sequence[str] = ("--pty",)) -> Iterator[RunningEmulator]:
    """Run the emulator with the given options while the context lasts; it must end with exit code 0."""
    command = [*CAPTURE, "emulate", *port, *options]
    process = subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        name = process.stdout.readline().strip()
        assert name, "the emulator has ended"
        yield RunningEmulator(name, process)
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0


class VanishedError(Exception):
    """The tracker is gone, after some last bytes."""


@contextmanager
def at_a_port(device: Any) -> Iterator[str]:
    """Let a stand-in for a tracker answer and stream at a pseudo-terminal; yields the port to open.

    device : take(data) answers commands; while `streaming`, cycle() is what it sends every period_s. A cycle
    that raises VanishedError is its last, and the port is gone.
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
                try:
                    os.write(master, device.cycle())
                except VanishedError as error:
                    os.write(master, *error.args)
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


def capture(*words: str) -> subprocess.CompletedProcess[str]:
    """Run a subcommand of capture to its end."""
    return subprocess.run(
        [*CAPTURE, *words],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=2 * PATIENCE_S,
        stdin=subprocess.DEVNULL,
        check=False,
    )


@contextmanager
def started(*words: str, **how: object) -> Iterator[subprocess.Popen[str]]:
    """Start a subcommand of capture and leave it running; it is killed at the end of the context."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "stdin": subprocess.DEVNULL}
    process = subprocess.Popen([*CAPTURE, *words], cwd=REPOSITORY, text=True, **(pipes | how))  # type: ignore[call-overload]
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def until_lines(process: subprocess.Popen[str], count: int) -> list[str]:
    """Read a recorder's log until it has written that many lines of the view; gives what it wrote."""
    lines: list[str] = []
    assert process.stderr is not None
    while sum(" Hz " in line for line in lines) < count:
        line = process.stderr.readline()
        if not line:
            raise AssertionError(f"the recorder ended early: {lines}")
        lines.append(line.rstrip())
    return lines


def leave_in(port: str, data: bytes) -> None:
    """Leave a tracker as another program would: send it something and go away when it has taken that."""
    descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY)
    os.write(descriptor, data)
    termios.tcdrain(descriptor)
    time.sleep(0.2)  # the emulator reads what it was sent
    os.close(descriptor)


EVERYTHING_HEARD = b"not a command"


class StubbornTracker:
    """A stand-in for a tracker: the bytes `unheard` come to the device as `heard`."""

    streaming = True

    def __init__(self, device: EmulatedLiberty, unheard: bytes, heard: bytes = b"") -> None:
        self.device = device
        self.period_s = float(1 / device.rate)
        self.unheard, self.heard = unheard, heard

    def take(self, data: bytes) -> bytes:
        """Answer commands."""
        return self.device.receive(data.replace(self.unheard, self.heard))

    def cycle(self) -> bytes:
        """Return what it sends in one cycle."""
        return self.device.next_cycle()


def set_up(tracker: StubbornTracker, request: RecordingRequest) -> tuple[StreamSettings, list[str]]:
    """Set it up at a pseudo-terminal; gives the settings and the warnings."""
    with at_a_port(tracker) as name:
        port = open_port(name, 115200)
        conversation = Conversation(port)
        driver = DRIVERS[request.family](conversation, request)
        try:
            return driver.set_up(), driver.warnings
        finally:
            conversation.close()
            port.close()
