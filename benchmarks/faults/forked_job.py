"""A job's command as a study runs it: a fork of a process that has imported everything, to be killed."""

from __future__ import annotations

import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from workflow import job, warm_process

PATIENCE_S = 120.0


class Ended(NamedTuple):
    """How it ended: its exit code, negative for a signal, and what it said on standard error."""

    code: int
    said: str
    seconds: float

    @property
    def refusal(self) -> str:
        """Say why this is neither a completed job nor one sentence and exit 2; empty where it is."""
        if self.code == 0:
            return "traceback" if "Traceback" in self.said else ""
        errors = [line for line in self.said.splitlines() if line.startswith("error: ")]
        if self.code == 2 and len(errors) == 1 and "Traceback" not in self.said:
            return ""
        return f"exit {self.code}: {self.said[-400:]}"


def prepare() -> None:
    """Import what a job needs, as the warm process of a study does."""
    warm_process.import_all()


def run_forked(
    argv: Sequence[str],
    folder: Path,
    kill_after_s: float | None = None,
    prepare: Callable[[], None] | None = None,
) -> Ended:
    """Run a job's command in a fork; it and all that it started are killed after so long.

    prepare : done in the fork before (limits, another user).
    """
    source, target = os.pipe()
    fork = os.fork()
    if fork == 0:
        _become(argv, folder, target, prepare)
    os.close(target)
    started = time.monotonic()
    if kill_after_s is not None:
        time.sleep(kill_after_s)
        _kill(fork)
    with os.fdopen(source, "rb") as stream:
        said = stream.read().decode("utf-8", "replace")
    _, status = os.waitpid(fork, 0)
    return Ended(os.waitstatus_to_exitcode(status), said, time.monotonic() - started)


def _kill(fork: int) -> None:
    try:
        os.killpg(fork, signal.SIGKILL)
    except ProcessLookupError:  # it has no session of its own yet, or is no more
        os.kill(fork, signal.SIGKILL)


def _become(argv: Sequence[str], folder: Path, said: int, prepare: Callable[[], None] | None) -> None:
    status = 1
    try:
        os.setsid()
        os.dup2(os.open(os.devnull, os.O_RDWR), 0)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(said, 2)
        sys.stdout, sys.stderr = (os.fdopen(number, "w", 1, closefd=False) for number in (1, 2))
        os.chdir(folder)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        signal.alarm(int(PATIENCE_S))
        if prepare is not None:
            prepare()
        status = _status(argv)
    finally:
        os._exit(status & 255)


def _status(argv: Sequence[str]) -> int:
    try:
        return job.run(argv)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
