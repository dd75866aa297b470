"""Export of selected recordings under selected models in selected formats."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TypeVar

from shukotsu import command_line
from shukotsu.errors import InputError, StorageError
from shukotsu.export.exported_motion import file_stem, read_motion
from shukotsu.export.motion_bids import write_dataset_files
from shukotsu.export.registry import FORMATS, ExportSettings, chosen_formats, settings_of, write_format
from shukotsu.hand.posed_recording import recording_reader
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.sheets import PARTICIPANTS, read_sheet
from shukotsu.study.study import Recording
from shukotsu.tables.whole_files import write_text

T = TypeVar("T")


def export_plans(plans: Mapping[Path, SubjectPlan], arguments: argparse.Namespace) -> None:
    """Write every selected recording under every selected model in every format; print notes on stderr.

    After a failure, the other files are still written. The InputError is raised at the end or, with
    --record-failure, written to STEM_FORMAT.failed.txt (STEM.failed.txt if it concerns all formats).
    """
    formats, settings = chosen_formats(arguments.formats), settings_of(arguments)
    chosen = [
        (plan, model, recording)
        for path, plan in plans.items()
        for model in chosen_models(plan, path, arguments.model)
        for recording in chosen_recordings(plan, path, arguments.hand, arguments.recording)
    ]
    if "bids" in formats:
        _describe_dataset(list(plans.values()), arguments)
    failures: list[tuple[str, str]] = []
    _forget_failures(arguments.out, _failure_name(arguments))
    for plan, model, recording in chosen:
        failures += _export_recording(plan, recording, model, formats, settings, arguments)
    for stem, message in failures if arguments.record_failure else ():
        print(f"error: {message}", file=sys.stderr)
        write_text(arguments.out / f"{stem}.failed.txt", f"{message}\n")
    if arguments.record_failure:  # also for a subject without anything to export
        arguments.out.mkdir(parents=True, exist_ok=True)
    elif failures:
        raise InputError("; ".join(dict.fromkeys(message for _, message in failures)))


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the reason why nothing was exported to a text file named after the folder of the first plan."""
    write_text(arguments.out / f"{_failure_name(arguments)}.failed.txt", f"{message}\n")


def _describe_dataset(plans: Sequence[SubjectPlan], arguments: argparse.Namespace) -> None:
    """Write the files that describe a dataset, unless a subject is added to an existing dataset."""
    path = arguments.out / FORMATS["bids"].shared
    if path.exists() and len(plans) == 1 and arguments.participants is None:
        return
    participants: dict[str, dict[str, object]] = {plan.who.subject: {} for plan in plans}
    for row in read_sheet(arguments.participants, PARTICIPANTS):
        if row["subject"] in participants:
            participants[row["subject"]] = {n: value for n, value in row.values.items() if n != "subject"}
    write_dataset_files(path.parent, plans[0].study, participants, arguments.licence)


def _export_recording(
    plan: SubjectPlan,
    recording: Recording,
    model: str,
    formats: Sequence[str],
    settings: ExportSettings,
    arguments: argparse.Namespace,
) -> Iterator[tuple[str, str]]:
    """Write one recording under one model; yield the file stem and message of each failure."""
    stem = file_stem(plan.who, recording.hand.hand, recording.task, recording.trial, model)
    _forget_failures(arguments.out, stem, *(f"{stem}_{name}" for name in formats))
    reader = recording_reader(plan, recording, model)
    motion, trouble = _try(arguments, lambda: read_motion(reader, arguments.licence, arguments.frames))
    if motion is None:
        yield stem, trouble
        return
    if suspect := [each.title for each in plan.suspect if each.hand == recording.hand]:
        reason = f"there are findings on {', '.join(suspect)}"
        motion = motion.noting(f"the report leaves this hand out of its statistics: {reason}")
    for note in motion.notes:
        print(f"note: {note}", file=sys.stderr)
    for name in formats:
        path = arguments.out / (FORMATS[name].shared or f"{stem}{FORMATS[name].extensions[0]}")
        remarks, trouble = _try(arguments, partial(write_format, motion, settings, name, path))
        if remarks is None:
            yield f"{stem}_{name}", trouble
            continue
        for remark in remarks:
            print(f"{name}: {remark}", file=sys.stderr)
        print(path)


def _try(arguments: argparse.Namespace, make: Callable[[], T]) -> tuple[T | None, str]:
    """Return the result of `make`, or None and the message of its failure.

    A failure is bad input or, with --record-failure, a bug.
    """
    try:
        with command_line.keep_failure(arguments, arguments.record_failure, only_bugs=True) as messages:
            return make(), ""
    except StorageError:
        raise  # not caused by this recording
    except InputError as error:
        return None, str(error)
    return None, messages[0]


def _failure_name(arguments: argparse.Namespace) -> str:
    """Return the stem of the file that reports the failure of a whole export: the first plan's folder."""
    return str(arguments.plan[0].absolute().parent.name)


def _forget_failures(folder: Path, *names: str) -> None:
    """Remove the failure files of an earlier run."""
    for name in names:
        with suppress(PermissionError):  # writing will fail as well and be reported
            (folder / f"{name}.failed.txt").unlink(missing_ok=True)


def chosen_models(plan: SubjectPlan, path: Path, names_list: str) -> list[str]:
    """Return the models in a comma-separated list, or all models of the plan if it is empty.

    path : the plan's file, for messages. Raises InputError for an unknown model.
    """
    names = list(dict.fromkeys(name.strip() for name in names_list.split(",") if name.strip()))
    for name in names:
        if name not in plan.models:
            raise InputError(f"--model: {path} has no model {name!r}; it has {', '.join(plan.models)}")
    return names or list(plan.models)


def chosen_recordings(plan: SubjectPlan, path: Path, hand: str, name: str) -> list[Recording]:
    """Return the recordings to export.

    hand : right or left, or empty for both. name : the task, or TASK_TRIAL, of any recording, or empty for
    all evaluated ones. path : the plan's file, for messages. Raises InputError if the name does not match
    exactly one recording of a hand.
    """
    if hand and hand not in plan.hands:
        raise InputError(
            f"--hand: {path} has no {hand} hand of {plan.who.label!r}; it has {', '.join(plan.hands)}"
        )
    chosen: list[Recording] = []
    for side in (hand,) if hand else plan.hands:
        if not name:
            chosen += plan.evaluated(side)
            continue
        of_hand = [recording for recording in plan.recordings if recording.hand.hand == side]
        named = [r for r in of_hand if name in (r.name, r.task, f"{r.task}_{r.trial}")]
        exact = [r for r in named if name in (r.name, f"{r.task}_{r.trial}") or not r.trial]
        if len(exact or named) != 1:
            raise InputError(
                f"--recording: {name!r} is not one recording of the {side} hand of {path}; expected one of "
                f"{', '.join(recording.name for recording in of_hand)}"
            )
        chosen += exact or named
    return chosen
