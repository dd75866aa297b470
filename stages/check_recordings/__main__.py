"""Command line: poses of a subject's recordings -> findings table, each finding printed."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.schemas.findings import unchecked
from shukotsu.stages import command_line, subject_stage

if TYPE_CHECKING:
    from shukotsu.checks.checked_recording import CheckedRecording
    from shukotsu.schemas.plan import SubjectPlan
    from shukotsu.schemas.study import Recording


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage check_recordings",
        "Test what was declared about recordings against what their poses say: units, orders, sides, swaps.",
        "shukotsu stage check_recordings --poses results/demo/sub-01/right/rom/poses.parquet "
        "--layout liberty16",
    )
    subject_stage.add_plan_options(parser, calibration="--poses")
    parser.add_argument("--out", type=Path, help="the findings table to write")
    return parser


def check(arguments: argparse.Namespace) -> None:
    """Check every recording of the subject that holds poses; print the findings, write them if asked to."""
    from shukotsu.schemas.catalogue import FINDINGS
    from shukotsu.schemas.plan import read_plan
    from shukotsu.schemas.tables import Provenance, columns_from_rows, write_table
    from shukotsu.sentences.finding_sentences import in_quotes

    if arguments.plan is not None:
        plan = read_plan(arguments.plan, arguments.inputs, checked=False)
    else:
        plan = subject_stage.plan_of(arguments)
    checked = check_subject(plan, arguments)
    rows = [row for recording, own in checked for row in _rows(recording, own)]
    for row in rows:
        name = " ".join(filter(None, (row["hand"], row["task"], row["trial"])))
        print(f"{name}: {row['severity']}: {row['kind']}: {in_quotes(row['message'])}")
    if not rows:
        print("no finding")
    if arguments.out is not None:
        digests = {"/".join(recording.key.values()): own.digest for recording, own in checked}
        provenance = Provenance.of(subject_stage.poses_files(plan), plan.folder, digests=digests)
        write_table(arguments.out, FINDINGS, columns_from_rows(FINDINGS, rows), provenance)


def check_subject(
    plan: SubjectPlan, arguments: argparse.Namespace
) -> list[tuple[Recording, CheckedRecording]]:
    """Check a subject's recordings, each alone and all against each other; one that cannot be has a note."""
    from shukotsu.checks.compared_recordings import compared
    from shukotsu.schemas.poses import usable_poses

    recordings = [own for own in plan.recordings if not own.exclude and usable_poses([plan.poses(own)])[0]]
    checked = [_checked(plan, own, arguments) for own in recordings]
    named = [
        (" ".join(filter(None, (own.task, own.trial))), own.hand.hand, one)
        for own, one in zip(recordings, checked, strict=True)
    ]
    with command_line.recorded(arguments, arguments.record_failure) as messages:
        checked = compared(named)
    if messages:
        checked = [replace(own, findings=(*own.findings, unchecked(messages[0]))) for own in checked]
    return list(zip(recordings, checked, strict=True))


def _checked(plan: SubjectPlan, recording: Recording, arguments: argparse.Namespace) -> CheckedRecording:
    from shukotsu.checks.checked_poses import checked_poses
    from shukotsu.checks.checked_recording import CheckedRecording

    path, hand = plan.poses(recording), recording.hand.hand
    with command_line.recorded(arguments, arguments.record_failure) as messages:
        return checked_poses(path, plan.layouts[hand])
    return CheckedRecording((unchecked(messages[0]),), "", None, None)


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write a note on every recording that it was not checked, and why."""
    from shukotsu.errors import InputError
    from shukotsu.schemas.catalogue import FINDINGS
    from shukotsu.schemas.plan import read_plan
    from shukotsu.schemas.tables import Provenance, columns_from_rows, write_table

    if arguments.out is None or arguments.plan is None:
        raise InputError(message)
    recordings = [
        own
        for own in read_plan(arguments.plan, arguments.inputs, checked=False).recordings
        if not own.exclude
    ]
    rows = [{**own.key, **unchecked(message).columns} for own in recordings]
    write_table(arguments.out, FINDINGS, columns_from_rows(FINDINGS, rows), Provenance((), {"digests": {}}))


def _rows(recording: Recording, checked: CheckedRecording) -> list[dict[str, Any]]:
    findings = [finding.accept(recording.accept) for finding in checked.findings]
    return [{**recording.key, **finding.columns} for finding in findings]


def main(argv: list[str] | None = None) -> int:
    """Run the stage; return its exit code."""
    return command_line.run(build_parser, argv, check, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
