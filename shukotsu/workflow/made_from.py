"""Snakemake's records of every output, stored with the results, since copies lose them and users delete them.

The end of a run writes beside the logs, for every job, what Snakemake compares (inputs, params, command), and
of each output its time and the SHA-256 of its content. Before the next run decides what to make, outputs are
held against that. Where the content is as it was, notes and times that were lost are put back, and Snakemake
finds what differs from what would be made now. An output that differs from what a run left gets a record that
matches no job.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Any

from snakemake.persistence import RECORD_FORMAT_VERSION, MetadataRecord
from snakemake.persistence.file import FilePersistence

from shukotsu.errors import InputError
from shukotsu.study.config_files import CONFIG_FOLDER
from shukotsu.tables.whole_files import write_text
from shukotsu.workflow.file_digests import STAMP, FileDigests

COMPARED = {"rule", "input", "params", "code", "software_stack_hash", "record_format_version"}
"""Fields of Snakemake's note that it compares with a job of now."""
NOT_AS_MADE = ["this file is not as a run left it"]
"""Params of a record that matches no job."""
INSTALLED = {"<python>": sys.executable, "<config>": str(CONFIG_FOLDER)}
"""What stands for paths of this installation where notes are kept."""
SAME_TIME_S = 1e-5
"""Times stored as floating-point seconds differ by less."""


def recall(
    kept: Path, outputs: Collection[str], outdated: Collection[str], digests: FileDigests
) -> list[str]:
    """Put lost notes and times of outputs back; return those that are not as a run left them."""
    memory = FilePersistence()
    entries = {path: (job, *entry) for job in _read(kept) for path, entry in job["outputs"].items()}
    spoiled = []
    for path in dict.fromkeys((*entries, *outputs)):
        note = memory._read_record(path)
        is_marked = note is not None and note.params == NOT_AS_MADE
        job, digest, time_s = entries.get(path, ({}, "", None))
        if not Path(path).exists() or (note is not None and not is_marked and note.endtime != time_s):
            continue  # made since, or never kept: Snakemake knows more
        if digests.content(path) == digest and path not in outdated:
            if note is None or is_marked or note.input != job["input"]:  # the installation moved
                compared = {name: job[name] for name in COMPARED}
                memory._write_record(path, MetadataRecord(**compared, endtime=time_s))
            stamp = Path(path, STAMP)  # a folder's time is that of Snakemake's file in it
            carrier = stamp if stamp.exists() else Path(path)
            if abs(carrier.stat().st_mtime - time_s) > SAME_TIME_S:
                with suppress(OSError):  # somebody else's: it is made anew at most
                    os.utime(carrier, (time_s, time_s))
            continue
        spoiled.append(path)
        if not is_marked:
            mark = {"params": NOT_AS_MADE, "record_format_version": RECORD_FORMAT_VERSION}
            memory._write_record(path, MetadataRecord(**mark, endtime=time_s))
    digests.save()
    return spoiled


def keep(kept: Path, workflow: Any) -> None:
    """Write down what Snakemake noted of the outputs that its jobs have made since this was done last."""
    jobs, digests = _read(kept), FileDigests()
    times = {path: time_s for job in jobs for path, (_, time_s) in job["outputs"].items()}
    for job in workflow.dag.jobs:
        notes = {str(path): workflow.persistence.metadata(path) for path in job.output if Path(path).exists()}
        new = {
            path: note
            for path, note in notes.items()
            if note is not None and note.params != NOT_AS_MADE and note.endtime not in (None, times.get(path))
        }
        if new and job.rule.name != "plan":  # which is held against the study itself
            for former in jobs:
                former["outputs"] = {path: e for path, e in former["outputs"].items() if path not in new}
            outputs = {path: [digests.content(path), note.endtime] for path, note in new.items()}
            jobs.append(next(iter(new.values())).model_dump(include=COMPARED) | {"outputs": outputs})
    there = [job for job in jobs if any(Path(path).exists() for path in job["outputs"])]
    text = ",\n".join(json.dumps(job, ensure_ascii=False) for job in there)
    for name, path in INSTALLED.items():
        text = text.replace(path, name)
    with suppress(OSError, InputError):  # without it results are made anew where Snakemake's notes are lost
        write_text(kept, f"[\n{text}\n]\n")
    digests.save()


def _read(kept: Path) -> list[dict[str, Any]]:
    """Return the jobs that are kept; none where the file is absent, damaged or of any other shape."""
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
