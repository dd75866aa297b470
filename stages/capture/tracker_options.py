"""Options that `record` and `coach` share."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from shukotsu.trackers.families import FAMILIES, USUAL

if TYPE_CHECKING:
    from shukotsu.trackers.record.request import RecordingRequest


def add_tracker(command_parser: argparse.ArgumentParser) -> None:
    """Add the options that say which tracker and how it shall send."""
    add = command_parser.add_argument
    add("--port", help="such as /dev/ttyUSB0, COM3, usb:, socket://host:4001")
    add("--tracker", default=USUAL, help=f"{', '.join(FAMILIES)} (default: {USUAL})")
    add("--baud", type=int, default=115200, help="of a serial device (default: 115200)")
    chosen = {family.title: family.rates_hz for family in FAMILIES.values() if len(family.rates_hz) > 1}
    rates_hz = sorted({rate for rates in chosen.values() for rate in rates}, reverse=True)
    add("--rate", type=int, choices=rates_hz, help=f"of {' and '.join(chosen)} (default: the fastest)")
    add("--items", choices=("full", "short"), default="full", help="what a record holds (default: full)")
    add("--stations", help="receivers such as 1-8,12 (default: all that are connected)")
    add("--hemisphere", default="1,0,0", metavar="X,Y,Z", help="half of space, or track (default: 1,0,0)")
    add("--no-filters", action="store_true", help="switch the tracker's own filters off")


def recording_request(options: argparse.Namespace) -> RecordingRequest:
    """Check what the options of `add_tracker` say. Raises InputError."""
    from shukotsu.trackers.record import request

    return request.RecordingRequest(
        options.tracker,
        options.items == "short",
        options.rate,
        None if options.stations is None else request.parse_stations(options.stations),
        request.parse_hemisphere(options.hemisphere),
        options.no_filters,
    )
