"""Command line: make a study folder with files to edit."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path

from shukotsu import command_line
from shukotsu.errors import InputError, listed
from shukotsu.tables.line_printer import progress

TEMPLATES = Path(__file__).parent / "templates"
STUDY = {"en": "study.yaml", "ja": "study.ja.yaml"}
"""Language of the comments and of the report -> the template."""
COLUMNS = ("subject", "hand", "task", "role", "file")
MORE_COLUMNS = ("session", "trial", "mapping")
"""Columns that a drafted sheet has where a recording gives them something to hold."""
RECORDINGS = {".csv", ".tsv", ".parquet", ".arrows", ".c3d", ".xdf", ".mha", ".nrrd"}
"""Endings of files that may be recordings."""
BESIDE = ("_channels.tsv", "_events.tsv", "_scans.tsv", "participants.tsv")
"""How tables end that stand beside recordings of Motion-BIDS."""


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu new",
        "Make a study folder: study.yaml with comments, recordings.tsv and participants.tsv to fill in. What "
        "is there is kept.",
        "shukotsu new piano --recordings captures",
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="the folder; its name is the study's")
    parser.add_argument(
        "--recordings",
        type=Path,
        metavar="FILES",
        help="a folder of recordings: a row is drafted for each by its name (P01_L_calib), and a mapping for "
        "those of another program",
    )
    parser.add_argument(
        "--layout", default="liberty16", help="a layout that ships, or a path: who wears what (liberty16)"
    )
    parser.add_argument(
        "--language", choices=STUDY, default="en", help="of the comments and of the report (default: en)"
    )
    return parser


def new_study(arguments: argparse.Namespace) -> None:
    """Write the three files, and mappings where recordings need them; say what to do with them.

    Raises InputError where one is there, for a name or layout that cannot be, and without a recording.
    """
    from shukotsu.study.config_files import config_path, shipped
    from shukotsu.tables.whole_files import write_text

    folder: Path = arguments.folder
    name = folder.resolve().name
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
        raise InputError(f"{folder}: no study can have this name; use letters, digits, - and _")
    template = (TEMPLATES / STUDY[arguments.language]).read_text("utf-8")
    sheet, mappings, notes = _drafted(arguments)
    subjects = filter(None, dict.fromkeys(row[0] for row in sheet[1:]))
    shipped_layouts, path = shipped("layout"), config_path(arguments.layout, "layout", Path())
    layout = arguments.layout if arguments.layout in shipped_layouts else _from(path, folder)
    texts = {
        "study.yaml": template.replace("{name}", name).replace("{layout}", layout),
        "recordings.tsv": "".join("\t".join(row) + "\n" for row in sheet),
        "participants.tsv": "subject\thand_length_mm\thand_breadth_mm\n"
        + "".join(f"{subject}\n" for subject in subjects),
        **mappings,
    }
    folder.mkdir(parents=True, exist_ok=True)
    if kept := [folder / file for file in texts if (folder / file).exists()]:
        raise InputError(f"{kept[0]}: is there already; name another folder, or edit that file")
    for file, text in texts.items():
        write_text(folder / file, text)
        print(folder / file)
    print("".join(f"note: {note}\n" for note in notes), end="")
    print(f"next: {_next(folder, sheet, list(mappings))}, then: cd {folder}; shukotsu check; shukotsu run")


def _drafted(arguments: argparse.Namespace) -> tuple[list[Sequence[str]], dict[str, str], list[str]]:
    """Draft the sheet of recordings, header first, and the mappings' files; say what is wrong with any."""
    from shukotsu.commands.drafts import draft_mappings, parts_of_names
    from shukotsu.study.layout import read_layout

    layout = read_layout(arguments.layout)
    if arguments.recordings is None:
        return [COLUMNS], {}, []
    paths = recordings_in(arguments.recordings)
    root = arguments.recordings.resolve()
    with progress("inspected", len(paths)) as inspected:
        drafts = draft_mappings(paths, layout, inspected)
    cells = [
        {**vars(parts), "file": _from(path, arguments.folder), "mapping": drafts.of.get(path, "")}
        for path, parts in zip(paths, parts_of_names(path.relative_to(root) for path in paths), strict=True)
    ]
    columns = [*COLUMNS, *(name for name in MORE_COLUMNS if any(row[name] for row in cells))]
    notes = [f"{reason}; its row stays until you remove it" for reason in drafts.refused.values()]
    return [columns, *([row[name] for name in columns] for row in cells)], drafts.texts, notes


def _next(folder: Path, sheet: Sequence[Sequence[str]], mappings: Sequence[str]) -> str:
    """Format what to do with the files, the last of it after `and`."""
    rows = sheet[1:]
    empty = sum(not all(row[:4]) for row in rows)
    if not rows:
        return f"write a row a recording into {folder / 'recordings.tsv'}"
    filled = f", and fill in the {empty} that their names leave open" if empty else ""
    what = f"look over the {len(rows)} rows of {folder / 'recordings.tsv'}, drafted from names{filled}"
    if mappings:
        verb = "says" if len(mappings) == 1 else "say"
        what += f"; put the truth where {listed(mappings)} in {folder} {verb} CHECK"
    return what


def recordings_in(captures: Path) -> list[Path]:
    """Return the files of a folder that may be recordings, sorted. Raises InputError where it has none."""
    if not captures.is_dir():
        raise InputError(f"--recordings: {captures}: no such folder; give the folder of your recordings")
    files = (path for path in captures.rglob("*") if path.suffix.lower() in RECORDINGS and path.is_file())
    root = captures.resolve()
    paths = sorted(root / path.relative_to(captures) for path in files if not path.name.endswith(BESIDE))
    if not paths:
        endings = ", ".join(sorted(RECORDINGS))
        raise InputError(
            f"--recordings: {captures}: holds no recording; expected files that end in {endings}"
        )
    return paths


def _from(path: Path, folder: Path) -> str:
    """Return a file as the study in the folder names it: relative to the folder where it is below it."""
    path, base = path.resolve(), folder.resolve()
    return str(path.relative_to(base) if path.is_relative_to(base) else path)


def main(argv: list[str]) -> int:
    """Make the folder; return the exit code."""
    return command_line.run(build_parser, argv, new_study)
