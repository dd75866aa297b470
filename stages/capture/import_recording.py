"""Command line: a recording's file -> poses table."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stages import command_line
from stages.capture.formats.readers import AUTO, FORMATS

if TYPE_CHECKING:
    from schemas.layout import Layout
    from stages.capture.poses import PosesTable


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = command_line.parser(
        "stages.capture import",
        "Turn a recording's file into the poses table: units and frames checked, gaps kept and named.",
        "python -m stages.capture import --in rom.csv --layout liberty16 --subject 01 --hand right "
        "--task rom --out poses.parquet",
    )
    parser.add_argument("--in", dest="recording", type=Path, required=True, help="the recording")
    parser.add_argument("--format", choices=(AUTO, *FORMATS), default=AUTO, help="auto goes by the ending")
    parser.add_argument(
        "--mapping", type=Path, help="how to read a file that is not this project's own (docs/recordings.md)"
    )
    parser.add_argument(
        "--repair-hemisphere",
        action="store_true",
        help="put back positions that jumped to the other side of the transmitter; without it they are gaps",
    )
    parser.add_argument("--layout", required=True, help="a layout that ships, or a path")
    parser.add_argument("--subject", required=True, help="whose hand it is")
    parser.add_argument("--hand", required=True, choices=("right", "left"), help="which hand")
    parser.add_argument("--task", required=True, help="what was done")
    parser.add_argument("--trial", default="", help="which repetition, where there are several")
    parser.add_argument("--out", type=Path, required=True, help="the poses table to write")
    return parser


def main(arguments: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    return command_line.run(build_parser().parse_args(arguments), import_recording, record_failure)


def import_recording(arguments: argparse.Namespace) -> None:
    """Read the recording, check it, write the table; notes on what is not there go to stderr."""
    from schemas.layout import read_layout
    from schemas.mapping import read_mapping
    from stages.capture.formats.readers import find_parts_reader
    from stages.capture.poses import poses_of_parts
    from stages.capture.samples import ReadingOptions, Samples
    from stages.capture.spool import Spool

    layout = read_layout(arguments.layout)
    mapping = None if arguments.mapping is None else read_mapping(arguments.mapping)
    read = find_parts_reader(arguments.recording, arguments.format, mapping)
    options = ReadingOptions(mapping, arguments.repair_hemisphere)
    told = _Told()

    def parts() -> Iterator[Samples]:
        for part in read(arguments.recording, layout, options):
            told.notes.extend(part.notes)
            told.losses.extend(part.losses)
            told.missing_frames += part.missing_frames
            yield part

    parents = {joint.child: joint.parent_receiver for joint in layout.solvable}
    with Spool(arguments.out.parent) as spool:
        poses = poses_of_parts(parts, parents, spool)
        _write(arguments, layout, poses, told)


@dataclass
class _Told:
    """What the reader says of the whole recording, see `Samples`."""

    notes: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)
    missing_frames: int = 0


def _write(arguments: argparse.Namespace, layout: Layout, poses: PosesTable, told: _Told) -> None:
    from schemas.catalogue import POSES
    from schemas.config_files import config_path
    from schemas.tables import Provenance, write_table_in_parts

    absent, doubt = _absent(layout, poses), unit_doubt(poses)
    notes = list(told.notes)
    if absent:
        notes.append(f"no pose of {', '.join(absent)} ({len(absent)} of {len(layout.measured)} segments)")
    notes += [f"segment {name} never moves though its parent does; not used" for name in poses.frozen]
    notes += [doubt] if doubt else []
    for note in notes:
        print(f"note: {arguments.recording}: {note}", file=sys.stderr)
    inputs = [arguments.recording, config_path(arguments.layout, "layout", Path())]
    inputs += [] if arguments.mapping is None else [arguments.mapping]
    parameters = {**_parameters(arguments, layout.name, absent), "doubt": doubt, "notes": told.notes}
    parameters |= {"losses": told.losses, "missing_frames": told.missing_frames}
    write_table_in_parts(arguments.out, POSES, poses.row_groups(), Provenance.of(inputs, **parameters))


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

    name = Path(arguments.layout).name.removesuffix(".yaml")
    provenance = Provenance.of([arguments.recording], **_parameters(arguments, name, []))
    message = message.replace(str(arguments.recording), arguments.recording.name)
    write_failure(arguments.out, POSES, message, provenance)


def _parameters(arguments: argparse.Namespace, layout: str, absent: list[str]) -> dict[str, Any]:
    names = {name: getattr(arguments, name) for name in ("subject", "hand", "task", "trial")}
    return {**names, "layout": layout, "absent": absent}


def _absent(layout: Layout, poses: PosesTable) -> list[str]:
    """Segments that the layout expects and of which the recording has no complete pose."""
    seen = {s for s, usable in zip(poses.segments, poses.usable, strict=True) if usable} | {*poses.frozen}
    return [s for s in layout.measured if not layout.segments[s].optional and s not in seen]
