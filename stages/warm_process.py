"""A process that has imported what the jobs of a subject need, and forks for each of them (see `stages.job`).

It lives as long as the workflow that started it, on Linux and on one machine. It never computes anything
itself, so that there is no thread that a fork would lose.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import json
import os
import pkgutil
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import traceback
from contextlib import suppress
from pathlib import Path
from types import ModuleType

from stages import command_line, job

PACKAGES = (
    "capture",
    "check_calibration",
    "solve_joints",
    "project_planes",
    "fit_hand",
    "estimate_metacarpals",
    "evaluate_tips",
    "evaluate_skeletons",
    "export",
    "report",
)
"""Packages of the stages whose jobs are forked."""
OTHERS = ("pyarrow.compute", "pyarrow.parquet", "stages.each")
WAITING = 128


def start() -> subprocess.Popen[bytes] | None:
    """Start the process; it ends with this one. Jobs find it by their environment.

    Where it cannot be had (another system, no place for its socket), and where the environment names an
    address already, there is none, and jobs start by themselves.
    """
    if sys.platform != "linux" or job.ADDRESS in os.environ:
        return None
    with suppress(OSError), socket.socket(socket.AF_UNIX) as door:
        folder = tempfile.mkdtemp(prefix="shukotsu-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        address = str(Path(folder, "jobs"))
        door.bind(address)
        door.listen(WAITING)  # from now on jobs may come; they wait until everything is imported
        process = subprocess.Popen(
            [sys.executable, "-m", "stages.warm_process", str(door.fileno())],
            stdin=subprocess.PIPE,  # never written to: it is closed when this process ends, however it does
            pass_fds=[door.fileno()],
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[1]), "OMP_NUM_THREADS": "1"},
        )
        atexit.register(process.communicate)
        os.environ[job.ADDRESS] = address
        return process
    return None


def serve(door: socket.socket) -> None:
    """Fork for every job that comes through the door, until standard input ends."""
    command_line.begin()
    _import_all()
    gc.freeze()  # what is here stays, and is shared with the forks
    while door in select.select([door, sys.stdin], [], [])[0]:
        line, _ = door.accept()
        if os.fork() == 0:
            door.close()
            _be_the_job(line)
        line.close()
        _bury(os.WNOHANG)
    _bury(0)


def _bury(options: int) -> None:
    """Take note of the forks that have ended, so that what they cost counts as this process's."""
    with suppress(ChildProcessError):
        while os.waitpid(-1, options)[0]:
            pass


def _import_all() -> None:
    for name in OTHERS:
        importlib.import_module(name)
    for package in PACKAGES:
        found: ModuleType = importlib.import_module(f"stages.{package}")
        for module in pkgutil.walk_packages(found.__path__, f"{found.__name__}."):
            importlib.import_module(module.name)


def _be_the_job(line: socket.socket) -> None:
    """Do what the other end asks for, as if it were this process; answer with the exit code and end."""
    status = 1
    try:
        status = _status_of_job(line)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # who is answered closes the line, no more
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        with suppress(OSError):  # whoever waited for the answer is no more
            line.sendall(bytes([status & 255]))
    finally:  # whatever happened: a fork must never come back to the door
        os._exit(status & 255)


def _status_of_job(line: socket.socket) -> int:
    try:
        words = _become_the_client(line)
        line.sendall(job.BEGUN)
        threading.Thread(target=_end_with, args=(line,), daemon=True).start()
        return job.run(words)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # as Python itself ends: said where the job says things, and told by the code
        traceback.print_exc()
        return 1


def _become_the_client(line: socket.socket) -> list[str]:
    """Take over its standard streams, folder and environment; give its words."""
    header, streams, _, _ = socket.recv_fds(line, job.LENGTH_BYTES, 3)
    with line.makefile("rb") as stream:
        message = json.loads(stream.read(int.from_bytes(header, "little")))
    for number, descriptor in enumerate(streams):
        os.dup2(descriptor, number)
        os.close(descriptor)
    os.chdir(message["folder"])
    os.environ.clear()
    os.environ.update(message["environment"])
    words: list[str] = message["words"]
    return words


def _end_with(line: socket.socket) -> None:
    """Wait until the other end is closed, which says that the job was told to end."""
    with suppress(OSError):
        line.recv(1)
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    with suppress(KeyboardInterrupt), socket.socket(fileno=int(sys.argv[1])) as door:
        try:
            serve(door)
        finally:  # who started it may have been killed
            shutil.rmtree(Path(door.getsockname()).parent, ignore_errors=True)
