"""List the commands of `shukotsu`, each with the module whose `main` takes its arguments."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from shukotsu.errors import InputError

if TYPE_CHECKING:
    from shukotsu.workflow.study_files import StudyFiles

_HERE = "shukotsu.commands"


class Command(NamedTuple):
    """A command: its module, and what it does in a line."""

    module: str
    summary: str


COMMANDS = {
    "new": Command(f"{_HERE}.new_study", "make a study folder with files to edit"),
    "check": Command(f"{_HERE}.check_file", "read a study, or say whether a recording went well"),
    "run": Command(f"{_HERE}.run_study", "run a study, or what of it is out of date"),
    "demo": Command(f"{_HERE}.run_demo", "run the demo's study in this folder"),
    "report": Command(f"{_HERE}.show_report", "name, print or open a study's report"),
    "export": Command(f"{_HERE}.export_study", "write a study's moving skeletons for other programs"),
    "record": Command(f"{_HERE}.record_tracker", "record a tracker into a raw capture"),
    "coach": Command(f"{_HERE}.coach_hand", "record a hand's calibration and coach it while it is recorded"),
    "emulate": Command(f"{_HERE}.emulate_tracker", "be a tracker, for a recorder without one at hand"),
    "inspect": Command(f"{_HERE}.inspect_file", "say what is in a file, and draft the mapping that it needs"),
    "import": Command(f"{_HERE}.import_file", "turn a recording's file into the poses table"),
    "stage": Command(f"{_HERE}.run_stage", "run one stage of the pipeline alone"),
    "doctor": Command(f"{_HERE}.doctor", "say what is installed, what is missing, what this machine can do"),
}


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the first argument; every command parses its own."""
    width = max(map(len, COMMANDS))
    lines = [f"  {name:{width}}  {command.summary}" for name, command in COMMANDS.items()]
    parser = argparse.ArgumentParser(
        prog="shukotsu",
        usage="shukotsu [-h] COMMAND ...",
        description="A person's own hand skeleton from magnetic motion-capture receivers.\n\ncommands:\n"
        + "\n".join(lines),
        epilog="`shukotsu COMMAND --help` shows the options of a command, and an example.\n\n"
        "example:\n  shukotsu new piano && cd piano\n  shukotsu run",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("command", choices=COMMANDS, metavar="COMMAND", help=argparse.SUPPRESS)
    return parser


USUAL = Path("study.yaml")
HELP = f"the study file (default: {USUAL} of this folder)"


def add_study(parser: argparse.ArgumentParser) -> None:
    """Add the argument that names the study."""
    parser.add_argument("study", nargs="?", type=Path, default=USUAL, metavar="STUDY", help=HELP)


def read_files(study: Path) -> StudyFiles:
    """Read the study and all that it names. Raises InputError as a run would, also where there is no file."""
    from shukotsu.workflow.study_files import StudyFiles

    if study == USUAL and not study.exists():
        raise InputError(
            f"{study}: there is none in {Path.cwd()}; name the study file, or make one: `shukotsu new FOLDER`"
        )
    return StudyFiles(study)
