"""A process that has imported the modules that jobs need, and forks for each job (see `shukotsu.job`).

It runs as long as the workflow that started it, on Linux and on one machine. All computation is on a single
thread, so a fork, which keeps only one thread, loses nothing.
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

from shukotsu import command_line, job

ROOMS = (
    *("checks", "export", "fit", "hand", "movement", "paper", "readers", "report", "scores", "simulate"),
    *("study", "tables"),
)
PACKAGES = ("jsonschema", "matplotlib.backends.backend_pdf", *(f"shukotsu.{room}" for room in ROOMS))
"""Modules to import before the first fork; of this project's packages, all modules are imported."""
WAITING = 128
KEEP_MEMORY = {
    "MALLOC_MMAP_THRESHOLD_": str(1 << 25),
    "MALLOC_TRIM_THRESHOLD_": str(1 << 28),
    "MALLOC_TOP_PAD_": str(1 << 24),
}
"""Settings of glibc with which memory of freed arrays is reused instead of returned to the system."""


def start() -> subprocess.Popen[bytes] | None:
    """Start the warm process, which ends with this one; jobs find its address in their environment.

    Returns None without starting it if the system is not Linux, if the environment already has an address,
    or if there is an error. Jobs that find no address start on their own.
    """
    if sys.platform != "linux" or job.ADDRESS in os.environ:
        return None
    with suppress(OSError), socket.socket(socket.AF_UNIX) as listener:
        folder = tempfile.mkdtemp(prefix="shukotsu-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        address = str(Path(folder, "jobs"))
        listener.bind(address)
        listener.listen(WAITING)  # jobs can connect from now on, and wait until all is imported
        paths = {"PYTHONPATH": str(Path(__file__).parents[2]), "PYTHONSAFEPATH": "1"}
        process = subprocess.Popen(
            [sys.executable, "-m", "shukotsu.workflow.warm_process", str(listener.fileno())],
            stdin=subprocess.PIPE,  # never written to; the system closes it when this process ends
            pass_fds=[listener.fileno()],
            env=os.environ | KEEP_MEMORY | paths,
        )
        atexit.register(process.communicate)
        os.environ[job.ADDRESS] = address
        return process
    return None


def serve(listener: socket.socket) -> None:
    """Fork for every job that connects, until standard input is closed."""
    command_line.begin()
    for name in PACKAGES:
        package = importlib.import_module(name)
        if name.startswith("shukotsu."):
            for module in pkgutil.walk_packages(package.__path__, f"{name}."):
                importlib.import_module(module.name)
    if (fits := sys.modules.get("shukotsu.fit.compile_kernel")) is not None:
        fits.load_compiled()  # takes longer than many jobs
    gc.freeze()  # exempt existing objects from garbage collection, so that forks share their memory
    forks: set[int] = set()
    while sys.stdin not in select.select([listener, sys.stdin], [], [])[0]:
        connection, _ = listener.accept()
        fork = os.fork()
        if fork == 0:
            listener.close()
            _run_job(connection)
        forks.add(fork)
        connection.close()
        with suppress(ChildProcessError):  # reap finished forks, so that their resource usage is counted
            while ended := os.waitpid(-1, os.WNOHANG)[0]:
                forks.discard(ended)
    for fork in forks:  # the workflow was killed; no fork may still write files during its next run
        with suppress(ProcessLookupError):
            os.kill(fork, signal.SIGKILL)
        with suppress(ChildProcessError):
            os.waitpid(fork, 0)


def _run_job(connection: socket.socket) -> None:
    """Run the job that the client requests, send the exit code to the client, and end this process."""
    status = 1
    try:
        status = _status_of_job(connection)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once answered, the client only closes the connection
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        with suppress(OSError):  # the client has ended
            connection.sendall(bytes([status & 255]))
    finally:  # a fork must never return to the listener
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
        # the old stream objects may assume properties of the former files
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
    except BaseException:  # like Python: a traceback in the job's log, and exit code 1
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
        finally:  # the parent process may have been killed before it could remove the folder
            shutil.rmtree(Path(listener.getsockname()).parent, ignore_errors=True)
