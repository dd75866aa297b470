"""Command line: a recording's file -> poses table."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schemas.errors import InputError
from stages import command_line
from stages.capture.formats.readers import AUTO, FORMATS

if TYPE_CHECKING:
    from schemas.layout import Layout
    from schemas.study import Recording
    from stages.capture.poses_table import PosesTable
    from stages.capture.samples import Samples


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = command_line.parser(
        "stages.capture import",
        "Turn a recording's file into the poses table: units and frames checked, gaps kept and named.",
        "python -m stages.capture import --in rom.csv --layout liberty16 --subject 01 --hand right "
        "--task rom --out poses.parquet",
    )
    parser.add_argument("--hand", required=True, choices=("right", "left"), help="which hand")
    parser.add_argument("--out", type=Path, required=True, help="the poses table to write")
    study = parser.add_argument_group("a recording of a study")
    study.add_argument("--plan", type=Path, help="the subject's plan, in place of options of a file alone")
    study.add_argument("--recording", help="the recording's name in the plan: its task, or task and trial")
    alone = parser.add_argument_group("a file alone")
    alone.add_argument("--in", dest="file", type=Path, help="the recording")
    alone.add_argument("--format", choices=(AUTO, *FORMATS), default=AUTO, help="auto goes by the ending")
    alone.add_argument(
        "--mapping", type=Path, help="how to read a file that is not this project's own (docs/recordings.md)"
    )
    alone.add_argument(
        "--repair-hemisphere",
        action="store_true",
        help="put back positions that jumped to the other side of the transmitter; without it they are gaps",
    )
    alone.add_argument("--layout", help="a layout that ships, or a path")
    alone.add_argument("--subject", help="whose hand it is")
    alone.add_argument("--task", help="what was done")
    alone.add_argument("--trial", default="", help="which repetition, where there are several")
    return parser


def main(argv: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    parser = build_parser()
    arguments = parser.parse_args(argv)
    needed = ("recording",) if arguments.plan else ("file", "layout", "subject", "task")
    absent = [name for name in needed if getattr(arguments, name) is None]
    if absent:
        options = ", ".join("--in" if name == "file" else f"--{name}" for name in absent)
        parser.error(f"the following arguments are required: {options}")
    return command_line.run(arguments, import_recording, record_failure)


def _requested(arguments: argparse.Namespace) -> Recording:
    """Take the recording from the plan, or from the options of a file alone.

    Raises InputError where the plan lacks the recording.
    """
    from schemas.plan import read_plan
    from schemas.study import Hand, Recording

    if arguments.plan is None:
        return Recording(
            Hand(arguments.subject, arguments.hand),
            arguments.task,
            arguments.trial,
            role="both",
            file=arguments.file,
            file_as_written=str(arguments.file),
            layout=Path(arguments.layout),
            format=arguments.format,
            mapping=arguments.mapping,
            hemisphere="repair" if arguments.repair_hemisphere else "",
            exclude="",
        )
    own = [r for r in read_plan(arguments.plan, checked=False).recordings if r.hand.hand == arguments.hand]
    for recording in own:
        if recording.name == arguments.recording:
            return recording
    raise InputError(
        f"{arguments.plan}: has no recording {arguments.recording!r} of the {arguments.hand} hand; "
        f"it has {', '.join(recording.name for recording in own) or 'none'}"
    )


@dataclass
class _Remarks:
    """What the reader says of the whole recording, see `Samples`."""

    notes: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)
    missing_frames: int = 0


def import_recording(arguments: argparse.Namespace) -> None:
    """Read the recording, check it, write the table; notes on what is not there go to stderr."""
    from schemas.layout import read_layout
    from schemas.mapping import read_mapping
    from stages.capture.formats.readers import find_parts_reader
    from stages.capture.poses_table import poses_table
    from stages.capture.samples import ReadingOptions

    recording = _requested(arguments)
    layout = read_layout(str(recording.layout))
    mapping = None if recording.mapping is None else read_mapping(recording.mapping)
    read = find_parts_reader(recording.file, recording.format, mapping)
    options = ReadingOptions(mapping, recording.hemisphere == "repair")
    remarks = _Remarks()

    def parts() -> Iterator[Samples]:
        for part in read(recording.file, layout, options):
            remarks.notes.extend(part.notes)
            remarks.losses.extend(part.losses)
            remarks.missing_frames += part.missing_frames
            yield part

    parents = {joint.child: joint.parent_receiver for joint in layout.solvable}
    folder = next(parent for parent in arguments.out.absolute().parents if parent.is_dir())
    with poses_table(parts, parents, folder) as poses:
        _write(arguments.out, recording, layout, poses, remarks)


def _write(out: Path, recording: Recording, layout: Layout, poses: PosesTable, remarks: _Remarks) -> None:
    from schemas.catalogue import POSES
    from schemas.config_files import config_path
    from schemas.tables import Provenance, write_table_in_parts

    absent, doubt = _absent(layout, poses), unit_doubt(poses)
    notes = list(remarks.notes)
    if absent:
        notes.append(f"no pose of {', '.join(absent)} ({len(absent)} of {len(layout.measured)} segments)")
    notes += [f"segment {name} never moves though its parent does; not used" for name in poses.frozen]
    notes += [doubt] if doubt else []
    for note in notes:
        print(f"note: {recording.file}: {note}", file=sys.stderr)
    inputs = [recording.file, config_path(str(recording.layout), "layout", Path())]
    inputs += [] if recording.mapping is None else [recording.mapping]
    parameters = {**_parameters(recording, layout.name, absent), "doubt": doubt, "notes": remarks.notes}
    parameters |= {"losses": remarks.losses, "missing_frames": remarks.missing_frames}
    write_table_in_parts(out, POSES, poses.row_groups(), Provenance.of(inputs, **parameters))


def unit_doubt(poses: PosesTable) -> str:
    """Say that the positions do not look like mm; nothing where they do.

    Three receivers worn on a body lie more than 5 mm apart, ten on a hand more than 50 mm.
    """
    if poses.span_mm < 5:
        unit = "metres"
    elif poses.span_mm < 50 and len(poses.segments) >= 10:
        unit = "centimetres or inches"
    else:
        return ""
    return f"the receivers lie within {poses.span_mm:.2g} mm of each other; are the positions in {unit}?"


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the table without rows and the reason, the recording named without its folder."""
    from schemas.catalogue import POSES
    from schemas.tables import Provenance, write_failure

    recording = _requested(arguments)
    layout = recording.layout.name.removesuffix(".yaml")
    provenance = Provenance.of([recording.file], **_parameters(recording, layout, []))
    message = message.replace(str(recording.file), recording.file.name)
    write_failure(arguments.out, POSES, message, provenance)


def _parameters(recording: Recording, layout: str, absent: list[str]) -> dict[str, Any]:
    hand = recording.hand
    names = {"subject": hand.subject, "hand": hand.hand, "task": recording.task, "trial": recording.trial}
    return {**names, "layout": layout, "absent": absent}


def _absent(layout: Layout, poses: PosesTable) -> list[str]:
    """Segments that the layout expects and of which the recording has no complete pose."""
    seen = {s for s, usable in zip(poses.segments, poses.usable, strict=True) if usable} | {*poses.frozen}
    return [s for s in layout.measured if not layout.segments[s].optional and s not in seen]
