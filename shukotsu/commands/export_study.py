"""Command line: the stage `export` for all subjects of a study that was run in this folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from shukotsu import command_line
from shukotsu.commands.study_file import add_study, read_files
from shukotsu.errors import InputError
from shukotsu.export.registry import DESCRIPTION, add_options


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser: the stage's options, and the study."""
    parser = command_line.parser(
        "shukotsu export",
        DESCRIPTION,
        "shukotsu export study.yaml --hand right --model whole-hand --formats bvh,glb --out exports",
        records_failure=False,
    )
    add_study(parser)
    add_options(parser)
    return parser


def plans(study: Path) -> list[Path]:
    """Return the plans of a study's subjects. Raises InputError where it has not been run in this folder."""
    files = read_files(study)
    every = [files.results.folder / f"sub-{who.token}" / "plan.json" for who in files.study.sessions]
    there = [path for path in every if path.is_file()]
    if not there:
        raise InputError(f"{every[0]}: is not there yet; run `shukotsu run {study}` in this folder first")
    return there


def export_study(arguments: argparse.Namespace) -> None:
    """Export what is asked for of every subject."""
    from shukotsu.export.exported_plans import export_plans
    from shukotsu.study.plan import plan_of_results

    arguments.plan, arguments.record_failure = plans(arguments.study), False
    export_plans({path: plan_of_results(path) for path in arguments.plan}, arguments)


def main(argv: list[str]) -> int:
    """Export; return the exit code."""
    return command_line.run(build_parser, argv, export_study)
