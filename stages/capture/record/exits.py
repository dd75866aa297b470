"""How `record`, `devices` and `check` read their words and end."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable

from schemas.errors import InputError
from stages.capture.trackers.settings import FAMILIES
from stages.command_line import EXIT_BAD_INPUT

EXIT_CUT_SHORT = 3
"""The recording ended before it was asked to: the port went away, or the disk was full. What came is kept."""


def parser(command: str, description: str, example: str) -> argparse.ArgumentParser:
    """Give a parser in the house's style."""
    return argparse.ArgumentParser(
        prog=f"python -m stages.capture {command}",
        description=description,
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )


def run(arguments: argparse.Namespace, work: Callable[[argparse.Namespace], int]) -> int:
    """Do the work and give its exit code; bad input is one sentence on stderr and exit code 2."""
    try:
        return work(arguments)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT


def add_tracker(made: argparse.ArgumentParser) -> None:
    """Add the options that say which tracker and how it shall send."""
    made.add_argument("--port", required=True, help="such as /dev/ttyUSB0 or socket://host:4001")
    made.add_argument("--tracker", choices=FAMILIES, default="liberty", help="default: liberty")
    made.add_argument("--baud", type=int, default=115200, help="of a serial device; default: 115200")
    made.add_argument(
        "--line-rate",
        type=int,
        metavar="BAUD",
        help="of the line behind a network port, if any",
    )
    made.add_argument("--rate", type=int, choices=(240, 120), help="of LIBERTY and VIPER; default: 240")
    made.add_argument("--items", default="full", help="output list: full, short or numbers such as 9,2,7")
    made.add_argument("--ascii", action="store_true", help="text instead of binary")
    made.add_argument("--stations", help="receivers such as 1-8,12; default: all that are connected")
    made.add_argument(
        "--hemisphere", default="1,0,0", metavar="X,Y,Z", help="half of space, or track; default: 1,0,0"
    )
    made.add_argument("--no-filters", action="store_true", help="switch the tracker's own filters off")
    made.add_argument(
        "--allow-slower", action="store_true", help="record though the line is too slow for every frame"
    )
