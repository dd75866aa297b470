"""All recordings of a subject, checked each alone and against each other."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace

from shukotsu import command_line
from shukotsu.checks.checked_poses import checked_poses
from shukotsu.checks.checked_recording import CheckedRecording
from shukotsu.checks.compared_recordings import compared
from shukotsu.study.findings import unchecked
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.tables.poses import usable_poses


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
