"""Command line: one stage alone, as `python -m stages.NAME` runs it."""

from __future__ import annotations

import argparse
from pathlib import Path

from shukotsu.stages import command_line

STAGES = Path(__file__).parents[1] / "stages"
FURTHER = ("export.collect", "report.subject")
"""Commands of stages beside their own."""


def stages() -> dict[str, str]:
    """Return every stage and further command of one, with the module whose `main` runs it."""
    names = [path.parent.name for path in STAGES.glob("*/__main__.py")]
    packages = {name: f"shukotsu.stages.{name}.__main__" for name in [*names, "report.print_figures"]}
    return dict(sorted((packages | {name: f"shukotsu.stages.{name}" for name in FURTHER}).items()))


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the stage's name; every stage parses its own options."""
    parser = argparse.ArgumentParser(
        prog="shukotsu stage",
        usage="shukotsu stage [-h] NAME ...",
        description="Run one stage of the pipeline alone, on typed tables.\n\nstages:\n"
        + "\n".join(f"  {name}" for name in stages()),
        epilog="example:\n  shukotsu stage solve_joints --help",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("name", choices=stages(), metavar="NAME", help=argparse.SUPPRESS)
    return parser


def main(argv: list[str]) -> int:
    """Run the stage; return its exit code."""
    module = stages()[build_parser().parse_args(argv[:1]).name]
    return command_line.dispatched(module, argv[1:])
