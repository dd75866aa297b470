"""Allow one run of a study at a time, by a system lock; report why a job failed.

The system releases its lock when the process ends. Snakemake's own lock remains after a killed run, so the
shipped profiles switch it off (`nolock`).
"""

from __future__ import annotations

import errno
import logging
import os
import socket
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from shukotsu.errors import InputError, on_one_line

FOLDER = Path(".snakemake")
HANDED = "SHUKOTSU_HELD"
"""Environment variable: descriptor of the lock file, which Snakemake inherits from `shukotsu run`."""
_held: dict[Path, TextIO] = {}
"""Lock files by path; they stay open until this process ends."""


def hold(results: Path) -> TextIO | None:
    """Lock a study's results folder until this process ends; return the lock file.

    Raises InputError where another run holds the lock. A file system without locks allows any run. A process
    that inherits the file holds the lock as well, and is named in it from then on.
    """
    import fcntl

    path = FOLDER.absolute() / f"shukotsu-run-{results.name}.lock"
    if path in _held:
        return _held[path]
    try:
        path.parent.mkdir(exist_ok=True)
        handed = os.environ.pop(HANDED, None)
        file = os.fdopen(int(handed), "a+") if handed else path.open("a+", encoding="utf-8")
    except OSError:  # Snakemake reports that the folder is not writable
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
    """Raise InputError where one of the files or folders cannot be written, replaced or created."""
    refused: set[Path] = set()
    for path in map(Path, paths):
        above = next(folder for folder in path.parents if os.path.lexists(folder))
        if not above.is_dir():
            raise InputError(f"{above}: is no folder, and results go into a folder there; move it away")
        refused |= {each for each in (above, path) if each.exists() and not os.access(each, os.W_OK)}
    if refused:
        names = sorted((path.absolute() for path in refused), key=lambda path: (len(path.parts), path))
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        raise InputError(
            f"{names[0]}{more}: may not be written (by its rights, or on a read-only disk); change that "
            "(chmod -R u+w), or run in a folder that is yours: results go there"
        )


COMMAND_FAILED = "RuleException:\nCalledProcessError"
FULL_BYTES = 1 << 16
"""A disk with less free space counts as full."""
FULL = (errno.ENOSPC, errno.EDQUOT)
ENDED_BY_SIGNAL, SIGNALS_ARRIVE_S = ("interrupted", "ended by SIG"), 0.5
"""How the messages of such jobs begin, and within which time all processes have the signal."""


class FailedJobs(logging.Filter):
    """Add to Snakemake's messages why a job failed; exit with 2 where outputs cannot be written."""

    def __init__(self, workflow: Any, results: Path) -> None:
        super().__init__()
        self.workflow, self.results = workflow, results
        self.is_full = False
        self.began_s = time.time() - 0.1  # times of files are by a coarser clock
        logging.raiseExceptions = False  # on a full disk, every line of a log would cause an error message

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether Snakemake should print a message; its own reports of failed jobs are replaced."""
        event, details = str(getattr(record, "event", "")), record.__dict__
        if event.endswith("group_error"):
            self._print(record, f"jobs of group {details['groupid']} failed", details["aux_logs"])
        elif event.endswith("job_error"):
            self._print_job(record)
        elif getattr(record, "exception", "") == "ProtectedOutputException":
            refuse(self.workflow, self.results)
        text = record.getMessage()
        if any(f"[Errno {number}]" in text for number in FULL):  # of Snakemake's own files, with a traceback
            if not self.is_full:
                self._print(
                    record, "no room is left for files (No space left on device); make room and run again", []
                )
            self.is_full = True
            return False
        return not text.startswith(COMMAND_FAILED)

    def _print_job(self, record: logging.LogRecord) -> None:
        """Print why a job failed; print nothing for jobs of its group that succeeded or never began."""
        details: dict[str, Any] = record.__dict__
        dag = self.workflow.dag
        message = next(job.message for job in dag.jobs if dag.jobid(job) == details["jobid"])
        log = Path(details["log"][0])
        was_run = log.exists() and log.stat().st_mtime >= self.began_s
        if details["indent"] and (not was_run or all(Path(path).exists() for path in details["output"])):
            return
        why = reason(log, details["output"]) or details["rule_msg"] or "it ended without an error message"
        if why.startswith(ENDED_BY_SIGNAL):
            time.sleep(SIGNALS_ARRIVE_S)  # that of this process, if it was sent one too, ends its messages
        self._print(record, f"{message}: {why}", details["log"])

    def _print(self, record: logging.LogRecord, sentence: str, logs: list[str]) -> None:
        shown = f" (log: {', '.join(logs)})" if logs else ""
        logging.getLogger(record.name).error(f"error: {sentence}{shown}")


def reason(log: Path, outputs: list[str]) -> str:
    """Return the last line of a job's log, which states the reason, or that the disk is full."""
    text = log.read_text("utf-8", "replace").strip() if log.exists() else ""
    if text:
        last = on_one_line(text.splitlines()[-1].removeprefix("error: "))
        return f"internal error: {last}" if "Traceback (most" in text else last
    folder = next(path for path in log.parents if path.exists())
    disk = os.statvfs(folder)  # some file systems do not count files
    if disk.f_bavail * disk.f_frsize < FULL_BYTES or (disk.f_files and not disk.f_favail):
        return f"{outputs[0]}: cannot be written (No space left on device); make room and run again"
    return ""


def refuse(workflow: Any, results: Path) -> None:
    """Exit with 2 where another run holds the study, or an output or log cannot be written."""
    with ending_in_a_sentence():
        hold(results)
        refuse_unwritable(path for job in workflow.dag.needrun_jobs() for path in (*job.output, *job.log))


@contextmanager
def ending_in_a_sentence() -> Iterator[None]:
    """Exit with 2 on an InputError, which Snakemake would report as a bug."""
    try:
        yield
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
