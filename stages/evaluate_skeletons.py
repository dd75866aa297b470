"""Command line: score a subject's skeletons on recordings and, if known, against the truth."""

from __future__ import annotations

import argparse

from shukotsu import command_line
from shukotsu.study import results, subject_stage

WRITES = {"out": "skeleton_scores", "out_joints": "joint_errors"}
READS = (*results.SKELETON_TABLES, "tips", "tip_errors")
FITTED = ("posed_tips", "bone_poses", "fitted_joints", "fitted_bones")


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage evaluate_skeletons",
        "Score every skeleton of a subject, beside references and, for simulated hands, against the truth.",
        "shukotsu stage evaluate_skeletons --plan plan.json --findings findings.parquet "
        "--joint-centres joint_centres.parquet --bone-lengths bone_lengths.parquet "
        "--metacarpals metacarpals.parquet --tips tips.parquet --tip-errors tip_errors.parquet "
        "--posed-tips fits/right/*/posed_tips.parquet --bone-poses fits/right/*/bone_poses.parquet "
        "--fitted-joints fits/right/*/fitted_joints.parquet --fitted-bones fits/right/*/fitted_bones.parquet "
        "--out skeleton_scores.parquet --out-joints joint_errors.parquet",
    )
    subject_stage.add_plan_options(parser, "findings", *READS, *FITTED, evaluated="--poses")
    command_line.add_outputs(parser, WRITES)
    return parser


def evaluate(arguments: argparse.Namespace) -> None:
    """Score the skeletons of each hand in every recording and write both tables."""
    from shukotsu.hand.known_digits import known_digits
    from shukotsu.scores.evaluation import evaluate_hand
    from shukotsu.study.config_files import REFERENCE

    plan = subject_stage.plan_of(arguments)
    fits = plan.fits_of_hands()
    fits += [(hand, REFERENCE) for hand, layout in plan.layouts.items() if known_digits(layout)]
    made_of = [*map(plan.table, READS), *(plan.table("posed_tips", *fit) for fit in fits)]
    provenance = subject_stage.provenance_of(plan, made_of, subject_stage.poses_files(plan))
    with subject_stage.writing(arguments, WRITES, provenance) as tables:
        for hand in plan.layouts:
            part = plan.part(hand)
            with subject_stage.recording_failure(arguments, part, *tables.values()):
                scores, errors = evaluate_hand(plan, hand)
                tables["skeleton_scores"].rows(part, scores)
                tables["joint_errors"].rows(part, errors)


main = subject_stage.script(build_parser, evaluate, WRITES, subject_stage.hands_of)


if __name__ == "__main__":
    raise SystemExit(main())
