"""What the Snakefile runs at its start and end: read the study, and set what all rules share."""

from __future__ import annotations

import logging
import os
import shlex
import signal
import sys
from pathlib import Path
from typing import Any

from snakemake.dag import DAG
from snakemake.exceptions import WorkflowError
from snakemake.io import report
from snakemake.logging import logger

from shukotsu import job
from shukotsu.command_line import option_of
from shukotsu.errors import InputError
from shukotsu.resources import PACKAGE, ROOT
from shukotsu.tables.whole_files import write_text
from shukotsu.workflow import file_digests, former_results, one_run, study_files, warm_process

CAPTIONS = PACKAGE / "report" / "captions"
"""Folder of the captions that `snakemake --report` uses."""

WILDCARDS = dict.fromkeys(("subject", "hand", "task", "recording", "model"), "[^/]+") | {"hand": "right|left"}
"""Regular expressions of the values of wildcards."""
STAGES = '"$SHUKOTSU_PYTHON" -IS "$SHUKOTSU_JOB" "$SHUKOTSU_STAGES"'
"""Start of the rules' commands. If it contained paths, a moved checkout would run everything again."""
DEFAULT_LIMIT = (100, 1)
"""Snakemake's default of --max-jobs-per-timespan, 100/1s, in jobs and s."""
LABELS = {"subject": "subject {}", "hand": "{} hand", "model": "model {}"}
"""Wildcards in the wording of messages."""


def begin(workflow: Any, config: dict[str, Any], top: Path) -> study_files.StudyFiles:
    """Read the study of a workflow, and register the functions that run when it starts and ends.

    top : the folder of the Snakefile. Raises WorkflowError if the study cannot be read.
    """
    if (top / "shukotsu").is_dir():  # a checkout: its path must not be in the commands of jobs
        paths = [str(top), os.getenv("PYTHONPATH")]
        os.environ.update(PYTHONPATH=os.pathsep.join(filter(None, paths)))
    files = [top / "Snakefile", top / "workflow" / "Snakefile"]
    is_module = Path(workflow.main_snakefile).resolve() not in files  # used by another Snakefile
    if not is_module:  # do not import modules from the working directory
        os.environ.update(PYTHONSAFEPATH="1")
    os.environ.update(SHUKOTSU_PYTHON=sys.executable, SHUKOTSU_JOB=job.__file__)
    os.environ.update(SHUKOTSU_STAGES=str(ROOT / "stages"))
    try:
        study = study_files.StudyFiles(one_run.study_file(workflow.configfiles, config, is_module))
        notes = [row.message for row in study.study.unusable] if workflow.is_main_process else []
        notes += [*study.changed_results(), study.font_note()] if workflow.is_main_process else []
    except InputError as error:
        raise WorkflowError(str(error)) from None
    _note(*notes)
    DAG.check_output_mtime = _take_any_time
    workflow.global_wildcard_constraints(**WILDCARDS)
    shown = os.getenv(one_run.SHOWN) if workflow.is_main_process else None
    line = one_run.Progress(workflow, sys.stderr)
    if shown:
        logger.addFilter(one_run.FailedJobs(workflow, study.results.folder))
    for handler in logger.handlers if shown == one_run.PROGRESS and not workflow.dryrun else ():
        if handler.name == "DefaultStreamHandler":  # the terminal's, not the log file's
            handler.addFilter(line)

    def end(*_: object) -> None:
        line.clear()
        if shown:
            logging.disable()  # `shukotsu run` reports the signal
        if not workflow.local_exec:  # jobs on a cluster are cancelled, but their threads may sleep for long
            workflow.scheduler._executor.shutdown = lambda: os._exit(1)
        raise KeyboardInterrupt

    def start(_: Any) -> None:
        if workflow.local_exec:
            workflow.scheduler.job_rate_limiter = chosen_limit(workflow.scheduler.job_rate_limiter)
        signal.signal(signal.SIGTERM, end)  # Snakemake's own may wait for a lock forever
        one_run.refuse(workflow, study.results.folder)
        with one_run.ending_in_a_sentence():
            _note(study.what_changed(), study.remove_former())
            for path, text in study.changed_plans().items():  # no rule makes an existing plan again
                write_text(path, text)
        warm_process.start()

    workflow.onstart(start)

    def finish(logs: list[str]) -> None:
        line.close(logs)
        former_results.keep(study.kept, workflow)

    workflow.onsuccess(finish)
    workflow.onerror(finish)
    return study


