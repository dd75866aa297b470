"""A run of a study: no other run of it beside it, and what it made still there when it ends.

Snakemake locks the files of a run and does not say for whom, so that after a kill nobody knows whether the
lock still holds. Here a run also holds a lock of the system, which ends with its process, however that ends.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import socket
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TextIO

from schemas.errors import InputError

FOLDER = Path(".snakemake")
LOOKS = re.compile(
    r"-[pqrkFn]*n[pqrkFn]*|-S|-D|-l|--(dag|d3dag|filegraph|rulegraph|summary|detailed-summary|report|archive|"
    r"lint|unlock|nolock|dry-run|dryrun|cleanup-metadata|list.*)(=.*)?"
)
"""Options of Snakemake with which it makes nothing, or is to mind no lock."""
MOST_NAMED = 3
_PATIENCE_S = 1.0

_RECORD_BYTES = 256

_held: dict[Path, TextIO] = {}
"""By their paths; open as long as this process lives."""


def begin(results: Path, words: Sequence[str]) -> list[str]:
    """Hold the study until this process ends, and remove what a killed run has left of Snakemake's locks;
    give sentences that say so.

    It comes before Snakemake locks anything, so that whenever a run is killed, its locks are known for its.
    results : the study's folder. words : of Snakemake's command line; a run that only looks holds nothing.
    Raises InputError where another run of the study is under way, unless this one only looks.
    """
    looks = any(map(LOOKS.fullmatch, words))
    notes = _clear_the_way(results, looks)
    if not looks:
        _hold(results)
    return notes


def _clear_the_way(results: Path, looks: bool) -> list[str]:
    try:
        file = _file_of(results).open("r", encoding="utf-8")
    except OSError:  # there was no run
        return []
    with file:
        run = _read(file)
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError as error:
            if looks or _file_of(results).absolute() in _held:
                return []
            raise _under_way(results, run) from error
        except OSError:  # a file system without locks
            return []
        if run.get("host") != socket.gethostname():  # a system's lock need not reach to another machine
            return []
        if not _remove_locks(results):
            return []
    return [f"the run of process {run['process']} was killed; its lock is removed, and this one goes on"]


def _hold(results: Path) -> None:
    """Hold the study; where that cannot be, Snakemake's own lock is all there is."""
    path, end = _file_of(results), time.monotonic() + _PATIENCE_S
    if _file_of(results).absolute() in _held:
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o666), "r+", encoding="utf-8")
    except OSError:  # a folder that cannot be written to: Snakemake will say so
        return
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            break
        except BlockingIOError as error:
            if time.monotonic() > end:
                with file:
                    raise _under_way(results, _read(file)) from error
            time.sleep(0.05)  # somebody may just be looking whether it is held
        except OSError:  # a file system without locks
            file.close()
            return
    record = json.dumps({"process": os.getpid(), "host": socket.gethostname()})
    with suppress(OSError):  # a full disk: the lock holds all the same
        os.pwrite(file.fileno(), record.ljust(_RECORD_BYTES).encode(), 0)  # at once: never half a record
    _held[path.absolute()] = file


def _under_way(results: Path, run: Mapping[str, Any]) -> InputError:
    return InputError(
        f"study {results.name}: another run of it is under way (process {run.get('process', '?')} on "
        f"{run.get('host', 'this machine')}); wait for its end, or stop that one first"
    )


def gone(outputs: Iterable[Iterable[str]]) -> str:
    """Say which of the files that jobs have made are gone; empty where none is.

    outputs : of each job, as Snakemake has them: those in a storage elsewhere are not looked for here.
    """
    made = {path for files in outputs for path in files if not getattr(path, "is_storage", False)}
    missing = sorted(str(path) for path in made if not os.path.lexists(path))
    if not missing:
        return ""
    more = f" and {len(missing) - MOST_NAMED} more" if len(missing) > MOST_NAMED else ""
    return (
        f"{', '.join(missing[:MOST_NAMED])}{more}: made by this run and removed while it went on; "
        "run the same command again, which makes what is missing"
    )


def _file_of(results: Path) -> Path:
    return FOLDER / f"shukotsu-run-{results.name}.json"


def _read(file: TextIO) -> dict[str, Any]:
    try:
        run = json.load(file)
    except ValueError:
        return {}
    return run if isinstance(run, dict) else {}


def _remove_locks(results: Path) -> list[Path]:
    """Remove Snakemake's locks of files of that study."""
    start, removed = f"{results.as_posix()}/", []
    for path in sorted((FOLDER / "locks").glob("*.lock")):
        if any(line.startswith(start) for line in path.read_text("utf-8").splitlines()):
            path.unlink()
            removed.append(path)
    return removed
