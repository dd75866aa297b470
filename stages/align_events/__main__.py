"""Command line: files and rows of events -> events on the recordings' clocks, and clocks."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.stages import command_line, subject_stage

if TYPE_CHECKING:
    from shukotsu.schemas.parts import Part
    from shukotsu.schemas.plan import SubjectPlan
    from shukotsu.stages.align_events.recording_events import RecordingEvents

    Named = tuple[Part, Mapping[str, str], RecordingEvents]


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage align_events",
        "Bring events of other devices to a recording's clock: MIDI notes, markers, what the tracker saw.",
        "shukotsu stage align_events --poses poses.parquet --events take1.mid --pulses 'note 24 = sync' "
        "--recording take1.arrows --out events.parquet --out-clocks clocks.parquet",
    )
    add = parser.add_argument
    subject_stage.add_plan(parser, "the subject's plan, in place of the options of a recording alone")
    alone = parser.add_argument_group("a recording alone")
    alone.add_argument("--poses", type=Path, help="its poses table")
    alone.add_argument("--events", type=Path, help="its events: *_events.tsv, .mid, .xdf, or a raw capture")
    alone.add_argument(
        "--pulses",
        default="",
        help="which events both clocks have: NAME, or NAME = NAME ON THE RECORDING'S CLOCK; or 'same clock'",
    )
    alone.add_argument(
        "--recording", type=Path, help="the raw capture, or its records, with the tracker's own pulses"
    )
    add("--out", type=Path, required=True, help="the events table to write")
    add("--out-clocks", type=Path, required=True, help="the clocks table to write")
    return parser


def align(arguments: argparse.Namespace) -> None:
    """Align every recording's events; one whose events cannot be read costs only its own."""
    from shukotsu.errors import InputError
    from shukotsu.schemas.catalogue import CLOCKS, EVENTS
    from shukotsu.schemas.parts import parts_writer
    from shukotsu.schemas.plan import read_plan
    from shukotsu.schemas.tables import Provenance

    if arguments.plan is not None:
        plan = read_plan(arguments.plan, arguments.inputs, checked=False)
        recordings = list(_of_plan(plan))
        parts, folder = [plan.part(hand) for hand in plan.hands], plan.folder
    elif arguments.poses is None or arguments.events is None:
        raise InputError(
            "--plan, or --poses and --events: give the subject's plan, or a recording's two files"
        )
    else:
        recordings = [_alone(arguments)]
        parts, folder = [recordings[0][0]], None
    with_events = [own for *_, own in recordings if own.file is not None or own.rows]
    files = [path for own in with_events for path in (own.poses, own.file) if path is not None]
    provenance = Provenance.of(files, folder)
    with (
        parts_writer(arguments.out, EVENTS, provenance) as events,
        parts_writer(arguments.out_clocks, CLOCKS, provenance) as clocks,
    ):
        for part in parts:
            own = [(key, recording) for other, key, recording in recordings if other == part]
            rows = [_aligned(arguments, key, recording) for key, recording in own]
            events.rows(part, [row for event_rows, _ in rows for row in event_rows])
            clocks.rows(part, [row for _, clock_rows in rows for row in clock_rows])


def _aligned(
    arguments: argparse.Namespace, key: Mapping[str, str], recording: RecordingEvents
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """A recording's rows of events and clocks; with --record-failure the reason where there are none."""
    event_rows: list[dict[str, Any]] = []
    clock_rows: list[dict[str, Any]] = []
    with command_line.recorded(arguments, arguments.record_failure) as messages:
        event_rows, clock_rows = recording.aligned()
    for message in messages:
        failed = {"source": "", "n_pulses": 0, "n_missing": 0, "n_extra": 0}
        clock_rows = [{**failed, "status": "failed", "message": message}]
    for row in clock_rows:
        if row["message"]:
            where = ", ".join(filter(None, (key["hand"], key["task"], key["trial"])))
            print(f"{row['status']}: {where}: {row['message']}", file=sys.stderr)
    return [{**key, **row} for row in event_rows], [{**key, **row} for row in clock_rows]


def _of_plan(plan: SubjectPlan) -> Iterator[Named]:
    """Recordings of a plan that hold poses, and their events."""
    from shukotsu.schemas.poses import usable_poses
    from shukotsu.stages.align_events.recording_events import RecordingEvents

    subject_stage.poses_files(plan)  # which are those of the plan
    for recording in plan.recordings:
        poses, key = plan.poses(recording), recording.key
        if recording.exclude or not usable_poses([poses])[0]:
            continue
        rows = [row.values for row in plan.events if all(row[name] in ("", key[name]) for name in key)]
        own = RecordingEvents(poses, recording.file, recording.events, recording.pulses, rows)
        yield plan.part(recording.hand.hand), key, own


def _alone(arguments: argparse.Namespace) -> Named:
    """The recording that the command line names."""
    from shukotsu.schemas.parts import Part
    from shukotsu.schemas.poses import recording_name
    from shukotsu.stages.align_events.recording_events import RecordingEvents

    name = recording_name(arguments.poses)
    part = Part(name.hand, subject=name.subject, session=name.session)
    key = {**vars(name.of_hand), "task": name.task, "trial": name.trial}
    return (
        part,
        key,
        RecordingEvents(arguments.poses, arguments.recording, arguments.events, arguments.pulses),
    )


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why no event was brought over, of every hand."""
    from shukotsu.schemas.catalogue import CLOCKS, EVENTS
    from shukotsu.schemas.plan import read_plan

    if arguments.plan is None:
        parts = [_alone(arguments)[0]]
    else:
        plan = read_plan(arguments.plan, arguments.inputs, checked=False)
        parts = [plan.part(hand) for hand in plan.hands]
    tables = {arguments.out: EVENTS, arguments.out_clocks: CLOCKS}
    subject_stage.record_failed_parts(message, tables, parts)


def main(argv: list[str] | None = None) -> int:
    """Run the stage; give its exit code."""
    return command_line.run(build_parser, argv, align, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
