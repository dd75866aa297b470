"""Command line: run the demo study in this folder, print its outcome and the path of its report."""

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
        f"in {SHEETS}, results in results/demo. Existing files are kept; only what is out of date is run.",
        "shukotsu demo --cores 2",
    )
    parser.add_argument("--cores", default="all", metavar="N", help="jobs at once (default: all)")
    return parser


def run_demo(arguments: argparse.Namespace) -> int:
    """Write the study file and those of its sheets that do not exist; run the study, return the exit code."""
    for shipped in (ROOT / STUDY, *sorted((ROOT / SHEETS).glob("*.tsv"))):
        path = shipped.relative_to(ROOT)
        if not path.exists():
            write_text(path, shipped.read_text("utf-8"))
    return run_study.main([str(STUDY), "--cores", arguments.cores])


main = command_line.script(build_parser, run_demo)
