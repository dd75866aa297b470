"""Results of former runs: removal of those that no longer belong to the study, and records of all outputs.

Snakemake's own records are not copied with the results, and users delete them. At its end a run stores for
every job what Snakemake compares (inputs, params, command), and the time and SHA-256 of each output. Before
the next run decides what to make, outputs are compared with these records. If an output's content is
unchanged, its lost record and time are restored, and Snakemake decides as usual. An output that was changed
after the run gets a record that matches no job, so that it is made again.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from snakemake.persistence import RECORD_FORMAT_VERSION, MetadataRecord
from snakemake.persistence.file import FilePersistence

from shukotsu.errors import InputError
from shukotsu.study import config_files, plan_file, results
from shukotsu.study.plan import SubjectPlan
from shukotsu.tables.whole_files import write_text
from shukotsu.workflow.file_digests import STAMP, FileDigests

COMPARED = {"rule", "input", "params", "code", "software_stack_hash", "record_format_version"}
"""Fields of Snakemake's record that it compares with the present job."""
NOT_AS_MADE = ["this file is not as a run left it"]
"""Params that mark the record of a changed output; no job has them."""
INSTALLED = {"<python>": sys.executable, "<config>": str(config_files.CONFIG_FOLDER)}
"""Placeholders in stored records for paths that depend on the installation."""
SAME_TIME_S = 1e-5
"""Times that differ by no more than this are equal: they were rounded."""
EXPORTED = ("sub-", "bids", "tables")
"""Beginnings of the names of exported files and folders."""


def recall(
    kept: Path, outputs: Collection[str], outdated: Collection[str], digests: FileDigests
) -> tuple[list[str], list[str]]:
    """Restore lost records and times of outputs.

    Return the outputs that were changed after a run, and those that an interrupted run left unfinished, which
    Snakemake makes again.

    kept : file of the stored records. outdated : outputs to make again even if their content is unchanged.
    """
    # Snakemake 9.27 has no public function that reads or writes the record of a path before there are jobs:
    # `metadata` needs a rule's file, and `finished` records a job as it is now, which would hide changes.
    memory = FilePersistence()
    entries = {path: (job, *entry) for job in _read(kept) for path, entry in job["outputs"].items()}
    spoiled = []
    paths = [path for path in dict.fromkeys((*entries, *outputs)) if Path(path).exists()]
    unfinished = memory._filter_incomplete_keys(paths)
    for path in paths:
        note = memory._read_record(path)
        is_marked = note is not None and note.params == NOT_AS_MADE
        job, digest, time_s = entries.get(path, ({}, "", None))
        if path in unfinished or (note is not None and not is_marked and note.endtime != time_s):
            continue  # Snakemake's own record is newer than the stored one
        if digests.content(path) == digest and path not in outdated:
            if note is None or is_marked or note.input != job["input"]:  # the installation moved
                compared = {name: job[name] for name in COMPARED}
                memory._write_record(path, MetadataRecord(**compared, endtime=time_s))
            stamp = Path(path, STAMP)  # Snakemake takes its file's time as that of the folder
            carrier = stamp if stamp.exists() else Path(path)
            if abs(carrier.stat().st_mtime - time_s) > SAME_TIME_S:
                with suppress(OSError):  # if it belongs to another user, it may be made again
                    os.utime(carrier, (time_s, time_s))
            continue
        spoiled.append(path)
        if not is_marked:
            mark = {"params": NOT_AS_MADE, "record_format_version": RECORD_FORMAT_VERSION}
            memory._write_record(path, MetadataRecord(**mark, endtime=time_s))
    digests.save()
    return spoiled, [path for path in paths if path in unfinished]


