"""Command line: a subject's skeletons, recordings and their truth -> skeleton_scores, joint_errors."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from shukotsu.stages import command_line, subject_stage


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage evaluate_skeletons",
        "Score every skeleton of a subject, beside references and, for simulated hands, against the truth.",
        "shukotsu stage evaluate_skeletons --plan results/demo/sub-01/plan.json "
        "--out skeleton_scores.parquet --out-joints joint_errors.parquet",
    )
    subject_stage.add_plan(parser, "the subject's plan, whose folder holds its tables", required=True)
    parser.add_argument("--out", type=Path, required=True, help="the skeleton_scores table to write")
    parser.add_argument("--out-joints", type=Path, required=True, help="the joint_errors table to write")
    return parser


def evaluate(arguments: argparse.Namespace) -> None:
    """Score the skeletons of each hand in every recording, write both tables."""
    from shukotsu.anatomy.known_digits import known_digits
    from shukotsu.schemas.catalogue import JOINT_ERRORS, SKELETON_SCORES
    from shukotsu.schemas.config_files import REFERENCE
    from shukotsu.schemas.parts import parts_writer
    from shukotsu.schemas.plan import read_plan
    from shukotsu.stages.evaluate_skeletons.evaluation import evaluate_hand

    plan = read_plan(arguments.plan, arguments.inputs)
    names = ("joint_centres", "bone_lengths", "metacarpals", "tips", "tip_errors")
    fitted = [(hand, model) for hand in plan.layouts for model in plan.fitted_models]
    fitted += [(hand, REFERENCE) for hand, layout in plan.layouts.items() if known_digits(layout)]
    fits = [plan.fit_table(hand, model, "posed_tips") for hand, model in fitted]
    tables = [*map(plan.table, names), *fits]
    provenance = subject_stage.provenance_of(plan, tables, subject_stage.poses_files(plan))
    with (
        parts_writer(arguments.out, SKELETON_SCORES, provenance) as scores,
        parts_writer(arguments.out_joints, JOINT_ERRORS, provenance) as errors,
    ):
        for hand in plan.layouts:
            part = plan.part(hand)
            with subject_stage.recording_failure(arguments, part, scores, errors):
                score_rows, joint_rows = evaluate_hand(plan, hand)
                scores.rows(part, _first_of_each(score_rows, SKELETON_SCORES.key))
                errors.rows(part, _first_of_each(joint_rows, JOINT_ERRORS.key))


def _first_of_each(rows: list[dict[str, object]], key: tuple[str, ...]) -> list[dict[str, object]]:
    """Rows whose key no earlier one has: a model that never used a task is the same without it."""
    first: dict[tuple[object, ...], dict[str, object]] = {}
    for row in rows:
        first.setdefault(tuple(row.get(name) for name in key), row)
    return list(first.values())


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why no skeleton was scored, of every hand."""
    from shukotsu.schemas.catalogue import JOINT_ERRORS, SKELETON_SCORES
    from shukotsu.schemas.plan import read_plan

    plan = read_plan(arguments.plan, arguments.inputs)
    tables = {arguments.out: SKELETON_SCORES, arguments.out_joints: JOINT_ERRORS}
    subject_stage.record_failed_parts(message, tables, map(plan.part, plan.hands))


def main(argv: list[str] | None = None) -> int:
    """Run the stage; return its exit code."""
    return command_line.run(build_parser, argv, evaluate, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