def chosen_limit(limiter: Any) -> Any:
    """Return Snakemake's limit of jobs per time span, or None in place of its default.

    The default is of no use on one machine, and leaves one timer per finished job, each of which looks
    through all ready jobs every second. Snakemake does not tell whether a user has chosen the same values.
    """
    is_default = limiter is not None and (limiter.max_jobs, limiter.timespan) == DEFAULT_LIMIT
    return None if is_default else limiter


async def _take_any_time(*_: object) -> None:
    """Replace Snakemake's check after a job, which cannot be switched off by an option.

    The check fails if an input is newer than an output, as a file is from a tracker whose clock is ahead.
    Here contents decide what is out of date.
    """


def _note(*notes: str) -> None:
    for note in filter(None, notes):
        print(f"note: {note}", file=sys.stderr)


def complete(workflow: Any, study: study_files.StudyFiles, snakefile: str) -> None:
    """Set every rule's log, message, parts of its command, and the params whose change triggers a rerun.

    These params are the program's digest, and the digests of the subject's plan, of all plans and of the
    study's configuration for rules that have them as inputs. A rule that depends on only a part of a plan
    sets that part's digest itself.
    """
    code = file_digests.program_digest()
    params_of: dict[str, dict[str, Any]] = {
        "plan": {"plan": study.plan},
        "plans": {"plans": study.plans_digest},
        "configuration": {"configuration": study.configuration_digest, "study": study.options},
    }
    for rule in workflow.rules:
        if str(rule.snakefile) != snakefile or not rule.output:  # str: it may be a path object
            continue
        names = [name for name in WILDCARDS if name in rule.wildcard_names]
        prefixes = {"subject": "sub-", "recording": ""}
        parts = [f"{prefixes.get(name, f'{name}-')}{{{name}}}" for name in names]
        path = f"/{'_'.join(parts)}" if names else ""
        rule.log_modifier = rule.output_modifier
        rule.set_log(f"{study.results.folder.as_posix()}/logs/{rule.name}{path}.log")
        shown = [LABELS.get(name, "{}").format(f"{{wildcards.{name}}}") for name in names]
        rule.message = f"{rule.name}: {', '.join(shown) or one_run.OF_STUDY}"
        rule.set_params(stages=STAGES)
        if str(rule.output[0]).endswith("/plan.json"):  # changed plans are written when a run starts
            continue
        rule.set_params(code=code)
        if "{params.arguments}" in rule.shellcmd:
            rule.set_params(arguments=arguments)
        named = {name for name, _ in rule.params._allitems()}
        for name, _ in list(rule.input._allitems()):
            more = params_of.get(name, {})
            rule.set_params(**{key: value for key, value in more.items() if key not in named})


def arguments(_: Any, input: Any, output: Any) -> str:  # noqa: A002 - Snakemake passes them by these names
    """Return a job's named inputs and outputs as options of its stage, such as `--poses FILE`."""
    words: list[str] = []
    for name, files in (*input.items(), *output.items()):
        words += [option_of(name), *([files] if isinstance(files, str) else files)]
    return shlex.join(words)


def report_page(study: study_files.StudyFiles) -> Any:
    """Return the study's page, marked for inclusion in `snakemake --report`."""
    page, labels = str(study.results.report), {"page": study.study.name}
    return report(page, caption=f"{CAPTIONS}/report.rst", category="Study", labels=labels)


def report_figures(study: study_files.StudyFiles) -> list[Any]:
    """Return the study's figures for print; SVG files are marked for inclusion in `snakemake --report`."""
    figures: list[Any] = []
    for path in map(Path, study.figures):
        caption = str(path.with_suffix(".txt").absolute())
        options = {"caption": caption, "labels": {"figure": path.stem}}
        is_drawing = path.suffix == ".svg"
        figures.append(report(str(path), category="Figures", **options) if is_drawing else str(path))
    return figures
