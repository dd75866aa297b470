"""Import a recording's file into a poses table: command-line options and the import itself."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu import command_line
from shukotsu.errors import InputError, count_of
from shukotsu.study.file_formats import AUTO, FORMATS, UNMAPPED, format_of, function_of

if TYPE_CHECKING:
    from shukotsu.readers.samples import Samples
    from shukotsu.study.layout import Layout
    from shukotsu.study.mapping import FileMapping

_DECLARED = ("format", "position_unit", "position_axes", "rate_hz", "orientation", "fixed")
"""Keys of a mapping that describe its numbers; stored in the table for the checks."""


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the command and of the stage."""
    parser = command_line.parser(
        "shukotsu import",
        "Import a recording as a poses table: check units and frames, keep gaps and name their causes.",
        "shukotsu import --in rom.csv --layout liberty16 --subject 01 --hand right "
        "--task rom --out poses.parquet",
    )
    add = parser.add_argument
    add("--in", dest="file", type=Path, required=True, help="the recording")
    add("--out", type=Path, required=True, help="the poses table to write")
    add("--format", choices=(AUTO, *UNMAPPED), default=AUTO, help="format of the file; auto: by its ending")
    add("--mapping", type=Path, help="mapping that describes another program's file (docs/mappings.md)")
    add(
        "--repair-hemisphere",
        action="store_true",
        help="put back positions that are on the wrong side of the transmitter, at times or throughout; "
        "without it, those that jumped become gaps",
    )
    add("--layout", required=True, help="name of a shipped layout, or a path")
    add("--subject", required=True, help="whose hand was recorded")
    add("--session", default="", help="session, if receivers were taken off and put on again")
    add("--hand", required=True, choices=("right", "left"), help="which hand")
    add("--task", required=True, help="task that was recorded")
    add("--trial", default="", help="number of the repetition, if there are several")
    return parser


def read_parts(
    path: Path, layout: Layout, mapping: FileMapping | None = None, name: str = AUTO
) -> Iterator[Samples]:
    """Read a recording in one or more parts; a part's notes are about the whole recording.

    It is read in the mapping's format, else in the format with this name or, for "auto", that of the file's
    ending. Raises InputError if the ending is unknown or that of a format that needs a mapping, and as the
    format's reader does.
    """
    from shukotsu.readers.samples import Samples
    from shukotsu.tables.text_files import open_text

    if mapping is not None:
        chosen = FORMATS[mapping.format]
        function = chosen.mapped_reader or chosen.reader
    else:
        named = format_of(path, name)
        if named is None or named.needs_mapping:
            with suppress(OSError), open_text(path):  # a spreadsheet or pipe raises a more specific error
                pass
            endings = ", ".join(ending for name in UNMAPPED for ending in FORMATS[name].endings)
            raise InputError(
                f"{path}: the ending {path.suffix!r} does not say which format this is (known are "
                f"{endings}); give --format {' or '.join(UNMAPPED)}, or a mapping: "
                "`shukotsu inspect FILE --write-mapping mapping.yaml` writes one to edit"
            )
        function = named.reader
    samples = function_of("shukotsu.readers.formats", function)(path, layout, mapping)
    return iter([samples]) if isinstance(samples, Samples) else samples


def import_recording(arguments: argparse.Namespace) -> None:
    """Read a recording, check it and write its poses table; notes go to stderr."""
    from shukotsu.errors import reading_user_tables
    from shukotsu.readers.hemispheres import expected_joints
    from shukotsu.readers.poses_table import poses_table
    from shukotsu.readers.samples import join_samples
    from shukotsu.study.config_files import config_path
    from shukotsu.study.layout import read_layout
    from shukotsu.study.mapping import read_mapping
    from shukotsu.tables.catalogue import POSES
    from shukotsu.tables.typed_table import Provenance, write_table_in_parts

    layout = read_layout(arguments.layout).of_hand(arguments.hand)
    mapping = None if arguments.mapping is None else read_mapping(arguments.mapping, arguments.hand)
    parts_without_rows: list[Samples] = []

    def parts() -> Iterator[Samples]:
        with reading_user_tables():
            for part in read_parts(arguments.file, layout, mapping, arguments.format):
                parts_without_rows.append(part.take(slice(0)))
                yield part

    parents = {joint.child: joint.parent_receiver for joint in layout.solvable}
    folder = next(parent for parent in arguments.out.absolute().parents if parent.is_dir())
    expected_mm, repair = expected_joints(layout), arguments.repair_hemisphere
    table = poses_table(parts(), parents, folder, expected_mm=expected_mm, repair_hemisphere=repair)
    with closing(table) as poses:
        remarks = join_samples(parts_without_rows)
        # Segments that a mapping does not mention carried no receiver, so they are not reported as absent.
        seen = {s for s, usable in zip(poses.segments, poses.usable, strict=True) if usable} | {*poses.frozen}
        worn = layout.measured if mapping is None else (*mapping.receivers, *mapping.fixed)
        absent = [s for s in layout.expected if s in worn and s not in seen]
        stored_notes = [*remarks.notes, *poses.notes]
        notes = list(stored_notes)
        if absent:
            segments = count_of(len(layout.measured), "segment")
            notes.append(f"no pose of {', '.join(absent)} ({len(absent)} of {segments})")
        notes += [f"segment {name} never moves though its parent does; not used" for name in poses.frozen]
        for note in notes:
            print(f"note: {arguments.file}: {note}", file=sys.stderr)
        inputs = [arguments.file, config_path(arguments.layout, "layout", Path())]
        inputs += [] if arguments.mapping is None else [arguments.mapping]
        parameters = {**_parameters(arguments, layout.name, absent), "notes": stored_notes}
        parameters["unmapped"] = [s for s in layout.expected if s not in worn]
        parameters |= {"losses": remarks.losses, "missing_frames": remarks.missing_frames}
        config = {} if mapping is None else mapping.config
        declared = {key: config[key] for key in _DECLARED if key in config}
        if unit := config.get("csv", {}).get("time_unit"):
            declared["csv"] = {"time_unit": unit}
        optional: dict[str, Any] = {"mapping": declared, "breaks": poses.breaks, "clusters": remarks.clusters}
        optional |= {"tracker": remarks.tracker, "orientation": remarks.orientation}
        parameters |= {key: value for key, value in optional.items() if value}
        write_table_in_parts(arguments.out, POSES, poses.row_groups(), Provenance.of(inputs, **parameters))


def import_for_the_moment(file: Path, layout: str, hand: str, out: Path, *more: str) -> None:
    """Import a recording of an unnamed subject, only to inspect its poses. Raises InputError as any import.

    more : additional command-line options.
    """
    which = [f"--in={file}", f"--layout={layout}", f"--hand={hand}", f"--out={out}"]
    import_recording(build_parser().parse_args([*which, "--subject=-", "--task=-", *more]))


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the table without rows, with the reason; the recording is named without its folder."""
    from shukotsu.tables.catalogue import POSES
    from shukotsu.tables.typed_table import Provenance, write_failure

    layout = Path(arguments.layout).name.removesuffix(".yaml")
    provenance = Provenance.of([arguments.file], **_parameters(arguments, layout, []))
    message = message.replace(str(arguments.file), arguments.file.name)
    write_failure(arguments.out, POSES, message, provenance)


def _parameters(arguments: argparse.Namespace, layout: str, absent: list[str]) -> dict[str, Any]:
    names = {name: getattr(arguments, name) for name in ("subject", "hand", "task", "trial")}
    names |= {"session": arguments.session} if arguments.session else {}
    return {**names, "layout": layout, "absent": absent}
