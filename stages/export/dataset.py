"""Command line: all evaluated recordings of a study -> one Motion-BIDS dataset."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from stages import command_line
from stages.export.__main__ import add_motion_options, settings_of, write_format

if TYPE_CHECKING:
    from schemas.results import Results
    from schemas.study import Study


def build_parser() -> argparse.ArgumentParser:
    """Give the argument parser."""
    made = command_line.parser(
        "stages.export.dataset",
        "Write every evaluated recording of a study into one Motion-BIDS dataset: receivers and skeletons.",
        "python -m stages.export.dataset --study config/demo.yaml --results results/demo --models whole-hand "
        "--out exports/bids",
    )
    made.add_argument("--study", type=Path, required=True, help="the study file")
    made.add_argument("--results", type=Path, help="its results (default: results/ and the study's name)")
    made.add_argument("--models", required=True, help="skeleton models of the study, joined by commas")
    made.add_argument("--out", type=Path, required=True, help="the folder of the dataset, new or made before")
    made.add_argument("--licence", default="", help="words on the terms of use, to go into the dataset")
    add_motion_options(made)
    return made


def export(arguments: argparse.Namespace) -> None:
    """Write the dataset's own files, then its recordings one after the other.

    Raises InputError for the recordings that could not be written, once the others are; with --record-failure
    they are listed in a file beside it.
    """
    from schemas.errors import InputError
    from schemas.files import write_text
    from schemas.results import Results
    from schemas.study import read_participants, read_study
    from stages.export.motion_bids import DESCRIPTION, write_dataset_files

    study = read_study(arguments.study)
    results = Results(arguments.results) if arguments.results else Results.of(study.name)
    participants = {
        row["subject"]: {name: value for name, value in row.values.items() if name != "subject"}
        for row in read_participants(study.sheets.get("participants"))
        if row["subject"] in study.subjects
    }
    write_dataset_files(arguments.out, study.name, participants, arguments.licence)
    failures = _write_recordings(study, results, arguments, arguments.out / DESCRIPTION)
    if failures and not arguments.record_failure:
        raise InputError("; ".join(failures))
    if arguments.record_failure:
        for message in failures:
            print(f"error: {message}", file=sys.stderr)
        write_text(
            arguments.out.with_name(f"{arguments.out.name}.failed.txt"),
            "".join(f"{message}\n" for message in failures),
        )
    print(arguments.out)


def _write_recordings(study: Study, results: Results, arguments: argparse.Namespace, path: Path) -> list[str]:
    """Add every recording under every model; give a sentence for each that is not to be had."""
    from schemas.errors import InputError
    from schemas.layout import read_layout
    from schemas.model import read_model
    from stages.export.reading import read_motion

    failures, settings = [], settings_of(arguments)
    for model in arguments.models.split(","):
        if model not in study.models:
            raise InputError(
                f"--models: {arguments.study} has no model {model!r}; it has {', '.join(study.models)}"
            )
        made = read_model(study.models[model].absolute())
        for recording in study.shown:
            layout = read_layout(recording.layout.absolute())
            try:
                motion = read_motion(results, recording, layout, made, arguments.licence)
                for sentence in write_format(motion, settings, "bids", path):
                    print(f"{model}, {recording.hand.folder}/{recording.name}: {sentence}", file=sys.stderr)
            except InputError as error:
                failures.append(f"{model}, {recording.hand.folder}/{recording.name}: {error}")
    return failures


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the reason beside an empty dataset."""
    from schemas.files import write_text

    arguments.out.mkdir(parents=True, exist_ok=True)
    write_text(arguments.out.with_name(f"{arguments.out.name}.failed.txt"), f"{message}\n")


if __name__ == "__main__":
    sys.exit(command_line.run(build_parser().parse_args(), export, record_failure))
