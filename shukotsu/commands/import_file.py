"""Command line: a recording's file -> its poses table, and what was declared of it and cannot be."""

from __future__ import annotations

import argparse
import sys

from shukotsu import command_line
from shukotsu.readers.import_recording import build_parser, import_recording, record_failure


def import_and_check(arguments: argparse.Namespace) -> None:
    """Import the recording; but in a study, where a rule checks, print what cannot be as declared."""
    from shukotsu.checks.checked_subject import checked_poses
    from shukotsu.study.findings import in_quotes
    from shukotsu.study.layout import read_layout
    from shukotsu.tables.poses import BYTES_A_POSE, KEPT_BYTES, frame_count

    import_recording(arguments)
    if arguments.record_failure:
        return
    layout = read_layout(arguments.layout).of_hand(arguments.hand)
    if frame_count(arguments.out) * len(layout.measured) * BYTES_A_POSE > KEPT_BYTES // 4:
        print(f"note: {arguments.file}: long; check it with shukotsu stage check_recordings", file=sys.stderr)
        return
    for finding in checked_poses(arguments.out, layout).findings:
        sentence = in_quotes(finding.message)
        print(f"{finding.severity}: {arguments.file}: {finding.kind}: {sentence}", file=sys.stderr)


def main(argv: list[str]) -> int:
    """Import and check; return the exit code."""
    return command_line.run(build_parser, argv, import_and_check, record_failure)
