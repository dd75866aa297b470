"""Command line: all evaluated recordings of a study -> one Motion-BIDS dataset."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stages import command_line
from stages.export.export_options import add_motion_options, settings_of
from stages.export.registry import write_format

if TYPE_CHECKING:
    from schemas.plan import SubjectPlan


def build_parser() -> argparse.ArgumentParser:
    """Give the argument parser."""
    parser = command_line.parser(
        "stages.export.dataset",
        "Write every evaluated recording of a study into one Motion-BIDS dataset: receivers and skeletons.",
        "python -m stages.export.dataset --plans results/demo/sub-*/plan.json --model whole-hand "
        "--participants data/demo/participants.tsv --out exports/bids",
    )
    parser.add_argument("--plans", type=Path, nargs="+", required=True, help="the subjects' plans")
    parser.add_argument(
        "--model", "--models", default="", help="skeleton models, joined by commas (default: all)"
    )
    parser.add_argument("--participants", type=Path, help="the study's sheet of participants, if it has one")
    parser.add_argument(
        "--out", type=Path, required=True, help="the folder of the dataset, new or made before"
    )
    add_motion_options(parser)
    return parser


def export(arguments: argparse.Namespace) -> None:
    """Write the dataset's own files, then its recordings one after the other.

    Raises InputError for the recordings that could not be written, once the others are; with --record-failure
    they are listed in a file beside it.
    """
    from schemas.errors import InputError
    from schemas.files import write_text
    from schemas.plan import read_plan
    from stages.export.motion_bids import write_dataset_files
    from stages.export.plan_selection import chosen_models

    plans = [read_plan(path) for path in arguments.plans]
    models = [
        chosen_models(plan, path, arguments.model) for plan, path in zip(plans, arguments.plans, strict=True)
    ]
    participants = _participants(arguments.participants, plans)
    write_dataset_files(arguments.out, plans[0].study, participants, arguments.licence)
    failures = [
        failure
        for plan, own in zip(plans, models, strict=True)
        for failure in _write_recordings(plan, own, arguments)
    ]
    if failures and not arguments.record_failure:
        raise InputError("; ".join(failures))
    if arguments.record_failure:
        for message in failures:
            print(f"error: {message}", file=sys.stderr)
        write_text(_failures_file(arguments.out), "".join(f"{message}\n" for message in failures))
    print(arguments.out)


def _participants(path: Path | None, plans: Sequence[SubjectPlan]) -> Mapping[str, Mapping[str, Any]]:
    """Columns of the participants sheet, by subject of the plans."""
    from schemas.sheets import PARTICIPANTS, read_sheet

    subjects = {plan.subject for plan in plans}
    return {
        row["subject"]: {name: value for name, value in row.values.items() if name != "subject"}
        for row in read_sheet(path, PARTICIPANTS)
        if row["subject"] in subjects
    }


def _write_recordings(
    plan: SubjectPlan, models: Sequence[str], arguments: argparse.Namespace
) -> Iterator[str]:
    """Add every recording under every model; give a sentence for each that could not be written."""
    from schemas.bids.dataset_files import DESCRIPTION
    from schemas.errors import InputError
    from stages.export.recorded_motion import read_motion

    settings = settings_of(arguments)
    for model in models:
        for recording in (recording for hand in plan.hands for recording in plan.evaluated(hand)):
            which = f"{model}, {recording.hand.folder}/{recording.name}"
            try:
                motion = read_motion(plan, recording, model, arguments.licence)
                for remark in write_format([motion], settings, "bids", arguments.out / DESCRIPTION):
                    print(f"{which}: {remark}", file=sys.stderr)
            except InputError as error:
                yield f"{which}: {error}"


def _failures_file(dataset: Path) -> Path:
    return dataset.with_name(f"{dataset.name}.failed.txt")


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the reason beside an empty dataset."""
    from schemas.files import write_text

    arguments.out.mkdir(parents=True, exist_ok=True)
    write_text(_failures_file(arguments.out), f"{message}\n")


def main(argv: list[str] | None = None) -> int:
    """Run the command; give its exit code."""
    return command_line.run(build_parser().parse_args(argv), export, record_failure)


if __name__ == "__main__":
    sys.exit(main())
