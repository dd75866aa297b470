"""Command line: replay skeletons and measure the errors of their tips."""

from __future__ import annotations

import argparse

from shukotsu import command_line
from shukotsu.study import results, subject_stage

WRITES = {"out": "tips", "out_errors": "tip_errors"}


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage evaluate_tips",
        "Replay the skeleton and measure how far its tips are from the distal receivers (section 6).",
        "shukotsu stage evaluate_tips --poses opposition/poses.parquet "
        "--calibration rom/poses.parquet --joint-centres joint_centres.parquet "
        "--bone-lengths bone_lengths.parquet --metacarpals metacarpals.parquet --layout liberty16 "
        "--model paper-fig4 --out tips.parquet --out-errors tip_errors.parquet",
    )
    subject_stage.add_plan_options(
        parser, "findings", *results.SKELETON_TABLES, calibration="--calibration", evaluated="--poses"
    )
    command_line.add_outputs(parser, WRITES)
    return parser


def evaluate(arguments: argparse.Namespace) -> None:
    """Replay every skeleton of the plan in its recordings and write both tables."""
    from shukotsu.paper.replay import write_replay
    from shukotsu.tables.catalogue import TABLES
    from shukotsu.tables.parts import opened_once, part_metadata

    plan = subject_stage.plan_of(arguments)
    made_of = [plan.table(name) for name in results.SKELETON_TABLES]
    for path, name in zip(made_of, results.SKELETON_TABLES, strict=True):
        part_metadata(path, TABLES[name])  # raises an error if it is a different table
    files = [*subject_stage.poses_files(plan), *subject_stage.config_files(arguments)]
    provenance = subject_stage.provenance_of(plan, made_of, files)
    subject_stage.check_made_together(*made_of)
    with opened_once() as opened, subject_stage.writing(arguments, WRITES, provenance) as tables:
        for part in plan.parts():
            with subject_stage.recording_failure(arguments, part, *tables.values()):
                write_replay(plan, part, opened, tables["tips"], tables["tip_errors"])


main = subject_stage.script(build_parser, evaluate, WRITES)


if __name__ == "__main__":
    raise SystemExit(main())
