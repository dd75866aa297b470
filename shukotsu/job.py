"""Run a stage's script as a job of a study: `python -IS shukotsu/job.py SCRIPT [ARGUMENT ...]`.

Starting Python and importing a stage's modules takes longer than the work of most jobs. On one machine the
workflow therefore starts a process that has imported all modules (`workflow.warm_process`), and a job is a
fork of it: this script passes on the arguments, folder, environment and standard streams, and ends with the
fork's exit code. Elsewhere, or if that process cannot be reached, this script runs the stage's script itself,
with identical results. Because every job starts this script, it imports as little as possible.
"""

from __future__ import annotations

import _socket as socket  # the public module takes as long to import as Python takes to start
import os
import sys

ADDRESS = "SHUKOTSU_JOBS"
"""Environment variable with the path of the warm process's socket."""
LENGTH_BYTES = 8
STARTED = b"+"
KILLED = 137


def main() -> None:
    """Run the script that the command line names, and exit with its exit code."""
    script, *arguments = sys.argv[1:]
    if ADDRESS in os.environ:
        status = run_in_fork([os.path.abspath(script), *arguments])  # noqa: PTH100 - pathlib is slow to import
        # the warm process ended with its workflow; a job that runs on could write files during the next run
        if status is None and not os.path.isdir(os.path.dirname(os.environ[ADDRESS])):  # noqa: PTH112, PTH120
            print("error: the workflow that started this job was killed", file=sys.stderr)
            status = KILLED
        if status is not None:
            sys.exit(status)
    os.execv(sys.executable, [sys.executable, script, *arguments])


def run_in_fork(argv: list[str]) -> int | None:
    """Run the job in a fork of the warm process; return its exit code, or None if it was not started."""
    connection = socket.socket(socket.AF_UNIX)
    try:
        connection.connect(os.environ[ADDRESS])
        request = request_of(os.getcwd(), argv)  # noqa: PTH109
        streams = b"".join(stream.to_bytes(4, sys.byteorder) for stream in (0, 1, 2))
        length = len(request).to_bytes(LENGTH_BYTES, "little")
        connection.sendmsg([length], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, streams)])
        connection.sendall(request)
        started = connection.recv(1) == STARTED
    except OSError:
        return None
    if not started:
        return None
    status = connection.recv(1)
    if not status:
        print("error: the job's process was killed before its end", file=sys.stderr)
        return KILLED
    return status[0]


def request_of(folder: str, argv: list[str]) -> bytes:
    """Encode a job: its folder, the number of its arguments, these, and its environment, separated by NUL."""
    environment = (f"{name}={value}" for name, value in os.environ.items())
    return b"\0".join(map(os.fsencode, (folder, str(len(argv)), *argv, *environment)))


def job_of(request: bytes) -> tuple[str, list[str], dict[str, str]]:
    """Return the folder, arguments and environment that a request encodes."""
    folder, count, *words = map(os.fsdecode, request.split(b"\0"))
    return folder, words[: int(count)], dict(word.split("=", 1) for word in words[int(count) :])


if __name__ == "__main__":
    main()
