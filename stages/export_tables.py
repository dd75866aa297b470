"""Command line: export the study's tables as CSV with a data dictionary (a Frictionless data package)."""

from __future__ import annotations

import argparse
from pathlib import Path

from shukotsu import command_line


def build_parser() -> argparse.ArgumentParser:
    """Return the argument parser."""
    parser = command_line.parser(
        "shukotsu stage export_tables",
        "Write tables as CSV with descriptions of their columns: a Frictionless data package, for R etc.",
        "shukotsu stage export_tables --tables results/demo/*.parquet --study demo --out tidy",
    )
    parser.add_argument("--tables", type=Path, nargs="+", required=True, help="tables of the study")
    parser.add_argument("--study", default="study", help="the study's name (default: study)")
    parser.add_argument("--out", type=Path, required=True, help="the folder to write tables/ into")
    return parser


def write(arguments: argparse.Namespace) -> None:
    """Write the package."""
    from shukotsu.export.data_package import write_tables

    write_tables(arguments.tables, arguments.study, arguments.out)


main = command_line.script(build_parser, write)


if __name__ == "__main__":
    raise SystemExit(main())
