"""The commands of `shukotsu`; each is a module whose `main` takes the command's arguments."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from shukotsu import command_line
from shukotsu.errors import InputError

if TYPE_CHECKING:
    from shukotsu.workflow.study_files import StudyFiles


class Command(NamedTuple):
    """A command: the name of its module in this package, and a summary in one line."""

    module: str
    summary: str


COMMANDS = {
    "new": Command("new_study", "make a study folder with files to edit"),
    "check": Command("check_file", "check a study, or whether a recording went well"),
    "run": Command("run_study", "run a study, or only what is out of date"),
    "demo": Command("run_demo", "run the demo study in this folder"),
    "report": Command("show_report", "locate, print or open a study's report"),
    "export": Command("export_study", "write a study's moving skeletons for other programs"),
    "record": Command("record_tracker", "record a tracker into a raw capture"),
    "coach": Command("coach_hand", "record a hand's calibration and advise while it is recorded"),
    "emulate": Command("emulate_tracker", "emulate a tracker, to try recording without one"),
    "inspect": Command("inspect_file", "describe a file, and draft the mapping that it needs"),
    "import": Command("import_file", "convert a recording's file to a poses table"),
    "stage": Command("run_stage", "run one stage of the pipeline alone"),
    "doctor": Command("doctor", "show what is installed and missing, and what this machine can do"),
}


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the first argument; every command parses the others itself."""
    width = max(map(len, COMMANDS))
    lines = [f"  {name:{width}}  {command.summary}" for name, command in COMMANDS.items()]
    what = "A person's own hand skeleton from magnetic motion-capture receivers.\n\ncommands:\n"
    more = "\n\n`shukotsu COMMAND --help` shows the options of a command, and an example."
    example = "shukotsu new piano && cd piano\n  shukotsu run"
    parser = command_line.parser("shukotsu", what + "\n".join(lines) + more, example)
    parser.usage = "shukotsu [-h] COMMAND ..."
    parser.add_argument("command", choices=COMMANDS, metavar="COMMAND", help=argparse.SUPPRESS)
    return parser


USUAL = Path("study.yaml")
HELP = f"the study file (default: {USUAL} in this folder)"


def add_study(parser: argparse.ArgumentParser) -> None:
    """Add the argument that names the study."""
    parser.add_argument("study", nargs="?", type=Path, default=USUAL, metavar="STUDY", help=HELP)


def read_files(study: Path) -> StudyFiles:
    """Read a study file and all files that it names.

    Raises InputError if the file does not exist, or for the same reasons as a run.
    """
    from shukotsu.workflow.study_files import StudyFiles

    if study == USUAL and not study.exists():
        raise InputError(
            f"{study}: not found in {Path.cwd()}; name the study file, or make one: `shukotsu new FOLDER`"
        )
    files = StudyFiles(study)
    if files.study.language != "en":
        from shukotsu.report.templates import check_language  # late, as it is slow to import

        check_language(files.study.language, f"{study}: language")
    return files
