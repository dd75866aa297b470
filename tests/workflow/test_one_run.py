"""One run of a study: a lock that ends with its process, its progress, and messages about failed jobs.

Progress is an updated line on terminals, plain lines elsewhere, and all errors. For a failed job its own
sentence is printed, for a full disk the file, but not Snakemake's command.
"""

import io
import logging
import os
import re
import subprocess
from collections import namedtuple
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from program_files import REPOSITORY, started

from shukotsu.errors import InputError
from shukotsu.workflow import one_run
from shukotsu.workflow.one_run import COMMAND_FAILED, STAGES, TARGET, FailedJobs, Progress, reason

STUDY = Path("results", "demo")
HOLD = (
    "import pathlib; from shukotsu.workflow import one_run; "
    f"one_run.hold(pathlib.Path('{STUDY}')); print(1, flush=True); input()"
)


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[subprocess.Popen[str]]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(one_run, "_held", {})
    process = started(HOLD)
    yield process
    process.kill()
    process.communicate()


def test_a_second_run_of_a_study_is_refused(run: subprocess.Popen[str]) -> None:
    for _ in range(2):
        with pytest.raises(
            InputError,
            match=rf"^study demo: another run of it is under way \(process {run.pid} on .+\); wait",
        ):
            one_run.hold(STUDY)
    one_run.hold(Path("results", "demo2"))


def test_a_killed_run_does_not_block_others(run: subprocess.Popen[str]) -> None:
    run.kill()
    run.wait()
    for _ in range(2):
        one_run.hold(STUDY)


def test_a_folder_that_cannot_be_written_to_is_left_to_snakemake(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(one_run, "FOLDER", Path("/dev/null/.snakemake"))
    one_run.hold(STUDY)


Disk = namedtuple("Disk", ("f_bavail", "f_frsize", "f_files", "f_favail"))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("warning: a\nerror: a.parquet: is cut off; remove it\n", "a.parquet: is cut off; remove it"),
        ("Traceback (most recent call last):\n  x\nKeyError: 'a'\n", "internal error: KeyError: 'a'"),
        ("", "out.parquet: cannot be written (No space left on device); make room and run again"),
    ],
)
def test_a_log_has_the_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, why: str) -> None:
    log = tmp_path / "a.log"
    log.write_text(text)
    for disk in (Disk(0, 4096, 9, 9), Disk(99, 4096, 9, 0)):
        monkeypatch.setattr(os, "statvfs", lambda _, disk=disk: disk)
        assert reason(log, ["out.parquet"]) == why


def test_the_reason_replaces_snakemakes_report_of_the_failed_command(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging, "raiseExceptions", True)
    job = SimpleNamespace(message="plan: subject 01")
    dag = SimpleNamespace(jobs=[job], jobid=lambda _: 1)
    log = tmp_path / "a.log"
    shown = FailedJobs(SimpleNamespace(dag=dag), tmp_path)
    values = {"event": "job_error", "jobid": 1, "output": ["none"], "log": [str(log)], "rule_msg": None}
    shown.filter(logging.makeLogRecord({"name": "a", "msg": "", **values, "indent": True}))
    assert caplog.messages == []
    log.write_text("error: no\n")
    for indent in (False, True):
        shown.filter(logging.makeLogRecord({"name": "a", "msg": "", **values, "indent": indent}))
    assert caplog.messages == [f"error: plan: subject 01: no (log: {log})"] * 2
    assert not shown.filter(logging.makeLogRecord({"msg": f"{COMMAND_FAILED} in file"}))
    assert shown.filter(logging.makeLogRecord({"msg": "WorkflowError"}))
    caplog.clear()
    full = logging.makeLogRecord({"name": "a", "msg": "Traceback\nOSError: [Errno 28] No space left"})
    assert (shown.filter(full), shown.filter(full)) == (False, False)
    assert len(caplog.messages) == 1
    assert caplog.messages[0].startswith("error: no room is left for files")


def test_unwritable_outputs_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "made").touch()
    one_run.refuse_unwritable([tmp_path / "made", tmp_path / "new" / "file"])
    with pytest.raises(InputError, match=r"made: is not a folder, but results go into a folder there"):
        one_run.refuse_unwritable([tmp_path / "made" / "new" / "file"])
    monkeypatch.setattr(os, "access", lambda path, _: path != tmp_path / "made")
    with pytest.raises(InputError, match=r"made: cannot be written \(no permission"):
        one_run.refuse_unwritable([tmp_path / "made", tmp_path / "new" / "file"])


RULES = ["capture", "fit_hand", "report", TARGET]


class Terminal(io.StringIO):
    """A stream that reports to be a terminal."""

    def isatty(self) -> bool:
        """Return True."""
        return True


def shown(stream: io.StringIO) -> list[str]:
    """Run three jobs, the second of which fails, and return the lines written; only the error message is
    passed on.
    """
    jobs = [SimpleNamespace(rule=SimpleNamespace(name=name)) for name in RULES]
    progress = Progress(SimpleNamespace(dag=SimpleNamespace(needrun_jobs=lambda: jobs)), stream)
    kept = []

    def log(message: str, level: int = logging.INFO, **details: object) -> None:
        if progress.filter(logging.makeLogRecord({"msg": message, "levelno": level, **details})):
            kept.append(message)

    log("Select jobs to execute...")
    for number, rule in enumerate(RULES):
        about = "the study" if rule == "report" else "subject 01"
        log("", event="job_info", jobid=number, rule_name=rule, rule_msg=f"{rule}: {about}")
        if rule == "fit_hand":
            log("long", logging.ERROR, event="job_error", jobid=number)
            log("error: why", logging.ERROR)
        else:
            log("Finished", event="job_finished", job_id=number)
    progress.close(["a.log"])
    assert kept == ["error: why"]
    return re.split(r"\r\x1b\[K|\n", stream.getvalue())


def test_a_terminal_shows_one_updated_line() -> None:
    first, *lines = shown(Terminal())
    assert first == ""
    assert lines == [
        "job 1 of 3: reading a recording, subject 01",
        "job 2 of 3: fitting the hand, subject 01",
        "",  # erased for the error
        "job 3 of 3: writing the report",
        "1 of 3 jobs failed, for the reasons above; Snakemake's log: a.log",
        "",
    ]


def test_without_a_terminal_progress_is_printed_as_lines() -> None:
    lines = [re.sub(r"about \d+ s", "about N s", line) for line in shown(io.StringIO())]
    assert lines == [
        "1 of 3 jobs done",
        "2 of 3 jobs done, about N s left",
        "1 of 3 jobs failed, for the reasons above; Snakemake's log: a.log",
        "",
    ]


def test_every_rule_has_a_description_for_the_progress_line() -> None:
    rules = re.findall(r"^rule (\w+):", (REPOSITORY / "Snakefile").read_text("utf-8"), re.MULTILINE)
    assert {*rules} - {TARGET} == {*STAGES}
    assert not [doing for doing, _ in STAGES.values() if "_" in doing]


@pytest.mark.parametrize("columns", [20, 200])
def test_the_progress_line_fits_the_terminal(columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    assert max(len(line) for line in shown(Terminal())[:-2]) == min(columns - 1, 43)
