"""Command line: a recording's file -> its poses table (section 2 of the paper)."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from shukotsu import command_line, job
from shukotsu.readers.import_recording import build_parser, import_recording, record_failure


def main(argv: Sequence[str] | None = None) -> int:
    """Run the stage, which `shukotsu import` does before it checks; return the exit code."""
    return command_line.run(build_parser, argv, import_recording, record_failure)


if __name__ == "__main__":
    sys.exit(job.run(main))
