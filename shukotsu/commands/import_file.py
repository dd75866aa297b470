"""Command line: convert a recording's file to a poses table, and check it against its declared properties."""

from __future__ import annotations

import argparse
import sys

from shukotsu import command_line
from shukotsu.errors import count_of
from shukotsu.readers.import_recording import build_parser, import_recording, record_failure


def import_and_check(arguments: argparse.Namespace) -> None:
    """Import the recording; outside a study, where no rule checks it, print a summary and the findings."""
    import numpy as np

    from shukotsu.checks.checked_subject import checked_poses
    from shukotsu.study.findings import in_quotes
    from shukotsu.study.layout import read_layout
    from shukotsu.study.recording_summary import sum_poses
    from shukotsu.tables.poses import BYTES_A_POSE, KEPT_BYTES, frame_count

    import_recording(arguments)
    if arguments.record_failure:
        return
    n_rows, n_valid, time_s = sum_poses(arguments.out)
    worn = [count for count in n_valid.values() if count]
    length = f"{np.ptp(known):.1f} s" if (known := time_s[np.isfinite(time_s)]).size else "no times"
    gaps = len(time_s) * len(worn) - sum(worn)
    print(
        f"{arguments.out}: {count_of(n_rows, 'row')}, {count_of(len(worn), 'receiver')}, {length}, "
        f"{count_of(gaps, 'pose')} of them missing"
    )
    layout = read_layout(arguments.layout).of_hand(arguments.hand)
    if frame_count(arguments.out) * len(layout.measured) * BYTES_A_POSE > KEPT_BYTES // 4:
        print(f"note: {arguments.file}: long; check it with shukotsu stage check_recordings", file=sys.stderr)
        return
    for finding in checked_poses(arguments.out, layout).findings:
        sentence = in_quotes(finding.message)
        print(f"{finding.severity}: {arguments.file}: {finding.kind}: {sentence}", file=sys.stderr)


main = command_line.script(build_parser, import_and_check, record_failure)
