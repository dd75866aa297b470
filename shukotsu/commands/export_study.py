"""Command line: run the stage `export` for all subjects of a study that was run in this folder."""

from __future__ import annotations

import argparse
from shlex import quote

from shukotsu import command_line
from shukotsu.commands import add_study, read_files
from shukotsu.errors import InputError
from shukotsu.export.registry import DESCRIPTION, add_options


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser: the stage's options, and the study."""
    parser = command_line.parser(
        "shukotsu export",
        DESCRIPTION,
        "shukotsu export study.yaml --hand right --model whole-hand --formats bvh,glb --out exports",
    )
    add_study(parser)
    add_options(parser)
    return parser


def export_study(arguments: argparse.Namespace) -> None:
    """Export every subject as requested. Raises InputError if the study was not run in this folder."""
    from shukotsu.export.exported_plans import export_plans
    from shukotsu.study.plan_file import plan_of_results

    files = read_files(arguments.study)
    every = [files.results.folder / f"sub-{who.token}" / "plan.json" for who in files.study.sessions]
    arguments.plan, arguments.record_failure = [path for path in every if path.is_file()], False
    if not arguments.plan:
        what = f"run `shukotsu run {quote(str(arguments.study))}` in this folder first"
        raise InputError(f"{every[0]}: does not exist yet; {what}")
    export_plans({path: plan_of_results(path) for path in arguments.plan}, arguments)


main = command_line.script(build_parser, export_study)
