"""Command line: record a tracker into a raw capture, show what it answers, or list the ports."""

from __future__ import annotations

import argparse
import sys
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

from shukotsu import command_line
from shukotsu.errors import InputError
from shukotsu.tables.line_printer import LinePrinter
from shukotsu.tracker.families import FAMILIES, USUAL

EXIT_CUT_SHORT = 3
"""Exit code if the recording ended early because the port was lost or the disk full; what arrived is kept."""


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu record",
        "Record every byte that a tracker sends; Ctrl-C or --duration ends it.\n"
        "Exit code: 0 after a stop that was requested, 2 if nothing could be recorded, 3 if the port was\n"
        "lost or the disk was full; what arrived until then is kept.",
        "shukotsu record --devices\n"
        "  shukotsu record --port /dev/ttyUSB0 --ask\n"
        "  shukotsu record --port /dev/ttyUSB0 --out rom.arrows --duration 60 --note rom",
    )
    add = parser.add_argument
    add("--port", help="such as /dev/ttyUSB0, COM3, usb:, socket://host:4001")
    add("--tracker", default=USUAL, help=f"{', '.join(FAMILIES)} (default: {USUAL})")
    add("--baud", type=int, default=115200, help="of a serial device (default: 115200)")
    chosen = {family.title: family.rates_hz for family in FAMILIES.values() if len(family.rates_hz) > 1}
    rates_hz = sorted({rate for rates in chosen.values() for rate in rates}, reverse=True)
    add("--rate", type=int, choices=rates_hz, help=f"of {' and '.join(chosen)} (default: the fastest)")
    add("--items", choices=("full", "short"), default="full", help="content of a record (default: full)")
    add("--stations", help="receivers such as 1-8,12 (default: all that are connected)")
    add("--hemisphere", default="1,0,0", metavar="X,Y,Z", help="half of space, or track (default: 1,0,0)")
    add("--no-filters", action="store_true", help="switch the tracker's own filters off")
    add("--out", type=Path, help="the archive to write (.arrows)")
    add("--duration", type=float, metavar="S", help="stop after this many seconds")
    add("--note", action="append", default=[], metavar="TEXT", help="note to store with the recording")
    add("--quiet", action="store_true", help="print only notes and the summary, not the current state")
    add("--devices", action="store_true", help="record nothing: list the ports at which a tracker may be")
    add("--ask", action="store_true", help="record nothing: show what the tracker answers and sends in 2 s")
    return parser


def record_tracker(options: argparse.Namespace) -> None:
    """Record and print a summary; or list the ports, or show what the tracker answers.

    Raises SystemExit with EXIT_CUT_SHORT if the recording ended early.
    """
    from shukotsu.tracker import conversation, display, session
    from shukotsu.tracker.port import open_port, port_lines, serial_ports, usb_devices

    if options.devices:
        print("\n".join(port_lines(serial_ports(), usb_devices())))
        return
    if options.port is None:
        raise InputError("--port: is missing; `shukotsu record --devices` lists those there are")
    stations = None if options.stations is None else conversation.parse_stations(options.stations)
    hemisphere, is_short = conversation.parse_hemisphere(options.hemisphere), options.items == "short"
    request = conversation.RecordingRequest(
        options.tracker, is_short, options.rate, stations, hemisphere, options.no_filters
    )
    if options.duration is not None and not 0 < options.duration < 1e6:
        raise InputError(f"--duration: is {options.duration:g}; expected seconds above 0")
    if not options.ask and (options.out is None or options.out.suffix != ".arrows"):
        raise InputError(f"--out: is {options.out or 'missing'}; expected a name that ends with .arrows")
    stop = conversation.StopRequest()
    with conversation.stop_on_signals(stop), closing(open_port(options.port, options.baud)) as port:
        if options.ask:
            for line in session.check(port, request, stop):
                print(line, flush=True)
            return
        other = ("out", "note", "devices", "ask")
        stated = {name: value for name, value in vars(options).items() if name not in other}
        about = {"options": stated, "notes": options.note, "opened_utc": datetime.now(UTC).isoformat()}
        notes = tuple(options.note)
        plan = session.RecordingPlan(options.out, request, options.duration, notes, options.quiet)
        ending = session.record(plan, port, LinePrinter(sys.stderr), stop, about)
    out, port = options.out, options.port
    if ending.totals is None:
        print(f"stopped before the first frame ({ending.reason}); no file is left", file=sys.stderr)
        return
    summary = display.summary(str(out), ending.reason, ending.totals, ending.notices)
    LinePrinter(sys.stdout).say("\n".join(summary))
    if not ending.failed:
        return
    seconds = ending.totals["seconds"]
    kept_s = ending.totals.get("seconds_kept", seconds)
    message = f"{port}: {ending.reason} after {seconds:.1f} s; {out} keeps the first {kept_s:.1f} s"
    LinePrinter(sys.stderr).say(f"error: {message}")
    sys.exit(EXIT_CUT_SHORT)


main = command_line.script(build_parser, record_tracker)
