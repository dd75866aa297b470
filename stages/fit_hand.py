"""Command line: fit the whole hand to its calibration, and pose recordings with it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu import command_line
from shukotsu.study import results, subject_stage

if TYPE_CHECKING:
    from shukotsu.fit.calibration import Fits
    from shukotsu.tables.parts import Part

WRITES = {"out": results.FIT_TABLES}


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage fit_hand",
        "Fit the whole hand at once to its calibration, and pose recordings with it.",
        "shukotsu stage fit_hand --plan results/demo/sub-01/plan.json --hand right --model whole-hand "
        "--findings results/demo/sub-01/findings.parquet --out results/demo/sub-01/fits/right/whole-hand\n"
        "  shukotsu stage fit_hand --poses rom/poses.parquet --replay opposition/poses.parquet "
        "--layout liberty16 --model whole-hand --out fit",
    )
    subject_stage.add_plan_options(
        parser,
        "findings",
        calibration="--poses",
        evaluated="--replay",
        sizes=("hand_length_mm", "hand_breadth_mm"),
        sheets=("measurements", "touches"),
    )
    command_line.add_outputs(parser, WRITES)
    other = "also fit the person's other hand, and write its tables to this folder"
    parser.add_argument("--out-other", type=Path, help=other)
    return parser


def each_hand(arguments: argparse.Namespace) -> list[argparse.Namespace]:
    """Return the arguments for each hand to fit, with the folder of its tables."""
    if arguments.out_other is None:
        return [arguments]
    other = {"hand": "left" if arguments.hand == "right" else "right", "out": arguments.out_other}
    return [arguments, argparse.Namespace(**vars(arguments) | other)]


def fit(arguments: argparse.Namespace) -> None:
    """Fit every skeleton of the hands and write the tables of the fits and of the posed recordings."""
    from shukotsu.fit.calibration import calibrated_hand
    from shukotsu.fit.compile_kernel import held_kernel
    from shukotsu.fit.part_tables import fitted_plan, fitted_tables, parts_of, write_fit
    from shukotsu.tables.typed_table import Provenance

    fits: Fits = {}
    for of_hand in each_hand(arguments):
        with held_kernel(alone=False):
            plan = fitted_plan(subject_stage.plan_of(of_hand), of_hand.hand, of_hand.model)
        files = subject_stage.poses_files(plan)
        if not plan.is_study:  # a study's sheets also have rows of other subjects
            files += plan.sheets.values()
        with subject_stage.writing(of_hand, WRITES, Provenance.of(files, plan.folder)) as tables:
            for part in parts_of(plan, of_hand.hand, of_hand.model):
                recorded = fitted_tables(plan, part, tables)
                with subject_stage.recording_failure(of_hand, part, *recorded):
                    write_fit(plan, part, tables, calibrated_hand(plan, part, fits))


def parts(arguments: argparse.Namespace, _: str) -> list[Part]:
    """Return the parts of a table: the skeletons of the hand under the model."""
    from shukotsu.fit.part_tables import fitted_plan, parts_of

    plan = fitted_plan(subject_stage.plan_of(arguments), arguments.hand, arguments.model)
    return parts_of(plan, arguments.hand, arguments.model)


main = subject_stage.script(build_parser, fit, WRITES, parts, each_hand)


if __name__ == "__main__":
    raise SystemExit(main())
