"""Command line: a file of whatever kind -> what is in it, and on request a mapping to edit."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from schemas.errors import InputError
from stages.command_line import EXIT_BAD_INPUT


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = argparse.ArgumentParser(
        prog="python -m stages.capture inspect",
        description="Say what is in a file, in which units it seems to be, and why.",
        epilog="example:\n  python -m stages.capture inspect old.csv --write-mapping mapping.yaml",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "file", type=Path, help="a recording, a table of this project, or a folder of matrices"
    )
    parser.add_argument(
        "--write-mapping", type=Path, help="write a mapping to edit; what is unknown says CHECK"
    )
    parser.add_argument("--layout", default="liberty16", help="a layout that ships, or a path: its segments")
    return parser


def main(arguments: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    try:
        inspect(build_parser().parse_args(arguments))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    return 0


def inspect(arguments: argparse.Namespace) -> None:
    """Print what is in the file, a fact a line, and the command to run next; write the mapping if asked."""
    from schemas.files import write_text
    from schemas.layout import read_layout
    from stages.capture.inspection.kinds import look

    layout = read_layout(arguments.layout)
    found = look(arguments.file, layout)
    print("\n".join(found.lines))
    target = arguments.write_mapping
    if target is not None:
        if not found.draft:
            raise InputError(f"{arguments.file}: needs no mapping, so {target} is not written")
        if target.exists():
            raise InputError(f"{target}: is there already; name another file, so that an edited one is kept")
        write_text(target, found.draft)
        print(f"wrote {target}: put the truth where it says CHECK; import refuses it until then")
    print(f"next: {_next_command(arguments, found.recording, bool(found.draft))}")


def _next_command(arguments: argparse.Namespace, recording: bool, mapped: bool) -> str:
    if not recording:
        return "nothing to import: this is a table that the pipeline made"
    if mapped and arguments.write_mapping is None:
        layout = "" if arguments.layout == "liberty16" else f" --layout {arguments.layout}"
        return f"python -m stages.capture inspect {arguments.file} --write-mapping mapping.yaml{layout}"
    mapping = f" --mapping {arguments.write_mapping}" if mapped else ""
    return (
        f"python -m stages.capture import --in {arguments.file}{mapping} --layout {arguments.layout} "
        "--subject 01 --hand right --task rom --out poses.parquet"
    )
