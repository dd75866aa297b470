"""Command line: run the demo's study in this folder, print its tables and name its report."""

from __future__ import annotations

import argparse
from pathlib import Path

from shukotsu import command_line
from shukotsu.commands import run_study
from shukotsu.resources import ROOT
from shukotsu.tables.whole_files import write_text

STUDY = Path("config", "demo.yaml")
SHEETS = Path("data", "demo")


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu demo",
        f"Run the demo, a study of two simulated people, in this folder: {STUDY}, its sheets and recordings "
        f"in {SHEETS}, results in results/demo. What is there is kept; what is up to date is not made again.",
        "shukotsu demo --cores 2",
    )
    parser.add_argument("--cores", default="all", metavar="N", help="jobs at once (default: all)")
    return parser


def run_demo(arguments: argparse.Namespace) -> int:
    """Write the study file and its sheets, those that are not there; run it, and return the exit code."""
    for shipped in (ROOT / STUDY, *sorted((ROOT / SHEETS).glob("*.tsv"))):
        path = shipped.relative_to(ROOT)
        if not path.exists():
            write_text(path, shipped.read_text("utf-8"))
    return run_study.main([str(STUDY), "--cores", arguments.cores])


main = command_line.script(build_parser, run_demo)
