"""A warm process that records the processor time of each job: start, reading and writing, and arithmetic.

The stack is sampled every few ms of processor time, and the time since the last sample is attributed to the
kind of work found there.
"""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from shukotsu import command_line
from shukotsu.workflow import warm_process

START, FILES, ARITHMETIC = KINDS = ("start", "files", "arithmetic")
_WHERE = {
    "importlib": START,
    "/pyarrow/": FILES,
    "/shukotsu/tables/": FILES,
    "/shukotsu/tracker/": FILES,
    "/readers/formats/": FILES,
}
"""Kind of work, by a part of the path of the function's file."""
_EVERY_S = 0.003


def _kind(frame: FrameType | None) -> str:
    while frame is not None:
        for part, kind in _WHERE.items():
            if part in frame.f_code.co_filename:
                return kind
        frame = frame.f_back
    return ARITHMETIC


def _measure(file: Path) -> None:
    """Make every job append a line to the file: its stage, arguments, and processor seconds by kind."""
    run_script = command_line.run_script

    def measured(path: str | Path, argv: Sequence[str]) -> int:
        taken = dict.fromkeys(KINDS, 0.0) | {START: time.process_time()}

        def sample(_: int, frame: FrameType | None) -> None:
            taken[_kind(frame)] += time.process_time() - sum(taken.values())

        signal.signal(signal.SIGPROF, sample)
        signal.siginterrupt(signal.SIGPROF, False)
        signal.setitimer(signal.ITIMER_PROF, _EVERY_S, _EVERY_S)
        try:
            return run_script(path, argv)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            sample(0, None)
            with file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps({"stage": Path(path).stem, "argv": [*argv], **taken}) + "\n")

    command_line.run_script = measured


@contextmanager
def measured_jobs(jobs: list[dict[str, Any]]) -> Iterator[str]:
    """Start the process and yield its address; when it has ended, append the measurements to `jobs`."""
    with tempfile.TemporaryDirectory() as name, socket.socket(socket.AF_UNIX) as listener:
        file, address = Path(name, "jobs.jsonl"), str(Path(name, "jobs"))
        listener.bind(address)
        listener.listen(warm_process.WAITING)
        command = [sys.executable, "-m", __name__, str(listener.fileno()), str(file)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=[listener.fileno()]) as process:
            yield address
            process.communicate()
        jobs += map(json.loads, file.read_text("utf-8").splitlines())


if __name__ == "__main__":
    _measure(Path(sys.argv[2]))
    warm_process.serve(socket.socket(fileno=int(sys.argv[1])))
