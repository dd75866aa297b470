"""Command line: any file -> its content, and on request a mapping to edit."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu import command_line
from shukotsu.errors import InputError
from shukotsu.study.file_formats import FORMATS, format_of, function_of
from shukotsu.tables.limits import check_regular
from shukotsu.tables.text_files import reading

if TYPE_CHECKING:
    from shukotsu.readers.inspection.description import Description
    from shukotsu.study.layout import Layout


def build_parser() -> argparse.ArgumentParser:
    """Return the subcommand's argument parser."""
    parser = command_line.parser(
        "shukotsu inspect",
        "Say what is in a file, in which units it seems to be, and why.",
        "shukotsu inspect old.csv --write-mapping mapping.yaml",
    )
    parser.add_argument("file", type=Path, help="a recording, or a table of this project")
    parser.add_argument(
        "--write-mapping", type=Path, help="write a mapping to edit; what is unknown says CHECK"
    )
    parser.add_argument("--hand", choices=("right", "left"), help="whose it is (default: as the poses look)")
    parser.add_argument("--layout", default="liberty16", help="a layout that ships, or a path: its segments")
    return parser


def inspect(arguments: argparse.Namespace) -> None:
    """Print what is in the file, a fact a line, and the command to run next; write the mapping if asked."""
    from shukotsu.readers.inspection.description import CHECK
    from shukotsu.tables.whole_files import write_text

    description, target = describe(arguments.file, arguments.layout), arguments.write_mapping
    if target is not None:  # before anything is printed, which may be cut short
        if not description.draft:
            raise InputError(f"{arguments.file}: needs no mapping, so {target} is not written")
        if target.exists():
            raise InputError(f"{target}: is there already; name another file, so that an edited one is kept")
        if not target.parent.is_dir():
            raise InputError(f"{target}: there is no folder {target.parent}; make it, or name another one")
        write_text(target, description.draft)
    print("\n".join(description.lines))
    whole = find_spec("yaml") is not None  # the computer beside a tracker may have the recorder alone
    if whole and not description.draft and (description.recording or _is_poses_table(arguments.file)):
        print("".join(f"{line}\n" for line in finding_lines(arguments)), end="")
    if target is not None:
        todo = "put the truth where it says CHECK; import refuses it until then"
        print(f"wrote {target}: {todo if CHECK in description.draft else 'it is complete; look it over'}")
    mapping, layout = f" --mapping {target}" if description.draft else "", f" --layout {arguments.layout}"
    then = f"shukotsu import --in {arguments.file}{mapping}{layout} --subject 01 --hand right --task rom"
    then += " --out poses.parquet"
    then += "; and so with --hand left" if "\nleft_receivers:" in description.draft else ""
    if not description.recording:
        then = "nothing to import: this is a table that the pipeline made"
    elif description.draft and target is None:
        then = f"shukotsu inspect {arguments.file} --write-mapping mapping.yaml"
        then += "" if arguments.layout == "liberty16" else layout
    print(f"next: {then}")


def finding_lines(arguments: argparse.Namespace) -> list[str]:
    """List false declarations of the file, or the reason why it cannot be imported; a sentence a line.

    The file is a recording that needs no mapping, or a poses table. Without --hand it is of the hand that it
    looks like.
    """
    import io
    from contextlib import redirect_stderr
    from tempfile import TemporaryDirectory

    from shukotsu.checks.checked_subject import checked_poses
    from shukotsu.readers.import_recording import import_for_the_moment
    from shukotsu.study.layout import read_layout

    path, hand, layout = arguments.file, arguments.hand or "right", read_layout(arguments.layout)
    with TemporaryDirectory() as folder:
        if not _is_poses_table(path):
            path = Path(folder, "poses")
            try:
                with redirect_stderr(io.StringIO()):
                    import_for_the_moment(arguments.file, arguments.layout, hand, path)
            except InputError as error:
                return [f"import refuses it: {error}"]
        findings = checked_poses(path, layout).findings
        if arguments.hand is None and any(finding.kind == "wrong-hand" for finding in findings):
            findings = checked_poses(path, layout, "left").findings
            print("it looks like a left hand")
    return [finding.line for finding in findings]


def _is_poses_table(path: Path) -> bool:
    from shukotsu.tables.catalogue import POSES
    from shukotsu.tables.typed_table import read_metadata

    try:
        return bool(read_metadata(path)["schema"] == POSES.name)
    except InputError:
        return False


def describe(path: Path, layout: Layout | str) -> Description:
    """Describe a file, by the segments of a layout or of one of that name.

    Raises InputError where it is absent, empty or of no known kind.
    """
    with reading(path, "a recording", "expected a recording"):
        if not check_regular(path, "a recording"):
            raise InputError(f"{path}: is empty; expected a recording")
    form = format_of(path) or FORMATS["csv"]
    if form is FORMATS["capture"]:  # also where only the recorder is installed, without YAML
        from shukotsu.readers.inspection.description import Description
        from shukotsu.tracker.survey import describe as describe_capture

        return Description(tuple(describe_capture(path)))
    from shukotsu.study.layout import read_layout

    layout = read_layout(layout) if isinstance(layout, str) else layout
    if not form.inspector:
        raise InputError(
            f"{path}: inspect reads text, C3D and this project's files; import it as it is, and "
            "where its names are no segments, write a mapping (docs/mappings.md)"
        )
    description: Description = function_of("shukotsu.readers.inspection", form.inspector)(path, layout)
    return description


main = command_line.script(build_parser, inspect)
