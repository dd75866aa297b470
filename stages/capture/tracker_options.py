"""Options that `record` and `check` share."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from shukotsu.trackers.families import FAMILIES, USUAL, family_at

if TYPE_CHECKING:
    from shukotsu.trackers.record.request import RecordingRequest


def add_tracker(command_parser: argparse.ArgumentParser, *, required: bool = True) -> None:
    """Add the options that say which tracker and how it shall send."""
    add = command_parser.add_argument
    add(
        "--port",
        required=required,
        help="such as /dev/ttyUSB0, COM3, usb:, socket://host:4001, igtl://host:18944, lsl:NAME",
    )
    add("--tracker", choices=tuple(FAMILIES), help=f"default: {USUAL}, or what the port says")
    add("--baud", type=int, default=115200, help="of a serial device; default: 115200")
    add("--line-rate", type=int, metavar="BAUD", help="of the line behind a network port, if any")
    chosen = {family.title: family.rates_hz for family in FAMILIES.values() if len(family.rates_hz) > 1}
    rates_hz = sorted({rate for own in chosen.values() for rate in own}, reverse=True)
    add("--rate", type=int, choices=rates_hz, help=f"of {' and '.join(chosen)}; default: the fastest")
    add("--items", default="full", help="output list: full, short or numbers such as 9,2,7")
    add("--ascii", action="store_true", help="text instead of binary")
    add("--stations", help="receivers such as 1-8,12; default: all that are connected")
    add("--hemisphere", default="1,0,0", metavar="X,Y,Z", help="half of space, or track; default: 1,0,0")
    add("--no-filters", action="store_true", help="switch the tracker's own filters off")
    add("--allow-slower", action="store_true", help="record though the line is too slow for every frame")


def recording_request(options: argparse.Namespace) -> RecordingRequest:
    """Check what the options of `add_tracker` say. Raises InputError."""
    from shukotsu.trackers.record import request

    mode = "ascii" if options.ascii else "binary"
    family = family_at(options.port, options.tracker)
    return request.RecordingRequest(
        family,
        mode,
        request.parse_items(options.items, mode, family),
        options.rate,
        None if options.stations is None else request.parse_stations(options.stations),
        request.parse_hemisphere(options.hemisphere),
        options.no_filters,
    )
