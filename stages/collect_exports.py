"""Command line: collect the exports of all subjects in one folder, as hard links."""

from __future__ import annotations

import argparse
import os
import shutil
from pathlib import Path

from shukotsu import command_line
from shukotsu.tables.whole_files import replacing


def build_parser() -> argparse.ArgumentParser:
    """Return the argument parser."""
    parser = command_line.parser(
        "shukotsu stage collect_exports",
        "Link all files in several folders and their subfolders into one folder.",
        "shukotsu stage collect_exports --folders results/demo/sub-*/exports --out results/demo/exports",
    )
    parser.add_argument("--folders", type=Path, nargs="*", required=True, help="folders with exports")
    parser.add_argument("--out", type=Path, required=True, help="the folder to link them into")
    return parser


def collect(arguments: argparse.Namespace) -> None:
    """Link all files except hidden ones, such as Snakemake's time stamp of a folder."""
    arguments.out.mkdir(parents=True, exist_ok=True)
    for folder in arguments.folders:
        for path in sorted(folder.rglob("[!.]*")):
            if path.is_file():
                link_or_copy(path, arguments.out / path.relative_to(folder))


def link_or_copy(source: Path, target: Path) -> None:
    """Make `target` a hard link to `source`, or a copy if the file system has no hard links."""
    with replacing(target) as temporary:
        try:
            os.link(source, temporary)
        except OSError:
            shutil.copy2(source, temporary)


main = command_line.script(build_parser, collect)


if __name__ == "__main__":
    raise SystemExit(main())
