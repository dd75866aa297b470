"""Command line: check a study as a run would read it, or check whether a recording went well."""

from __future__ import annotations

import argparse
import tempfile
from contextlib import suppress
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from shukotsu import command_line
from shukotsu.commands import USUAL
from shukotsu.errors import InputError
from shukotsu.study.file_formats import AUTO, UNMAPPED
from shukotsu.tables.text_files import reading

if TYPE_CHECKING:
    from shukotsu.study.layout import Layout


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu check",
        "Read a study file and all files that it names as a run would, list what it reads outside its "
        "folder, and report what in its recordings contradicts what was declared. For a single recording, "
        "also report which measurements on the hand would help most. Exit code: 0 with no finding or only "
        "notes, 1 if something is suspect, 2 if something is refused or cannot be read.",
        "shukotsu check study.yaml\n  shukotsu check rom.csv --hand right\n  "
        "shukotsu check lab.csv --hand right --mapping mapping.yaml",
    )
    add = parser.add_argument
    add("file", nargs="?", type=Path, default=USUAL, metavar="STUDY_OR_RECORDING", help=f"default: {USUAL}")
    add = parser.add_argument_group("for a recording").add_argument
    add("--hand", choices=("right", "left"), help="which hand it shows")
    add("--layout", default="liberty16", help="a layout that ships, or a path (liberty16)")
    add("--format", choices=(AUTO, *UNMAPPED), default=AUTO, help="format of the file; auto: by its ending")
    add("--mapping", type=Path, help="how to read a file of another program, as `shukotsu inspect` drafts it")
    add("--repair-hemisphere", action="store_true", help="correct positions on the transmitter's wrong side")
    return parser


def check(arguments: argparse.Namespace) -> int:
    """Check the study or the recording; return the exit code.

    Raises InputError if it cannot be read.
    """
    if arguments.file.suffix.lower() in (".yaml", ".yml", ".json"):
        from shukotsu.commands.check_study import check_study

        return check_study(arguments.file)
    return check_recording(arguments)


def check_recording(arguments: argparse.Namespace) -> int:
    """Import a recording temporarily and print its findings; return the most severe one's exit code.

    If that is 0, also print what would improve the hand most.
    """
    path, hand, layout, mapping = arguments.file, arguments.hand, arguments.layout, arguments.mapping
    with reading(path, "a study or a recording"):
        path.stat()
    if hand is None:
        raise InputError(f"{path}: --hand is missing; state which hand the recording shows, right or left")
    from shukotsu.checks.checked_subject import checked_poses  # late, as they take a second to import
    from shukotsu.readers.import_recording import import_for_the_moment
    from shukotsu.study.findings import EXIT_CODES
    from shukotsu.study.layout import read_layout

    with tempfile.TemporaryDirectory() as folder:
        poses = Path(folder, "poses.parquet")
        more = [f"--format={arguments.format}", *([] if mapping is None else [f"--mapping={mapping}"])]
        more += ["--repair-hemisphere"] if arguments.repair_hemisphere else []
        try:
            import_for_the_moment(path, layout, hand, poses, *more)
        except InputError as error:
            raise _without_mapping(path, layout, error) if mapping is None else error from error
        worn = read_layout(layout)
        findings = checked_poses(poses, worn.of_hand(hand)).findings
        for finding in findings:
            print(finding.line)
        if status := max((EXIT_CODES[finding.severity] for finding in findings), default=0):
            return status  # until this is resolved, joints cannot be judged
        print("" if findings else "no finding\n", end="")
        for line in _gain_lines(poses, worn, hand):
            print(line)
        return 0


def _gain_lines(poses: Path, layout: Layout, hand: str) -> list[str]:
    """Describe what would improve the hand fitted to these poses; no lines if the layout is not of a hand."""
    from numpy.linalg import LinAlgError

    from shukotsu.fit.calibration import read_thinned
    from shukotsu.fit.fingertips import fingertips
    from shukotsu.fit.fit import fit_hand
    from shukotsu.fit.gains import gains
    from shukotsu.hand.known_digits import no_whole_hand
    from shukotsu.report.belief import gain_lines

    if no_whole_hand(layout, "whole-hand"):
        return []
    try:
        return gain_lines(gains(fingertips(fit_hand([read_thinned(poses, layout.measured)], layout, hand))))
    except LinAlgError as error:
        raise InputError(f"no hand can be fitted to these poses ({error})") from error


def _without_mapping(path: Path, layout: str, error: InputError) -> InputError:
    """Return the error, or, if a mapping can be drafted for the file, one that explains how."""
    from shukotsu.commands.inspect_file import describe

    draft = ""
    with suppress(InputError):
        draft = describe(path, layout).draft
    if not draft:
        return error
    worn = "" if layout == "liberty16" else f" --layout {quote(layout)}"
    return InputError(
        f"{path}: is another program's file, which needs a mapping; `shukotsu inspect {quote(str(path))} "
        f"--write-mapping mapping.yaml{worn}` drafts one to edit, then check again with --mapping "
        "mapping.yaml"
    )


main = command_line.script(build_parser, check)
