"""Command line: run a stage's command line as a job of a study, in a warm process where there is one.

To start Python and import what a stage needs takes longer than most jobs' work. On one machine the workflow
therefore starts a process that has imported everything (`stages.warm_process`), and a job is a fork of it:
this command hands over its words, folder, environment and open files, and ends as the job does. Elsewhere,
and where that process is out of reach, the job is run right here, to the same bytes.
"""

from __future__ import annotations

import json
import os
import socket
import sys
from collections.abc import Sequence

ADDRESS = "SHUKOTSU_JOBS"
"""Environment variable: the socket of the warm process."""
LENGTH_BYTES = 8
BEGUN = b"+"
KILLED = 137


def main(words: Sequence[str]) -> int:
    """Run `stages.MODULE`'s command line, words[0] being the module; give its exit code."""
    status = handed_over(words)
    return run(words) if status is None else status


def handed_over(words: Sequence[str]) -> int | None:
    """Have the job done by a fork of the warm process; give its exit code, None where it was not begun."""
    with socket.socket(socket.AF_UNIX) as line:
        try:
            line.connect(os.environ[ADDRESS])
            folder = os.getcwd()  # noqa: PTH109 - pathlib takes longer to import than all of this
            message = {"words": list(words), "folder": folder, "environment": dict(os.environ)}
            encoded = json.dumps(message).encode()
            socket.send_fds(line, [len(encoded).to_bytes(LENGTH_BYTES, "little")], [0, 1, 2])
            line.sendall(encoded)
            begun = line.recv(1) == BEGUN
        except (KeyError, OSError):
            return None
        if not begun:
            return None
        status = line.recv(1)
    if not status:
        print("error: the job's process was killed before its end", file=sys.stderr)
        return KILLED
    return status[0]


def run(words: Sequence[str]) -> int:
    """Run the command line in this process."""
    import importlib

    from stages import command_line

    command_line.begin()
    module, *rest = words
    status: int = importlib.import_module(f"stages.{module}").main(rest)
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
