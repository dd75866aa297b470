"""Lock that allows only one run of a study at a time, and reports of why a job failed.

The operating system releases this lock when the process ends. Snakemake's own lock remains after a run was
killed, so the shipped profiles switch it off (`nolock`).
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
"""Environment variable with the descriptor of the lock file that Snakemake inherits from `shukotsu run`."""
_held: dict[Path, TextIO] = {}
"""Lock files by path; they stay open until this process ends."""


def hold(results: Path) -> TextIO | None:
    """Lock a study's results folder until this process ends; return the lock file.

    The lock file names the process that holds the lock. A child process that inherits the file keeps the lock
    and writes its own name when it calls this function. Raises InputError if another run holds the lock. On a
    file system without locks every run is allowed. Returns None if the lock file cannot be written.
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
                "until it ends, or stop it first"
            ) from None
    except OSError:  # a file system without locks, or too full to write the name of this process
        pass
    _held[path] = file
    return file


def refuse_unwritable(paths: Iterable[str | Path]) -> None:
    """Raise InputError if any of the files or folders cannot be written, replaced or created."""
    refused: set[Path] = set()
    for path in map(Path, paths):
        above = next(folder for folder in path.parents if os.path.lexists(folder))
        if not above.is_dir():
            raise InputError(f"{above}: is not a folder, but results go into a folder there; move it away")
        refused |= {each for each in (above, path) if each.exists() and not os.access(each, os.W_OK)}
    if refused:
        names = sorted((path.absolute() for path in refused), key=lambda path: (len(path.parts), path))
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        raise InputError(
            f"{names[0]}{more}: cannot be written (no permission, or a read-only disk); change that "
            "(chmod -R u+w), or run in a folder of your own, where results are written"
        )


COMMAND_FAILED = "RuleException:\nCalledProcessError"
FULL_BYTES = 1 << 16
"""Free space below which a disk is reported as full."""
FULL = (errno.ENOSPC, errno.EDQUOT)
ENDED_BY_SIGNAL, SIGNALS_ARRIVE_S = ("interrupted", "ended by SIG"), 0.5
"""Beginnings of messages of jobs that a signal ended, and the time by which it has reached all processes."""


class FailedJobs(logging.Filter):
    """Filter that replaces Snakemake's reports of failed jobs with the reason for the failure.

    It ends the run with exit code 2 if outputs cannot be written.
    """

    def __init__(self, workflow: Any, results: Path) -> None:
        super().__init__()
        self.workflow, self.results = workflow, results
        self.is_full = False
        self.began_s = time.time() - 0.1  # file times come from a coarser clock
        logging.raiseExceptions = False  # on a full disk, every log line would print an error

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether Snakemake should print a message; print why a job failed in place of its report."""
        event, details = str(getattr(record, "event", "")), record.__dict__
        if event.endswith("group_error"):
            self._print(record, f"jobs of group {details['groupid']} failed", details["aux_logs"])
        elif event.endswith("job_error"):
            self._print_job(record)
        elif getattr(record, "exception", "") == "ProtectedOutputException":
            refuse(self.workflow, self.results)
        text = record.getMessage()
        if any(f"[Errno {number}]" in text for number in FULL):  # Snakemake cannot write its own files
            if not self.is_full:
                self._print(
                    record, "no room is left for files (No space left on device); make room and run again", []
                )
            self.is_full = True
            return False
        return not text.startswith(COMMAND_FAILED)

    def _print_job(self, record: logging.LogRecord) -> None:
        """Print why a job failed, unless it succeeded or never began and another job of its group failed."""
        details: dict[str, Any] = record.__dict__
        dag = self.workflow.dag
        message = next(job.message for job in dag.jobs if dag.jobid(job) == details["jobid"])
        log = Path(details["log"][0])
        was_run = log.exists() and log.stat().st_mtime >= self.began_s
        if details["indent"] and (not was_run or all(Path(path).exists() for path in details["output"])):
            return
        why = reason(log, details["output"]) or details["rule_msg"] or "it ended without an error message"
        if why.startswith(ENDED_BY_SIGNAL):
            time.sleep(SIGNALS_ARRIVE_S)  # if this process gets the signal too, it prints no more
        self._print(record, f"{message}: {why}", details["log"])

    def _print(self, record: logging.LogRecord, sentence: str, logs: list[str]) -> None:
        shown = f" (log: {', '.join(logs)})" if logs else ""
        logging.getLogger(record.name).error(f"error: {sentence}{shown}")


def reason(log: Path, outputs: list[str]) -> str:
    """Return why a job failed: the last line of its log, or that the disk is full, or an empty string."""
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
    """Exit with code 2 if another run has locked the study, or if an output or log cannot be written."""
    with ending_in_a_sentence():
        hold(results)
        refuse_unwritable(path for job in workflow.dag.needrun_jobs() for path in (*job.output, *job.log))


@contextmanager
def ending_in_a_sentence() -> Iterator[None]:
    """Print an InputError and exit with code 2; Snakemake would report it as a bug."""
    try:
        yield
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
