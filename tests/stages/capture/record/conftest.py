"""An emulated tracker behind a real pseudo-terminal or socket, and a recorder that is run as a user would."""

import os
import select
import signal
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Protocol

import pytest

REPOSITORY = Path(__file__).resolve().parents[4]
CAPTURE = [sys.executable, "-m", "stages.capture"]
PATIENCE_S = 60.0


class StandIn(Protocol):
    """What stands in for a tracker: it answers what it takes, and while it streams gives a cycle a period."""

    streaming: bool
    period_s: float

    def take(self, data: bytes) -> bytes:
        """Answer commands."""
        ...

    def cycle(self) -> bytes:
        """Give what it sends in one cycle."""
        ...


Emulated = Callable[..., str]
Started = Callable[..., "subprocess.Popen[str]"]


def _ended(process: "subprocess.Popen[str]") -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGKILL)
    process.communicate()


@pytest.fixture
def emulated(tmp_path: Path) -> Iterator[Emulated]:
    """Start an emulated tracker with the emulator's own options; gives the port to open."""
    running = []

    def start(*options: str, tcp: bool = False) -> str:
        where = ["--tcp", "0"] if tcp else ["--pty", str(tmp_path / f"tracker{len(running)}")]
        process = subprocess.Popen(
            [*CAPTURE, "emulate", *where, *options], cwd=REPOSITORY, stdout=subprocess.PIPE, text=True
        )
        running.append(process)
        assert process.stdout is not None
        said = process.stdout.readline().split()
        assert said, "the emulator did not start"
        return next(word for word in said if word.startswith(("socket://", "/dev/")))

    yield start
    for process in running:
        _ended(process)


@contextmanager
def _served(device: StandIn) -> Iterator[str]:
    """Let a stand-in answer and stream at a pseudo-terminal."""
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    ended = threading.Event()

    def serve() -> None:
        due = time.monotonic()
        while not ended.is_set():
            if select.select([master], [], [], 0.002)[0]:
                os.write(master, device.take(os.read(master, 4096)))
            if device.streaming and time.monotonic() >= due:
                due = max(due + device.period_s, time.monotonic() - 0.1)
                os.write(master, device.cycle())

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        ended.set()
        thread.join()
        os.close(master)
        os.close(slave)


@pytest.fixture
def at_a_port() -> Callable[[StandIn], AbstractContextManager[str]]:
    """Have a stand-in answer at a pseudo-terminal within a `with`; gives the port to open."""
    return _served


@pytest.fixture
def started() -> Iterator[Started]:
    """Start a subcommand of capture and leave it running."""
    running = []

    def start(*words: str, **how: object) -> "subprocess.Popen[str]":
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "stdin": subprocess.DEVNULL}
        process = subprocess.Popen([*CAPTURE, *words], cwd=REPOSITORY, text=True, **(pipes | how))  # type: ignore[call-overload]
        running.append(process)
        return process

    yield start
    for process in running:
        _ended(process)


@pytest.fixture
def ended() -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """Run a subcommand of capture to its end."""

    def run(*words: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            [*CAPTURE, *words],
            cwd=REPOSITORY,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            stdin=subprocess.DEVNULL,
            check=False,
        )

    return run


@pytest.fixture
def until_lines() -> Callable[["subprocess.Popen[str]", int], list[str]]:
    """Read a recorder's log until it has told so many seconds; gives what it said."""

    def read(process: "subprocess.Popen[str]", seconds: int) -> list[str]:
        said: list[str] = []
        assert process.stderr is not None
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            line = process.stderr.readline()
            if not line:
                break
            said.append(line.rstrip())
            if sum(" Hz " in one for one in said) >= seconds:
                return said
        raise AssertionError(f"the recorder ended early: {said}")

    return read


@pytest.fixture
def typed() -> Callable[[str, bytes], None]:
    """Leave a tracker as another program would: send it something and go away."""

    def send(port: str, data: bytes) -> None:
        descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY)
        os.write(descriptor, data)
        time.sleep(0.2)
        os.close(descriptor)

    return send
