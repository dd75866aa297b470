"""Run a stage's script as a job of a study, in a fork of the warm process where there is one.

Starting Python and importing a stage's modules takes longer than the work of most jobs. On one machine the
workflow therefore starts a process that has imported everything (`workflow.warm_process`), and a job is a
fork of it: the script hands over its arguments, folder, environment and open files, and ends as the fork
does. Elsewhere, and where that process is out of reach, the script does its work itself, to the same bytes.
"""

from __future__ import annotations

import json
import os
import socket
import sys
from collections.abc import Callable, Sequence

ADDRESS = "SHUKOTSU_JOBS"
"""Environment variable: the socket of the warm process."""
LENGTH_BYTES = 8
STARTED = b"+"
KILLED = 137


def run(main: Callable[[], int]) -> int:
    """Run the `main` of the script that Python was started with; return its exit code."""
    if ADDRESS not in os.environ:
        return main()
    status = run_in_fork([os.path.abspath(sys.argv[0]), *sys.argv[1:]])  # noqa: PTH100 - pathlib, see below
    # the warm process ended with its workflow; the next run must not find another process at its files
    if status is None and not os.path.isdir(os.path.dirname(os.environ[ADDRESS])):  # noqa: PTH112, PTH120
        print("error: the workflow that started this job was killed", file=sys.stderr)
        return KILLED
    return main() if status is None else status


def run_in_fork(argv: Sequence[str]) -> int | None:
    """Run the job in a fork of the warm process; return its exit code, or None if it was not started."""
    with socket.socket(socket.AF_UNIX) as connection:
        try:
            connection.connect(os.environ[ADDRESS])
            folder = os.getcwd()  # noqa: PTH109 - pathlib takes longer to import than all of this
            request = {"argv": list(argv), "folder": folder, "environment": dict(os.environ)}
            encoded = json.dumps(request).encode()
            socket.send_fds(connection, [len(encoded).to_bytes(LENGTH_BYTES, "little")], [0, 1, 2])
            connection.sendall(encoded)
            started = connection.recv(1) == STARTED
        except (KeyError, OSError):
            return None
        if not started:
            return None
        status = connection.recv(1)
    if not status:
        print("error: the job's process was killed before its end", file=sys.stderr)
        return KILLED
    return status[0]
