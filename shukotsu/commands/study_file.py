"""The study that a command is about: the file that was given, or study.yaml of this folder."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu.errors import InputError

if TYPE_CHECKING:
    from shukotsu.workflow.study_files import StudyFiles

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
