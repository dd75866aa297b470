"""One run of a study at a time, by a lock of the system, which ends with its process, however that ends.

Snakemake's own lock outlives a run that was killed; the profiles that ship leave it out (`nolock`).
"""

from __future__ import annotations

import os
import socket
from pathlib import Path
from typing import TextIO

from shukotsu.errors import InputError

FOLDER = Path(".snakemake")
_held: dict[Path, TextIO] = {}
"""By their paths; open as long as this process lives."""


def hold(results: Path) -> None:
    """Hold the study with that results folder until this process ends.

    Raises InputError where another run holds it. Where there are no locks, or no file can be made, none does.
    """
    import fcntl

    path = FOLDER.absolute() / f"shukotsu-run-{results.name}.lock"
    if path in _held:
        return
    try:
        path.parent.mkdir(exist_ok=True)
        file = path.open("a+", encoding="utf-8")
    except OSError:  # a folder that cannot be written to: Snakemake says so
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        file.truncate(0)
        file.write(f"process {os.getpid()} on {socket.gethostname()}")
        file.flush()
    except BlockingIOError:
        file.seek(0)
        with file:
            raise InputError(
                f"study {results.name}: another run of it is under way ({file.read() or 'just begun'}); wait "
                "for its end, or stop that one first"
            ) from None
    except OSError:  # a file system without locks, or without room for what only the sentence above needs
        pass
    _held[path] = file
