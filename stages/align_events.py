"""Command line: align events from files and sheets with the recordings' clocks."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu import command_line
from shukotsu.study import subject_stage

if TYPE_CHECKING:
    from shukotsu.movement.recording_events import RecordingEvents
    from shukotsu.study.plan import SubjectPlan
    from shukotsu.tables.parts import Part

WRITES = {"out": "events", "out_clocks": "clocks"}


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage align_events",
        "Align events with a recording's clock: MIDI notes, markers, sync pulses and buttons of the tracker.",
        "shukotsu stage align_events --poses poses.parquet --events take1.mid --pulses 'note 24 = sync' "
        "--recording take1.arrows --out events.parquet --out-clocks clocks.parquet",
    )
    add = parser.add_argument
    add("--plan", type=Path, help="the subject's plan, in place of the options of a recording alone")
    poses = "the recording's poses table; with --plan all of the subject's (default: those that it names)"
    add("--poses", type=Path, nargs="*", default=[], help=poses)
    add = parser.add_argument_group("a recording alone").add_argument
    add("--events", type=Path, help="its events: *_events.tsv, .mid, .xdf, or a raw capture")
    pulses = "which events both clocks have: NAME, or NAME = NAME ON THE RECORDING'S CLOCK; or 'same clock'"
    add("--pulses", default="", help=pulses)
    add("--recording", type=Path, help="the raw capture, or its records, with the tracker's own pulses")
    command_line.add_outputs(parser, WRITES)
    return parser


def align(arguments: argparse.Namespace) -> None:
    """Align the events of every recording and write both tables.

    With --record-failure, a recording whose events cannot be read does not affect the others.
    """
    from shukotsu.movement.recording_events import aligned_rows
    from shukotsu.tables.typed_table import Provenance

    by_part, plan = recordings_of(arguments)
    if plan is not None:
        subject_stage.poses_files(plan)  # raises an error if a poses table does not match the plan
    recordings = [recording for named in by_part.values() for recording in named]
    with_events = [recording for recording in recordings if recording.file is not None or recording.rows]
    files = [path for recording in with_events for path in (recording.poses, recording.file) if path]
    provenance = Provenance.of(files, None if plan is None else plan.folder)
    with subject_stage.writing(arguments, WRITES, provenance) as tables:
        for part, named in by_part.items():
            rows = [aligned_rows(arguments, recording) for recording in named]
            tables["events"].rows(part, [row for events, _ in rows for row in events])
            tables["clocks"].rows(part, [row for _, clocks in rows for row in clocks])


def recordings_of(
    arguments: argparse.Namespace,
) -> tuple[dict[Part, list[RecordingEvents]], SubjectPlan | None]:
    """Return the sources of events of recordings with poses, by the hand's part, and the plan, if named."""
    from shukotsu.errors import InputError
    from shukotsu.movement.recording_events import of_plan, recording_alone
    from shukotsu.study.plan_file import read_plan

    if arguments.plan is not None:
        plan = read_plan(arguments.plan).naming(arguments.poses, {})
        return of_plan(plan), plan
    if len(arguments.poses) != 1 or arguments.events is None:
        raise InputError(
            "--plan, or --poses and --events: give the subject's plan, or a recording's two files"
        )
    named = (arguments.poses[0], arguments.recording, arguments.events, arguments.pulses)
    return recording_alone(*named), None


main = subject_stage.script(build_parser, align, WRITES, lambda arguments, _: recordings_of(arguments)[0])


if __name__ == "__main__":
    raise SystemExit(main())
