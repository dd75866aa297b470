"""Command line: run one stage alone, as `python stages/NAME.py` does."""

from __future__ import annotations

import argparse

from shukotsu import command_line
from shukotsu.resources import ROOT

STAGES = ROOT / "stages"


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the stage's name; the stage parses its options."""
    names = sorted(path.stem for path in STAGES.glob("*.py"))
    stages = "".join(f"\n  {name}" for name in names)
    what = f"Run one stage of the pipeline alone, on typed tables.\n\nstages:{stages}"
    parser = command_line.parser("shukotsu stage", what, "shukotsu stage solve_joints --help")
    parser.usage = "shukotsu stage [-h] NAME ..."
    parser.add_argument("name", choices=names, metavar="NAME", help=argparse.SUPPRESS)
    return parser


def main(argv: list[str]) -> int:
    """Run the stage; return its exit code."""
    return command_line.run_script(STAGES / f"{build_parser().parse_args(argv[:1]).name}.py", argv[1:])
