"""All recordings of a subject, checked each alone and against each other."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pyarrow.compute as pc

from shukotsu import command_line
from shukotsu.checks.checked_recording import LEFT_OUT, CheckedRecording, check_recording
from shukotsu.checks.compared_recordings import compared
from shukotsu.checks.hypotheses import Declared
from shukotsu.study.findings import unchecked
from shukotsu.study.layout import Layout
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.poses import read_poses, recording_name, usable_poses
from shukotsu.tables.typed_table import read_metadata, read_row_groups


def checked_poses(path: Path, layout: Layout, hand: str | None = None) -> CheckedRecording:
    """Check what was declared about a poses file's recording; hand : in place of its own."""
    parameters = read_metadata(path)["parameters"]
    declared = Declared.of(parameters.get("mapping"), parameters.get("orientation", ""))
    side = hand or recording_name(path).hand
    poses, broken = read_poses(path, layout.measured), parameters.get("breaks", ())
    return check_recording(poses, layout, side, declared, _left_out(path), broken)


def _left_out(path: Path) -> dict[str, Counter[str]]:
    """Return how many poses have each flag in LEFT_OUT that there is, by segment."""
    flagged: dict[str, Counter[str]] = {flag: Counter() for flag in LEFT_OUT}
    for rows in read_row_groups(path, POSES, ["segment", "flags"]):
        for flag, counts in flagged.items():
            counts.update(rows.filter(pc.match_substring(rows["flags"], flag))["segment"].to_pylist())
    return {flag: counts for flag, counts in flagged.items() if counts}


def check_subject(plan: SubjectPlan, arguments: Namespace) -> list[tuple[Recording, CheckedRecording]]:
    """Check a subject's recordings, each alone and all against each other; one that cannot be has a note.

    arguments : of a command line: stage, record_failure.
    """
    recordings = [r for r in plan.recordings if not r.exclude and usable_poses([plan.poses(r)])[0]]
    checked = [_checked(plan, recording, arguments) for recording in recordings]
    named = [
        (" ".join(filter(None, (recording.task, recording.trial))), recording.hand.hand, checks)
        for recording, checks in zip(recordings, checked, strict=True)
    ]
    with command_line.recorded(arguments, arguments.record_failure) as messages:
        checked = compared(named)
    if messages:
        note = unchecked(messages[0])
        checked = [replace(checks, findings=(*checks.findings, note)) for checks in checked]
    return list(zip(recordings, checked, strict=True))


def _checked(plan: SubjectPlan, recording: Recording, arguments: Namespace) -> CheckedRecording:
    with command_line.recorded(arguments, arguments.record_failure) as messages:
        return checked_poses(plan.poses(recording), plan.layouts[recording.hand.hand])
    return CheckedRecording((unchecked(messages[0]),), "", None, None)
