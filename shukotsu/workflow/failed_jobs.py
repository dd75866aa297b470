"""Why a job failed, in its own sentence: what Snakemake prints under `--quiet rules` is its command alone."""

from __future__ import annotations

import logging
import shutil
import sys
import time
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError, on_one_line
from shukotsu.workflow import one_run

COMMAND_FAILED = "RuleException:\nCalledProcessError"
FULL_BYTES = 1 << 16
"""A disk with less room is full."""


class FailedJobs(logging.Filter):
    """Adds to Snakemake's messages why a job failed; ends the run with 2 where outputs may not be written."""

    def __init__(self, workflow: Any, results: Path) -> None:
        super().__init__()
        self.workflow, self.results = workflow, results
        self.began_s = time.time() - 0.1  # times of files are by a coarser clock
        logging.raiseExceptions = False  # a log that a full disk takes no more is not named line by line

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether Snakemake is to print a message; its reports of failed jobs it leaves out by itself."""
        event, details = str(getattr(record, "event", "")), record.__dict__
        if event.endswith("group_error"):
            self._print(record, f"jobs of group {details['groupid']} failed", details["aux_logs"])
        elif event.endswith("job_error"):
            self._print_job(record)
        elif getattr(record, "exception", "") == "ProtectedOutputException":
            refuse(self.workflow, self.results)
        return not record.getMessage().startswith(COMMAND_FAILED)

    def _print_job(self, record: logging.LogRecord) -> None:
        """Print why a job failed; nothing of a job of a group that did not, or was not begun."""
        details: dict[str, Any] = record.__dict__
        dag = self.workflow.dag
        message = next(job.message for job in dag.jobs if dag.jobid(job) == details["jobid"])
        log = Path(details["log"][0])
        was_run = log.exists() and log.stat().st_mtime >= self.began_s
        if details["indent"] and (not was_run or all(Path(path).exists() for path in details["output"])):
            return
        why = reason(log, details["output"]) or details["rule_msg"] or "it ended without a word"
        self._print(record, f"{message}: {why}", details["log"])

    def _print(self, record: logging.LogRecord, sentence: str, logs: list[str]) -> None:
        shown = f" (log: {', '.join(logs)})" if logs else ""
        logging.getLogger(record.name).error(f"error: {sentence}{shown}")


def reason(log: Path, outputs: list[str]) -> str:
    """Return the last line of a job's log, which says why it failed; of a full disk where it holds none."""
    text = log.read_text("utf-8", "replace").strip() if log.exists() else ""
    if text:
        last = on_one_line(text.splitlines()[-1].removeprefix("error: "))
        return f"internal error: {last}" if "Traceback (most" in text else last
    folder = next(path for path in log.parents if path.exists())
    if shutil.disk_usage(folder).free < FULL_BYTES:
        return f"{outputs[0]}: cannot be written (No space left on device); make room and run again"
    return ""


def refuse(workflow: Any, results: Path) -> None:
    """End the run with 2 where another one holds the study, or an output or log to do may not be written."""
    try:
        one_run.hold(results)
        one_run.refuse_unwritable(
            path for job in workflow.dag.needrun_jobs() for path in (*job.output, *job.log)
        )
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
