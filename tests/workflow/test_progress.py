"""Progress of a running study: an updated line on terminals, plain lines elsewhere, and all errors."""

import io
import logging
import re
from types import SimpleNamespace

import pytest
from program_files import REPOSITORY

from shukotsu.workflow.progress import STAGES, TARGET, Progress

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
