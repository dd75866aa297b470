"""Command line: estimate the wrist point, bone lengths and metacarpal postures from joint centres."""

from __future__ import annotations

import argparse

from shukotsu import command_line
from shukotsu.study import subject_stage

WRITES = {"out_joints": "joint_centres", "out_bones": "bone_lengths", "out": "metacarpals"}
FITTED = ("fitted_joints", "fitted_bones", "bone_poses")


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage estimate_metacarpals",
        "Locate the wrist, measure the bones and pose the metacarpals (Eq. 8-11 of the paper).",
        "shukotsu stage estimate_metacarpals --projected-joints projected_joints.parquet "
        "--calibration rom/poses.parquet --poses opposition/poses.parquet --layout liberty16 "
        "--model paper-fig4 --out-joints joint_centres.parquet --out-bones bone_lengths.parquet "
        "--out metacarpals.parquet",
    )
    subject_stage.add_plan_options(
        parser, "findings", "projected_joints", *FITTED, calibration="--calibration", evaluated="--poses"
    )
    command_line.add_outputs(parser, WRITES)
    return parser


def estimate(arguments: argparse.Namespace) -> None:
    """Build every skeleton of the plan and write the three tables."""
    from shukotsu.paper.skeleton import write_skeleton
    from shukotsu.tables.parts import opened_once

    plan = subject_stage.plan_of(arguments)
    fits = [plan.table(name, *fit) for fit in plan.fits_of_hands() for name in FITTED]
    files = [*subject_stage.poses_files(plan), *subject_stage.config_files(arguments)]
    provenance = subject_stage.provenance_of(plan, [plan.table("projected_joints"), *fits], files)
    with opened_once() as opened, subject_stage.writing(arguments, WRITES, provenance) as tables:
        for part in plan.parts():
            with subject_stage.recording_failure(arguments, part, *tables.values()):
                write_skeleton(plan, part, opened, tables)


main = subject_stage.script(build_parser, estimate, WRITES)


if __name__ == "__main__":
    raise SystemExit(main())
