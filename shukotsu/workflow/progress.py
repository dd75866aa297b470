"""Progress that `shukotsu run` shows: one updated line on a terminal, else a line per tenth of the jobs.

Snakemake's own messages go only to its log file, except for warnings and errors.
"""

from __future__ import annotations

import logging
import shutil
import time
from collections.abc import Iterable, Mapping
from typing import Any, TextIO

from shukotsu.errors import count_of

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
            print(
                f"{self.ended} of {count_of(self.total, 'job')} done{self._time_left()}",
                file=self.stream,
                flush=True,
            )

    def _time_left(self) -> str:
        if self.left > 0.9 * self.weight or not self.left:  # too early to estimate, or done
            return ""
        left_s = (time.monotonic() - self.began_s) * self.left / (self.weight - self.left)
        text = f"{left_s / 60:.0f} min" if left_s >= 90 else f"{left_s:.0f} s"
        return f", about {text} left"


def _weight(rule: str) -> int:
    return STAGES.get(rule, (rule, 1))[1]
