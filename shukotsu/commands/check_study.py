"""Read a study and its recordings as a run would, and report faults and files outside its folder."""

from __future__ import annotations

import io
import os
import tempfile
from argparse import Namespace
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from itertools import groupby
from operator import attrgetter
from pathlib import Path

from shukotsu import command_line
from shukotsu.checks.checked_subject import check_subject, copies
from shukotsu.commands import import_file, read_files
from shukotsu.errors import InputError, count_of, list_names
from shukotsu.study.config_files import CONFIG_FOLDER
from shukotsu.study.findings import EXIT_CODES, REFUSED, Finding
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording, unmatched_rows, unused_columns
from shukotsu.tables.line_printer import progress
from shukotsu.tables.poses import usable_poses
from shukotsu.workflow.study_files import StudyFiles, import_options

NamedFinding = tuple[str, int, str]
"""Name of a recording or hand, an exit code, and a sentence about the recording or hand."""


def check_study(path: Path) -> int:
    """Print a summary of a study, what it reads outside its folder, and the findings on its recordings.

    Return the exit code: 2 if something cannot be read or used, else 1 if something is suspect, else 0.
    """
    files = read_files(path)
    study = files.study
    sizes = {"subject": study.subjects, "recording": study.recordings, "model": study.models}
    counts = ", ".join(count_of(len(each), noun) for noun, each in sizes.items())
    print(f"{path}: study {study.name}, {counts}")
    notes = (*unmatched_rows(study), *unused_columns(study), *_outside(path, files))
    for note in (*(row.message for row in study.unusable), *notes):
        print(f"note: {note}")
    recordings_by_finding: dict[str, list[str]] = {}
    status = 2 if study.unusable else 0
    for name, code, sentence in _findings_of_recordings(files):
        status = max(status, code)
        recordings_by_finding.setdefault(sentence, []).append(name)
    for sentence, names in recordings_by_finding.items():
        print(f"{list_names(names)}: {sentence}")
    print("" if recordings_by_finding else "no finding in any recording\n", end="")
    return status


def _outside(path: Path, files: StudyFiles) -> Iterator[str]:
    """Yield, for each folder outside the study's, a sentence on what the study reads there.

    Symbolic links are followed.
    """
    shipped, folder = CONFIG_FOLDER, path.resolve().parent
    read = [*map(Path, files.configuration), *(recording.source.file for recording in files.study.recordings)]
    read += [each.source.mapping for each in files.study.recordings if each.source.mapping is not None]
    real = {Path(os.path.realpath(each)) for each in read}  # a link to itself is kept as it is
    outside = [each for each in real if not (each.is_relative_to(folder) or each.is_relative_to(shipped))]
    ordered = sorted(outside, key=lambda each: (each.parent, each.name))
    for parent, group in groupby(ordered, attrgetter("parent")):
        names = [each.name for each in group]
        if len(names) == 1:
            yield f"reads {parent / names[0]}, outside the study's folder"
        else:
            what = f"{count_of(len(names), 'file')} in {parent}"
            yield f"reads {what}, outside the study's folder: {', '.join(names)}"


def _findings_of_recordings(files: StudyFiles) -> list[NamedFinding]:
    """Import all recordings into a temporary folder and return the findings on them."""
    total = sum(not recording.exclude for plan in files.subjects for recording in plan.recordings)
    findings: list[NamedFinding] = []
    digests: list[tuple[Recording, str]] = []
    done = 0
    with progress("recordings read", total) as tell, tempfile.TemporaryDirectory() as folder:
        for plan in files.subjects:
            recordings = [recording for recording in plan.recordings if not recording.exclude]
            poses = {r.key_in_session: Path(folder, f"{done + n}.parquet") for n, r in enumerate(recordings)}
            for recording in recordings:  # as in a run, a table states why a recording cannot be read
                output = io.StringIO()
                file = poses[recording.key_in_session]
                argv = ["--record-failure", *import_options(recording), f"--out={file}"]
                with redirect_stderr(output), redirect_stdout(output):
                    status = import_file.main(argv)
                if status > 128:
                    raise command_line.Ended(status - 128)
                if status:
                    raise InputError(output.getvalue().strip().removeprefix("error: "))
                done += 1
                tell(done)
            imported = replace(plan, recordings=tuple(recordings), named_poses=poses)
            findings += _findings_of_subject(imported, files, digests)
            for file in poses.values():
                file.unlink()
    return findings + [_named_finding(_name(recording), finding) for recording, finding in copies(digests)]


def _findings_of_subject(
    plan: SubjectPlan, files: StudyFiles, digests: list[tuple[Recording, str]]
) -> list[NamedFinding]:
    """Return the findings on a subject's recordings, and why recordings cannot be read.

    A missing file that a run makes, because the study simulates it, is not a fault.
    Each recording is appended to `digests` with the digest of its poses.
    """
    findings = [
        (_name(recording), 0, "simulated: not made yet, so not checked; `shukotsu run` makes it")
        if files.is_simulated(recording) and reason.startswith(f"{recording.source.file.name}: no such file")
        else (_name(recording), 2, f"cannot be read: {reason}")
        for recording in plan.recordings
        for reason in usable_poses([plan.poses(recording)])[1]
    ]
    for recording, checked in check_subject(plan, Namespace(stage="check_recordings", record_failure=True)):
        accepted = (finding.accept(recording.accept) for finding in checked.findings)
        findings += [_named_finding(_name(recording), finding) for finding in accepted]
        digests.append((recording, checked.digest))
    for hand in plan.hands:
        who = plan.hand(hand)
        name = " ".join(filter(None, (who.subject, who.session, who.hand)))
        if not plan.all_calibrating(hand):
            findings.append(_named_finding(name, Finding("hand", REFUSED, "uncalibrated")))
        if plan.rows["measurements"]:
            from shukotsu.fit.calibration import measurements_of  # late, as it is slow to import

            try:
                measurements_of(plan, hand, plan.layouts[hand])
            except InputError as error:
                findings.append((name, 2, f"refused: {error}"))
    return findings


def _named_finding(name: str, finding: Finding) -> NamedFinding:
    return name, EXIT_CODES[finding.severity], f"{finding.severity}: {finding.kind}: {finding.message}"


def _name(recording: Recording) -> str:
    return " ".join(filter(None, recording.key.values()))
