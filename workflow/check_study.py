"""Command line: read a study file before Snakemake does, and name what it reads elsewhere."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from stages import command_line


def build_parser() -> argparse.ArgumentParser:
    """Give the argument parser."""
    parser = command_line.parser(
        "workflow.check_study",
        "Read a study file and all that it names as a run would, without Snakemake, which runs code in one "
        "that asks for it; name the files that it reads outside its folder.",
        "python -m workflow.check_study config/demo.yaml",
        records_failure=False,
    )
    parser.add_argument("study", type=Path, help="the study file")
    return parser


def check_study(arguments: argparse.Namespace) -> None:
    """Read the study and print what it is; raise InputError as a run would."""
    from workflow.study_files import StudyFiles

    files = StudyFiles(arguments.study)
    study = files.study
    counts = f"{len(study.subjects)} subjects, {len(study.recordings)} recordings, {len(study.models)} models"
    print(f"{arguments.study}: study {study.name}, {counts}")
    for row in study.unusable:
        print(f"note: {row.message}")
    shipped, folder = Path(__file__).parents[1] / "config", arguments.study.resolve().parent
    read = [*map(Path, files.configuration), *(recording.file for recording in study.recordings)]
    read += [recording.mapping for recording in study.recordings if recording.mapping is not None]
    for path in sorted({path.resolve() for path in read}):
        if not path.is_relative_to(folder) and not path.is_relative_to(shipped):
            print(f"note: reads {path}, outside the study's folder")


def main(argv: list[str] | None = None) -> int:
    """Check the study; give the exit code."""
    return command_line.run(build_parser().parse_args(argv), check_study)


if __name__ == "__main__":
    sys.exit(main())
