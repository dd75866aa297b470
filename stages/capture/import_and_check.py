"""Command line: a recording's file -> its poses table, and what was declared of it and cannot be.

In a study, a rule imports and another one checks.
"""

from __future__ import annotations

import argparse
import sys

from shukotsu.stages import command_line
from shukotsu.stages.capture.import_recording import build_parser, import_recording, record_failure


def import_and_check(arguments: argparse.Namespace) -> None:
    """Import the recording; say what cannot be as declared, an hour being left to check_recordings."""
    from shukotsu.checks.checked_poses import checked_poses
    from shukotsu.schemas.layout import read_layout
    from shukotsu.schemas.poses import BYTES_A_POSE, KEPT_BYTES, frame_count
    from shukotsu.sentences.finding_sentences import in_quotes

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
    """Run the command; give its exit code."""
    return command_line.run(build_parser, argv, import_and_check, record_failure)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
