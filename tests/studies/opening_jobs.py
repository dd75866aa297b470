"""Jobs of a study that write down which files they open, done in the place of its warm process.

Run as: python opening_jobs.py LISTENER FILE. Every Parquet file is opened by Python for its checksum, so that
the interpreter's audit events name it.
"""

import json
import os
import socket
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shukotsu.workflow import job, warm_process

run = job.run


def opening_run(argv: Sequence[str]) -> int:
    """Run a job; add a line of its arguments and of the files that it opened to FILE."""
    opened: set[str] = set()

    def note(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            opened.add(str(Path(os.fsdecode(arguments[0])).resolve()))

    sys.addaudithook(note)
    try:
        return run(argv)
    finally:
        with Path(sys.argv[2]).open("a", encoding="utf-8") as stream:
            stream.write(json.dumps({"argv": list(argv), "opened": sorted(opened)}) + "\n")


if __name__ == "__main__":
    job.run = opening_run
    with socket.socket(fileno=int(sys.argv[1])) as listener:
        warm_process.serve(listener)