def keep(kept: Path, workflow: Any) -> None:
    """Store Snakemake's records of all outputs made since the last call."""
    jobs, digests = _read(kept), FileDigests()
    times = {path: time_s for job in jobs for path, (_, time_s) in job["outputs"].items()}
    for job in workflow.dag.jobs:
        notes = {str(path): workflow.persistence.metadata(path) for path in job.output if Path(path).exists()}
        new = {
            path: note
            for path, note in notes.items()
            if note is not None and note.params != NOT_AS_MADE and note.endtime not in (None, times.get(path))
        }
        if new and job.rule.name != "plan":  # plans are compared with the study itself
            for former in jobs:
                former["outputs"] = {path: e for path, e in former["outputs"].items() if path not in new}
            outputs = {path: [digests.content(path), note.endtime] for path, note in new.items()}
            jobs.append(next(iter(new.values())).model_dump(include=COMPARED) | {"outputs": outputs})
    kept_jobs = [job for job in jobs if any(Path(path).exists() for path in job["outputs"])]
    text = ",\n".join(json.dumps(job, ensure_ascii=False) for job in kept_jobs)
    for name, path in INSTALLED.items():
        text = text.replace(path, name)
    with suppress(OSError, InputError):  # the copy is needed only if Snakemake's records are lost
        write_text(kept, f"[\n{text}\n]\n")
    digests.save()


def _read(kept: Path) -> list[dict[str, Any]]:
    """Return the stored jobs, or an empty list if the file does not exist or is damaged."""
    try:
        text = kept.read_text("utf-8")
        for name, path in INSTALLED.items():
            text = text.replace(name, path)
        jobs: list[dict[str, Any]] = json.loads(text)
        for job in jobs:
            MetadataRecord(**{name: job[name] for name in COMPARED})
            job["outputs"] = {path: [str(digest), float(s)] for path, (digest, s) in job["outputs"].items()}
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return []
    return jobs


def remove_former_results(paths: results.Results, present: Collection[str]) -> list[str]:
    """Remove results that no longer belong to the study; return the names of the folders they were in.

    A subject's results are the files that follow from the plan in its folder; exports are recognised by their
    names. Other files are not touched. present : outputs of the study as it is now.
    """
    folders_of_exports = paths.exports, paths.new_dataset, paths.tidy_tables
    exports = [folder for folder in folders_of_exports if folder.as_posix() not in present]
    folders = [former.name for former in exports if _remove(_exported(former), paths.folder)]
    for path in sorted(paths.folder.glob("sub-*/plan.json")):
        plan = None
        with suppress(InputError):  # from a damaged plan it is unknown what was made
            plan = plan_file.read_plan(path)
        if plan is None or plan.folder != path.parent:
            continue
        files = [file for file in _files_of_subject(plan, paths, present) if file.as_posix() not in present]
        folders += [plan.folder.name] if _remove(files, paths.folder) else []
    return folders


def _remove(files: Iterable[Path], top: Path) -> bool:
    """Remove the files that exist and then empty folders below `top`; return whether any file was removed."""
    removed = [file for file in files if file.is_file()]
    for file in removed:
        file.unlink()
        with suppress(OSError):  # stop at the first folder that is not empty
            for folder in file.parents:
                if folder == top:
                    break
                folder.rmdir()
    return bool(removed)


def _exported(folder: Path) -> Iterator[Path]:
    """Yield the paths of exported files and folders in a folder."""
    yield from (f for f in sorted(folder.rglob("*")) if f.relative_to(folder).parts[0].startswith(EXPORTED))
    yield folder / STAMP


def _files_of_subject(plan: SubjectPlan, paths: results.Results, present: Collection[str]) -> Iterator[Path]:
    """Yield the paths of all results of a subject according to its plan."""
    yield plan.folder / "plan.json"
    yield from map(plan.poses, plan.recordings)
    yield from (plan.table(name) for name in results.SUBJECT_TABLES)
    for model in (*plan.fitted_models, config_files.REFERENCE):
        yield from (plan.table(name, hand, model) for hand in plan.hands for name in results.FIT_TABLES)
    pages, exports = paths.subject_pages(*plan.who), paths.subject_exports(*plan.who)
    if pages.as_posix() not in present:
        yield from (paths.recording_page(recording) for recording in plan.recordings)
        yield from (paths.subject_page(*plan.who), pages / results.FAILED_PAGES, pages / STAMP)
    if exports.as_posix() not in present:
        yield from _exported(exports)
