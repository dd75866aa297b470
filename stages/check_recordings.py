"""Command line: check a subject's recordings; print the findings and write the findings table."""

from __future__ import annotations

import argparse
from pathlib import Path

from shukotsu import command_line
from shukotsu.study import subject_stage


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage check_recordings",
        "Check what was declared about recordings against their poses: units, orders, hands, swaps.",
        "shukotsu stage check_recordings --poses results/demo/sub-01/right/rom/poses.parquet "
        "--layout liberty16",
    )
    subject_stage.add_plan_options(parser, calibration="--poses")
    parser.add_argument("--out", type=Path, help="the findings table to write")
    return parser


def check(arguments: argparse.Namespace) -> None:
    """Check every recording of the subject that has poses; print the findings and, with --out, write them."""
    from shukotsu.checks.checked_subject import check_subject
    from shukotsu.tables.catalogue import FINDINGS
    from shukotsu.tables.typed_table import Provenance, columns_from_rows, write_table

    plan = subject_stage.plan_of(arguments)
    checked = check_subject(plan, arguments)
    rows = []
    for recording, of_recording in checked:
        for finding in (each.accept(recording.accept) for each in of_recording.findings):
            rows.append({**recording.key, **finding.columns})
            print(f"{' '.join(filter(None, recording.key_in_session))}: {finding.line}")
    if not rows:
        print("no finding")
    if arguments.out is not None:
        digests = {"/".join(recording.key.values()): checks.digest for recording, checks in checked}
        provenance = Provenance.of(subject_stage.poses_files(plan), plan.folder, digests=digests)
        write_table(arguments.out, FINDINGS, columns_from_rows(FINDINGS, rows), provenance)


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write, for every recording, a finding which states that it was not checked, and why."""
    from shukotsu.errors import InputError
    from shukotsu.study.findings import unchecked_finding
    from shukotsu.tables.catalogue import FINDINGS
    from shukotsu.tables.typed_table import Provenance, columns_from_rows, write_table

    if arguments.out is None:
        raise InputError(message)
    plan = subject_stage.plan_of(arguments)
    recordings = [recording for recording in plan.recordings if not recording.exclude]
    rows = [{**recording.key, **unchecked_finding(message).columns} for recording in recordings]
    write_table(arguments.out, FINDINGS, columns_from_rows(FINDINGS, rows), Provenance((), {"digests": {}}))


main = command_line.script(build_parser, check, record_bug=record_bug)


if __name__ == "__main__":
    raise SystemExit(main())
