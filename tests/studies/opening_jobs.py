"""A replacement for the warm process of a study that records which files each job opens.

Run as: python opening_jobs.py LISTENER FILE. Every Parquet file is opened by Python for its checksum, so it
appears in the interpreter's audit events.
"""

import json
import os
import socket
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shukotsu import command_line
from shukotsu.workflow import warm_process

run_script = command_line.run_script


def opening_run(script: str, argv: Sequence[str]) -> int:
    """Run a job and append a line with its arguments and the files that it opened to FILE."""
    opened: set[str] = set()

    def note(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            opened.add(str(Path(os.fsdecode(arguments[0])).resolve()))

    sys.addaudithook(note)
    try:
        return run_script(script, argv)
    finally:
        with Path(sys.argv[2]).open("a", encoding="utf-8") as stream:
            line = {"argv": [Path(script).name, *argv], "opened": sorted(opened)}
            stream.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    command_line.run_script = opening_run
    with socket.socket(fileno=int(sys.argv[1])) as listener:
        warm_process.serve(listener)
