"""What the Snakefile begins and ends with: the study, and what every rule has beside files and command."""

from __future__ import annotations

import logging
import os
import signal
import sys
from pathlib import Path
from typing import Any

from snakemake.dag import DAG
from snakemake.exceptions import WorkflowError
from snakemake.io import report
from snakemake.logging import logger
from snakemake.settings.types import Quietness

from shukotsu.errors import InputError
from shukotsu.resources import PACKAGE, ROOT
from shukotsu.workflow import made_from, one_run, warm_process
from shukotsu.workflow.file_digests import program_digest
from shukotsu.workflow.study_files import StudyFiles, study_file

CAPTIONS = PACKAGE / "report" / "captions"
"""Folder of what `snakemake --report` says of each result."""

WILDCARDS = dict.fromkeys(("subject", "hand", "task", "recording", "model"), "[^/]+") | {"hand": "right|left"}
"""What the wildcards of a path may be."""
LABELS = {"subject": "subject {}", "hand": "{} hand", "model": "model {}"}
"""What is said of a job's wildcards."""


def begin(workflow: Any, config: dict[str, Any], top: Path) -> StudyFiles:
    """Read the study that a workflow is of, and have what a run needs done as it starts and ends.

    top : the folder of the Snakefile. Raises WorkflowError where the study cannot be read.
    """
    if (top / "shukotsu").is_dir():  # a checkout, for jobs; not in their commands: it may move
        paths = [str(top), os.getenv("PYTHONPATH")]
        os.environ.update(PYTHONPATH=os.pathsep.join(filter(None, paths)))
    files = [top / "Snakefile", top / "workflow" / "Snakefile"]
    is_module = Path(workflow.main_snakefile).resolve() not in files  # of another Snakefile
    if not is_module:  # nothing is imported from the folder that this runs in
        os.environ.update(PYTHONSAFEPATH="1")
    # what the rules' commands begin with; by the environment, or a checkout that moved would run all again
    os.environ.update(SHUKOTSU_PYTHON=sys.executable, SHUKOTSU_STAGES=str(ROOT / "stages"))
    try:
        study = StudyFiles(study_file(workflow.configfiles, config, is_module))
        notes = [row.message for row in study.study.unusable] if workflow.is_main_process else []
        notes += [study.what_is_not_as_made()] if workflow.is_main_process else []
    except InputError as error:
        raise WorkflowError(str(error)) from None
    _note(*notes)
    DAG.check_output_mtime = _take_any_time
    workflow.global_wildcard_constraints(**WILDCARDS)
    is_quiet = Quietness.RULES in (workflow.output_settings.quiet or ())  # as `shukotsu run` asks
    if workflow.is_main_process and is_quiet:
        logger.addFilter(one_run.FailedJobs(workflow, study.results.folder))

    def end(*_: object) -> None:
        if is_quiet:
            logging.disable()  # that it was ended, whoever ended it says
        if not workflow.local_exec:  # jobs are cancelled then; what looked after them may sleep for long
            workflow.scheduler._executor.shutdown = lambda: os._exit(1)
        raise KeyboardInterrupt

    def start(_: Any) -> None:
        signal.signal(signal.SIGTERM, end)  # Snakemake's own handler waits for jobs, and for a lock for ever
        one_run.refuse(workflow, study.results.folder)
        with one_run.ending_in_a_sentence():
            _note(study.what_changed(), study.remove_former())
            study.write_changed_plans()
        warm_process.start()

    workflow.onstart(start)
    workflow.onsuccess(lambda _: made_from.keep(study.kept, workflow))
    workflow.onerror(lambda _: made_from.keep(study.kept, workflow))
    return study


async def _take_any_time(*_: object) -> None:
    """Take the place of Snakemake's test after a job, which has no option: it fails where an input's time is
    later than an output's, as that of a tracker whose clock is ahead. Content says what is out of date.
    """


def _note(*notes: str) -> None:
    for note in filter(None, notes):
        print(f"note: {note}", file=sys.stderr)


def complete(workflow: Any, study: StudyFiles, snakefile: str) -> None:
    """Set every rule's log and message of this Snakefile, and params by which Snakemake runs it again.

    These are the program's digest, and those of what inputs of these names say: the subject's plan, all
    plans, the study's configuration. A rule that uses a part of a plan has its own.
    """
    code = program_digest()
    params_of: dict[str, dict[str, Any]] = {
        "plan": {"plan": study.plan},
        "plans": {"plans": study.plans_digest},
        "configuration": {"configuration": study.configuration_digest, "study": study.options},
    }
    for rule in workflow.rules:
        if str(rule.snakefile) != snakefile or not rule.output:  # of a rule made of another it is no text
            continue
        names = [name for name in WILDCARDS if name in rule.wildcard_names]
        prefixes = {"subject": "sub-", "recording": ""}
        parts = [f"{prefixes.get(name, f'{name}-')}{{{name}}}" for name in names]
        path = f"/{'_'.join(parts)}" if names else ""
        rule.log_modifier = rule.output_modifier
        rule.set_log(f"{study.results.folder.as_posix()}/logs/{rule.name}{path}.log")
        shown = [LABELS.get(name, "{}").format(f"{{wildcards.{name}}}") for name in names]
        rule.message = f"{rule.name}: {', '.join(shown) or 'the study'}"
        if str(rule.output[0]).endswith("/plan.json"):  # changed plans are written when a run begins
            continue
        rule.set_params(code=code)
        named = {name for name, _ in rule.params._allitems()}
        for name, _ in list(rule.input._allitems()):
            more = params_of.get(name, {})
            rule.set_params(**{key: value for key, value in more.items() if key not in named})


def report_page(study: StudyFiles) -> Any:
    """Return the study's page, as a result of `snakemake --report`."""
    page, labels = str(study.results.report), {"page": study.study.name}
    caption = f"{CAPTIONS}/report.rst"
    return report(page, caption=caption, category="Study", labels=labels)


def report_figures(study: StudyFiles) -> list[Any]:
    """Return the study's figures for print, the drawings as results of `snakemake --report`."""
    figures: list[Any] = []
    for path in map(Path, study.figures):
        options = {"caption": f"{CAPTIONS}/{path.stem}.rst", "labels": {"figure": path.stem}}
        is_drawing = path.suffix == ".svg"
        figures.append(report(str(path), category="Figures", **options) if is_drawing else str(path))
    return figures
