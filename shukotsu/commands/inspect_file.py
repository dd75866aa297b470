"""Command line: describe any file, and on request draft a mapping to edit."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from shukotsu import command_line
from shukotsu.errors import InputError
from shukotsu.study.file_formats import AUTO, FORMATS, format_of, function_of
from shukotsu.tables import limits, text_files

if TYPE_CHECKING:
    from shukotsu.readers.inspection.description import Description
    from shukotsu.study.layout import Layout


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu inspect",
        "Describe what is in a file, which units it seems to use, and why.",
        "shukotsu inspect old.csv --write-mapping mapping.yaml",
    )
    add = parser.add_argument
    add("file", type=Path, help="a recording, or a table of this project")
    add("--format", choices=(AUTO, *FORMATS), default=AUTO, help="format of the file; auto: by its ending")
    add("--write-mapping", type=Path, help="write a mapping to edit; unknown values are written as CHECK")
    add("--hand", choices=("right", "left"), help="which hand (default: as the poses look)")
    add("--layout", default="liberty16", help="a layout that ships, or a path: its segments")
    return parser


def inspect(arguments: argparse.Namespace) -> None:
    """Print one fact about the file per line and the command to run next; write a mapping if requested."""
    from shukotsu.readers.inspection.description import CHECK
    from shukotsu.tables.whole_files import write_text

    description = describe(arguments.file, arguments.layout, arguments.format)
    target = arguments.write_mapping
    if target is not None:  # before printing, since the reader of stdout may close it
        if not description.draft:
            raise InputError(f"{arguments.file}: needs no mapping, so {target} is not written")
        if target.exists():
            raise InputError(f"{target}: already exists; name another file, so that an edited one is kept")
        if not target.parent.is_dir():
            raise InputError(f"{target}: there is no folder {target.parent}; make it, or name another one")
        write_text(target, description.draft)
    print("\n".join(description.lines))
    whole = find_spec("yaml") is not None  # a tracker's computer may have only the recorder installed
    if whole and not description.draft and (description.recording or _is_poses_table(arguments.file)):
        print("".join(f"{line}\n" for line in finding_lines(arguments)), end="")
    if target is not None:
        todo = "put the truth where it says CHECK; import refuses it until then"
        print(f"wrote {target}: {todo if CHECK in description.draft else 'it is complete; look it over'}")
    file, layout = quote(str(arguments.file)), f" --layout {quote(str(arguments.layout))}"
    form = "" if arguments.format == AUTO else f" --format {arguments.format}"
    mapping = f" --mapping {quote(str(target))}" if description.draft else form
    then = f"shukotsu import --in {file}{mapping}{layout} --subject 01 --hand right --task rom"
    then += " --out poses.parquet"
    then += "; and so with --hand left" if "\nleft_receivers:" in description.draft else ""
    if not description.recording:
        then = "nothing to import: this is a table that the pipeline made"
    elif description.draft and target is None:
        then = f"shukotsu inspect {file}{form} --write-mapping mapping.yaml"
        then += "" if arguments.layout == "liberty16" else layout
    print(f"next: {then}")


def finding_lines(arguments: argparse.Namespace) -> list[str]:
    """Return the findings on the file, one per line, or the reason why it cannot be imported.

    The file is a recording that needs no mapping, or a poses table. Without --hand it is checked as the hand
    that it looks like.
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
                    chosen = f"--format={arguments.format}"
                    import_for_the_moment(arguments.file, arguments.layout, hand, path, chosen)
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


def describe(path: Path, layout: Layout | str, name: str = AUTO) -> Description:
    """Describe a file.

    layout : layout, or name of one, whose segments are looked for in it. name : of its format, or AUTO.
    Raises InputError if the file does not exist, is empty or is of an unknown kind.
    """
    with text_files.reading(path, "a recording", "expected a recording"):
        if not limits.check_regular(path, "a recording"):
            raise InputError(f"{path}: is empty; expected a recording")
    form = format_of(path, name) or FORMATS["csv"]
    if form is FORMATS["capture"]:  # before YAML is needed, which the recorder alone lacks
        from shukotsu.readers.inspection.description import Description
        from shukotsu.tracker.survey import describe as describe_capture

        return Description(tuple(describe_capture(path)))
    from shukotsu.study.layout import read_layout

    layout = read_layout(layout) if isinstance(layout, str) else layout
    if not form.inspector:
        kinds = [kind for kind, each in FORMATS.items() if each.inspector or kind == "capture"]
        raise InputError(
            f"{path}: inspect reads the formats {', '.join(kinds)}; import this one directly, or, if its "
            "names are not those of segments, by a mapping (docs/mappings.md)"
        )
    description: Description = function_of("shukotsu.readers.inspection", form.inspector)(path, layout)
    return description


main = command_line.script(build_parser, inspect)
