"""One run of a study: its study file, its lock, its progress, and reports of why a job failed.

The operating system releases the lock, which allows only one run at a time, when the process ends.
Snakemake's own lock remains after a run was killed, so the shipped profiles switch it off (`nolock`).
`shukotsu run` shows the progress: one updated line on a terminal, else a line per tenth of the jobs.
Snakemake's own messages then go only to its log file, except for warnings and errors.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import shutil
import socket
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from shukotsu.errors import InputError, count_of, on_one_line
from shukotsu.study.config_files import as_yaml_1_1, check_config, read_config, read_yaml, yaml_text
from shukotsu.tables.subjects import path_token
from shukotsu.tables.whole_files import write_text

DEMO = Path("config", "demo.yaml")
"""Study file of a run without --configfile."""
FOLDER = Path(".snakemake")
HANDED = "SHUKOTSU_HELD"
"""Environment variable with the descriptor of the lock file that Snakemake inherits from `shukotsu run`."""
_held: dict[Path, TextIO] = {}
"""Lock files by path; they stay open until this process ends."""


def study_file(files: Sequence[Path], config: Mapping[str, Any], is_module: bool) -> Path:
    """Return the study file: Snakemake's --configfile, or the demo's in the working directory.

    is_module : whether this workflow is a module of another one, whose `config` is then a study. Its file is
    the one of `files` with this content, or else is written to the working directory. Raises InputError if
    there are several files, or if --config would change values, since stages read the file itself.
    """
    if is_module:
        for path in map(Path, files):
            if read_yaml(path, "study") == config:
                return path
        content = json.loads(json.dumps(config))  # plain mappings and lists
        check_config(content, "study", "config")
        path = Path(f"{path_token(content['study'])}.module.yaml")
        if not path.is_file() or read_yaml(path, "study") != content:
            write_text(path, yaml_text(content))
        return path
    if len(files) > 1:
        raise InputError("--configfile: names several files; expected that of one study")
    path = Path(files[0]) if files else DEMO
    if config and dict(config) not in (read_config(path, "study", with_defaults=False), as_yaml_1_1(path)):
        raise InputError(f"--config: a study's settings come from its file only; write them into {path}")
    return path


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
                no_room = "no room is left for files (No space left on device); make room and run again"
                self._print(record, no_room, [])
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


SHOWN = "SHUKOTSU_SHOWN"
"""Environment variable in which `shukotsu run` passes what to show: PROGRESS or EVERYTHING."""
PROGRESS, EVERYTHING = "progress", "everything"

STAGES: Mapping[str, tuple[str, int]] = {
    "plan": ("planning", 1),
    "simulate": ("simulating a recording", 6),
    "stream": ("simulating the tracker", 2),
    "capture": ("reading a recording", 1),
    "check_recordings": ("checking recordings", 4),
    "align_events": ("aligning events", 1),
    "solve_joints": ("solving joints", 2),
    "project_planes": ("placing joints on their planes", 1),
    "fit_hand": ("fitting the hand", 12),
    "estimate_metacarpals": ("estimating metacarpals", 3),
    "evaluate_tips": ("comparing fingertips with the recordings", 4),
    "evaluate_skeletons": ("scoring the skeletons", 3),
    "measure_movement": ("measuring movement", 5),
    "gather": ("collecting tables", 1),
    "compare_models": ("comparing models", 3),
    "compare_movement": ("comparing movement", 1),
    "export": ("exporting", 5),
    "export_dataset": ("exporting the data set", 5),
    "export_tables": ("exporting tables", 2),
    "collect_exports": ("collecting exports", 1),
    "report": ("writing the report", 2),
    "subject_pages": ("writing the subject's pages", 3),
    "print_figures": ("drawing figures", 5),
}
"""What the jobs of each rule do, and how many seconds a job takes in the demo, to weight the time left."""
TARGET = "all"
"""Snakemake's rule that only lists the targets."""
OF_STUDY = "the study"
"""Message of a job that belongs to no single subject."""


class Progress(logging.Filter):
    """Filter that replaces Snakemake's messages to a stream with the progress of the run.

    The time left is estimated from the time so far and the weights of finished and unfinished jobs.
    """

    def __init__(self, workflow: Any, stream: TextIO) -> None:
        super().__init__()
        self.workflow, self.stream = workflow, stream
        self.began_s = 0.0
        self.total = self.started = self.ended = self.failed = 0
        self.left = self.weight = 0
        self.rule_of: dict[int, str] = {}
        self.line = ""

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether Snakemake should show a message: warnings and errors other than reports of jobs."""
        event, details = str(getattr(record, "event", "")), record.__dict__
        if event == "job_info":
            self._start(details["jobid"], details["rule_name"], details["rule_msg"] or "")
        elif event == "job_finished":
            self._end(details["job_id"])
        elif event == "job_error":
            self.failed += 1
        is_shown = record.levelno >= logging.WARNING and event not in ("job_error", "group_error")
        is_shown |= record.getMessage().startswith("Nothing to be done")
        if is_shown:
            self.clear()
        return is_shown

    def close(self, logs: Iterable[str]) -> None:
        """Erase the progress line; if jobs failed, print how many and where the log is."""
        self.clear()
        if self.failed:
            failed = f"{self.failed} of {count_of(self.total, 'job')} failed, for the reasons above"
            print(f"{failed}; Snakemake's log: {', '.join(logs)}", file=self.stream, flush=True)

    def clear(self) -> None:
        """Erase the progress line before other output."""
        if self.line and self.stream.isatty():
            print("\r\033[K", end="", file=self.stream, flush=True)
        self.line = ""

    def _start(self, job: int, rule: str, message: str) -> None:
        if not self.total:
            rules = [each.rule.name for each in self.workflow.dag.needrun_jobs()]
            weights = [_weight(each) for each in rules if each != TARGET]
            self.total, self.weight = len(weights), sum(weights)
            self.left = self.weight
            self.began_s = time.monotonic()
        if rule == TARGET:
            return
        self.started += 1
        self.rule_of[job] = rule
        doing = STAGES.get(rule, (rule, 1))[0]
        about = message.partition(": ")[2].removeprefix(OF_STUDY)
        self.line = f"job {self.started} of {self.total}{self._time_left()}: {doing}{about and f', {about}'}"
        if self.stream.isatty():
            width = shutil.get_terminal_size().columns - 1
            print(f"\r\033[K{self.line[:width]}", end="", file=self.stream, flush=True)

    def _end(self, job: int) -> None:
        if job not in self.rule_of:
            return
        self.ended += 1
        self.left -= _weight(self.rule_of[job])
        is_tenth = self.ended * 10 // self.total > (self.ended - 1) * 10 // self.total
        if is_tenth and not self.stream.isatty():
            done = f"{self.ended} of {count_of(self.total, 'job')} done{self._time_left()}"
            print(done, file=self.stream, flush=True)

    def _time_left(self) -> str:
        if self.left > 0.9 * self.weight or not self.left:  # too early to estimate, or done
            return ""
        left_s = (time.monotonic() - self.began_s) * self.left / (self.weight - self.left)
        text = f"{left_s / 60:.0f} min" if left_s >= 90 else f"{left_s:.0f} s"
        return f", about {text} left"


def _weight(rule: str) -> int:
    return STAGES.get(rule, (rule, 1))[1]
