"""Command line: export skeletons and their motion in formats of other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from shukotsu import command_line
from shukotsu.study import results, subject_stage

TABLES = ("findings", *results.SKELETON_TABLES)
POSED = ("joint_angles", "bone_poses", "posed_tips", "moved_receivers")


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    from shukotsu.export.registry import DESCRIPTION, add_options

    parser = command_line.parser(
        "shukotsu stage export",
        DESCRIPTION,
        "shukotsu stage export --plan results/demo/sub-01/plan.json --hand right --recording opposition "
        "--model whole-hand --formats bvh,csv --out exports",
    )
    add = parser.add_argument
    add("--plan", type=Path, nargs="+", required=True, help="subjects' plans, beside their tables")
    add("--poses", type=Path, nargs="*", default=[], dest="evaluated", help="poses, with the tables below")
    subject_stage.add_tables(parser, *TABLES, *POSED)
    add_options(parser)
    return parser


def export(arguments: argparse.Namespace) -> None:
    """Export from the named tables of one subject, or from the tables beside each plan."""
    from shukotsu.errors import InputError
    from shukotsu.export.exported_plans import export_plans
    from shukotsu.study.plan_file import plan_of_results

    paths = arguments.plan
    if not any(vars(arguments)[name] for name in (*arguments.tables, "evaluated")):
        export_plans({path: plan_of_results(path) for path in paths}, arguments)
    elif len(paths) > 1:
        raise InputError("--plan: names several subjects; name tables of only one subject, or no tables")
    else:
        options = argparse.Namespace(**vars(arguments) | {"plan": paths[0]})
        export_plans({paths[0]: subject_stage.plan_of(options)}, arguments)


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the reason why nothing was exported."""
    from shukotsu.export import exported_plans

    exported_plans.record_failure(arguments, message)


main = command_line.script(build_parser, export, record_failure)


if __name__ == "__main__":
    raise SystemExit(main())
