"""A process that has imported what jobs need, and forks for each of them (see `shukotsu.job`).

It runs as long as the workflow that started it, on Linux and on one machine. It computes nothing with more
than one thread and so has none that a fork would lose.
"""

from __future__ import annotations

import atexit
import gc
import importlib
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

from shukotsu import command_line, job

ROOMS = (
    *("checks", "export", "fit", "hand", "movement", "paper", "readers", "report", "scores", "simulate"),
    *("study", "tables"),
)
PACKAGES = ("jsonschema", "matplotlib.backends.backend_pdf", *(f"shukotsu.{room}" for room in ROOMS))
"""Modules imported before the first fork; of a package of this project, all its modules."""
WAITING = 128
KEEP_MEMORY = {
    "MALLOC_MMAP_THRESHOLD_": str(1 << 25),
    "MALLOC_TRIM_THRESHOLD_": str(1 << 28),
    "MALLOC_TOP_PAD_": str(1 << 24),
}
"""Settings of glibc: arrays that are freed are used again, not returned to the system and cleared anew."""


def start() -> subprocess.Popen[bytes] | None:
    """Start the process, which ends with this one; jobs find its address in their environment.

    Where it cannot start, or the environment already has an address, every job starts on its own.
    """
    if sys.platform != "linux" or job.ADDRESS in os.environ:
        return None
    with suppress(OSError), socket.socket(socket.AF_UNIX) as listener:
        folder = tempfile.mkdtemp(prefix="shukotsu-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        address = str(Path(folder, "jobs"))
        listener.bind(address)
        listener.listen(WAITING)  # jobs may connect from now on; they wait until everything is imported
        process = subprocess.Popen(
            [sys.executable, "-m", "shukotsu.workflow.warm_process", str(listener.fileno())],
            stdin=subprocess.PIPE,  # never written to; the system closes it when this process ends
            pass_fds=[listener.fileno()],
            env=os.environ
            | KEEP_MEMORY
            | {"PYTHONPATH": str(Path(__file__).parents[2]), "PYTHONSAFEPATH": "1"},
        )
        atexit.register(process.communicate)
        os.environ[job.ADDRESS] = address
        return process
    return None


def serve(listener: socket.socket) -> None:
    """Fork for every job that connects, until standard input is closed."""
    command_line.begin()
    for name in PACKAGES:
        package: ModuleType = importlib.import_module(name)
        if name.startswith("shukotsu."):
            for module in pkgutil.walk_packages(package.__path__, f"{name}."):
                importlib.import_module(module.name)
    if (fits := sys.modules.get("shukotsu.fit.compile_kernel")) is not None:
        fits.load_compiled()  # which takes longer than many a job
    gc.freeze()  # the garbage collector skips existing objects, so that forks share their memory
    forks: set[int] = set()
    while sys.stdin not in select.select([listener, sys.stdin], [], [])[0]:
        connection, _ = listener.accept()
        fork = os.fork()
        if fork == 0:
            listener.close()
            _run_job(connection)
        forks.add(fork)
        connection.close()
        with suppress(ChildProcessError):  # finished forks: their resources count as this process's
            while ended := os.waitpid(-1, os.WNOHANG)[0]:
                forks.discard(ended)
    for fork in forks:  # the workflow was killed; no fork may write files during its next run
        with suppress(ProcessLookupError):
            os.kill(fork, signal.SIGKILL)
        with suppress(ChildProcessError):
            os.waitpid(fork, 0)


def _run_job(connection: socket.socket) -> None:
    """Run the job that the client requests, send it the exit code, and end."""
    status = 1
    try:
        status = _status_of_job(connection)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once answered, the client only closes the connection
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        with suppress(OSError):  # the client has ended
            connection.sendall(bytes([status & 255]))
    finally:  # in any case: a fork must never return to the listener
        os._exit(status & 255)


def _status_of_job(connection: socket.socket) -> int:
    try:
        # take over its standard streams, folder and environment
        header, streams, _, _ = socket.recv_fds(connection, job.LENGTH_BYTES, 3)
        with connection.makefile("rb") as stream:
            folder, argv, environment = job.job_of(stream.read(int.from_bytes(header, "little")))
        for number, descriptor in enumerate(streams):
            os.dup2(descriptor, number)
            os.close(descriptor)
        # reopened, since the old streams treat the new pipe as the former file
        sys.stdout = open(1, "w", encoding=sys.stdout.encoding, closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", 1, sys.stderr.encoding, "backslashreplace", closefd=False)  # noqa: SIM115
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        connection.sendall(job.STARTED)
        threading.Thread(target=_end_with, args=(connection,), daemon=True).start()
        return command_line.run_script(argv[0], argv[1:])
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # as Python itself ends: a traceback in the job's log, and exit code 1
        traceback.print_exc()
        return 1


def _end_with(connection: socket.socket) -> None:
    """End this process when the client closes its end of the connection."""
    with suppress(OSError):
        connection.recv(1)
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    with suppress(KeyboardInterrupt), socket.socket(fileno=int(sys.argv[1])) as listener:
        try:
            serve(listener)
        finally:  # this process's parent may have been killed
            shutil.rmtree(Path(listener.getsockname()).parent, ignore_errors=True)
