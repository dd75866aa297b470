"""Command line: make a study folder with files to edit."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from schemas.errors import InputError
from stages import command_line

TEMPLATES = Path(__file__).parent / "templates"
STUDY = {"en": "study.yaml", "ja": "study.ja.yaml"}
"""Language of the comments and of the report -> the template."""
COLUMNS = ("subject", "hand", "task", "role", "file")
RECORDINGS = {".csv", ".tsv", ".parquet", ".arrows", ".c3d", ".xdf"}
"""Endings of files that may be recordings."""


def build_parser() -> argparse.ArgumentParser:
    """Give the command's argument parser."""
    parser = command_line.parser(
        "shukotsu new",
        "Make a study folder: study.yaml with comments, recordings.tsv and participants.tsv to fill in. What "
        "is there is kept.",
        "shukotsu new piano --recordings captures",
        records_failure=False,
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="the folder; its name is the study's")
    parser.add_argument(
        "--recordings", type=Path, metavar="FILES", help="a folder of recordings: a row is begun for each"
    )
    parser.add_argument(
        "--language", choices=STUDY, default="en", help="of the comments and of the report (default: en)"
    )
    return parser


def new_study(arguments: argparse.Namespace) -> None:
    """Write the three files and say what to do with them.

    Raises InputError where one of them is there, where no study can have the folder's name, and where the
    folder of recordings holds none.
    """
    from schemas.files import write_text

    folder: Path = arguments.folder
    name = folder.resolve().name
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
        raise InputError(f"{folder}: no study can have this name; use letters, digits, - and _")
    study = (TEMPLATES / STUDY[arguments.language]).read_text("utf-8").replace("{name}", name)
    found = [] if arguments.recordings is None else recordings_in(arguments.recordings, folder)
    rows = ["\t".join(COLUMNS), *("\t" * (len(COLUMNS) - 1) + file for file in found)]
    texts = {
        "study.yaml": study,
        "recordings.tsv": "".join(f"{row}\n" for row in rows),
        "participants.tsv": "subject\thand_length_mm\thand_breadth_mm\n",
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        kept = [folder / file for file in texts if (folder / file).exists()]
    except OSError as error:
        raise InputError(f"{folder}: cannot be made a study's folder ({error.strerror or error})") from error
    if kept:
        raise InputError(f"{kept[0]}: is there already; name another folder, or edit that file")
    for file, text in texts.items():
        write_text(folder / file, text)
        print(folder / file)
    edit = f"fill in the {len(found)} rows of" if found else "write a row a recording into"
    print(f"next: {edit} {folder / 'recordings.tsv'}, then: cd {folder}; shukotsu check; shukotsu run")


def recordings_in(captures: Path, folder: Path) -> list[str]:
    """Give the files that may be recordings, relative to the study's folder where they are below it."""
    if not captures.is_dir():
        raise InputError(f"--recordings: {captures}: no such folder; give the folder of your recordings")
    found = (path for path in captures.rglob("*") if path.suffix.lower() in RECORDINGS)
    paths = sorted(path.resolve() for path in found if path.is_file())
    if not paths:
        endings = ", ".join(sorted(RECORDINGS))
        raise InputError(
            f"--recordings: {captures}: holds no recording; expected files that end in {endings}"
        )
    base = folder.resolve()
    return [str(path.relative_to(base) if path.is_relative_to(base) else path) for path in paths]


def main(argv: list[str]) -> int:
    """Make the folder; give the exit code."""
    return command_line.run(build_parser().parse_args(argv), new_study)
