"""Options and exit codes that `record`, `check`, `devices` and `emulate` share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from schemas.errors import InputError
from stages.command_line import EXIT_BAD_INPUT
from trackers.families import FAMILIES

if TYPE_CHECKING:
    from trackers.record.request import RecordingRequest

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


def run(options: argparse.Namespace, work: Callable[[argparse.Namespace], int]) -> int:
    """Do the work and give its exit code; bad input is one sentence on stderr and exit code 2."""
    try:
        return work(options)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT


def add_tracker(command_parser: argparse.ArgumentParser) -> None:
    """Add the options that say which tracker and how it shall send."""
    add = command_parser.add_argument
    add("--port", required=True, help="such as /dev/ttyUSB0 or socket://host:4001")
    add("--tracker", choices=tuple(FAMILIES), default="liberty", help="default: liberty")
    add("--baud", type=int, default=115200, help="of a serial device; default: 115200")
    add("--line-rate", type=int, metavar="BAUD", help="of the line behind a network port, if any")
    add("--rate", type=int, choices=(240, 120), help="of LIBERTY and VIPER; default: 240")
    add("--items", default="full", help="output list: full, short or numbers such as 9,2,7")
    add("--ascii", action="store_true", help="text instead of binary")
    add("--stations", help="receivers such as 1-8,12; default: all that are connected")
    add("--hemisphere", default="1,0,0", metavar="X,Y,Z", help="half of space, or track; default: 1,0,0")
    add("--no-filters", action="store_true", help="switch the tracker's own filters off")
    add("--allow-slower", action="store_true", help="record though the line is too slow for every frame")


def recording_request(options: argparse.Namespace) -> RecordingRequest:
    """Check what the options of `add_tracker` say. Raises InputError."""
    from trackers.record import request

    mode = "ascii" if options.ascii else "binary"
    return request.RecordingRequest(
        options.tracker,
        mode,
        request.parse_items(options.items, mode, options.tracker),
        options.rate,
        None if options.stations is None else request.parse_stations(options.stations),
        request.parse_hemisphere(options.hemisphere),
        options.no_filters,
    )
