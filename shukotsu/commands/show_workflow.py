"""Command line: where the Snakefile is, for Snakemake's own command line."""

from __future__ import annotations

import argparse

from shukotsu.commands.run_study import SNAKEFILE
from shukotsu.stages import command_line


def build_parser() -> argparse.ArgumentParser:
    """Give the command's argument parser."""
    return command_line.parser(
        "shukotsu workflow",
        "Print the path of the Snakefile, for Snakemake itself or for a module of another workflow: "
        'snakemake --snakefile "$(shukotsu workflow)" --configfile study.yaml --cores 2',
        "shukotsu workflow",
        records_failure=False,
    )


def main(argv: list[str]) -> int:
    """Print the Snakefile's path; give the exit code."""
    return command_line.run(build_parser, argv, lambda _: print(SNAKEFILE))
