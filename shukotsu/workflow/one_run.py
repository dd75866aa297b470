"""One run of a study at a time, by a lock of the system, which ends with its process, however that ends.

Snakemake's own lock outlives a run that was killed; the profiles that ship leave it out (`nolock`).
"""

from __future__ import annotations

import os
import socket
from collections.abc import Iterable
from pathlib import Path
from typing import TextIO

from shukotsu.errors import InputError

FOLDER = Path(".snakemake")
HANDED = "SHUKOTSU_HELD"
"""Environment variable: the number of the lock's file, which `shukotsu run` holds and hands to Snakemake."""
_held: dict[Path, TextIO] = {}
"""By their paths; open as long as this process lives."""


def hold(results: Path) -> TextIO | None:
    """Hold the study with that results folder until this process ends; return the lock's file.

    Raises InputError where another run holds it. Where there are no locks, none does. A process that is
    handed the file holds it too, and is the one that is named from then on.
    """
    import fcntl

    path = FOLDER.absolute() / f"shukotsu-run-{results.name}.lock"
    if path in _held:
        return _held[path]
    try:
        path.parent.mkdir(exist_ok=True)
        handed = os.environ.pop(HANDED, None)
        file = os.fdopen(int(handed), "a+") if handed else path.open("a+", encoding="utf-8")
    except OSError:  # a folder that cannot be written to: Snakemake says so
        return None
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
    return file


def refuse_unwritable(paths: Iterable[str | Path]) -> None:
    """Raise InputError where one of the files or folders may not be written, replaced or made."""
    refused: set[Path] = set()
    for path in map(Path, paths):
        above = next(folder for folder in path.parents if folder.exists())
        refused |= {each for each in (above, path) if each.exists() and not os.access(each, os.W_OK)}
    if refused:
        names = sorted((path.absolute() for path in refused), key=lambda path: (len(path.parts), path))
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        raise InputError(
            f"{names[0]}{more}: may not be written (by its rights, or on a read-only disk); change that "
            "(chmod -R u+w), or run in a folder that is yours: results go there"
        )
