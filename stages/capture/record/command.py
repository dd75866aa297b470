"""Command line: a tracker -> raw archive, with a live view."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from schemas.errors import InputError
from stages.capture.record import exits

if TYPE_CHECKING:
    from stages.capture.record.session import Ending, Plan
    from stages.capture.record.wishes import Wishes


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = exits.parser(
        "record",
        "Record every byte that a tracker sends, with a live view; q, Ctrl-C or --duration ends it.\n"
        "Exit code: 0 after a stop that was asked for, 2 where nothing could be recorded, 3 where the port\n"
        "went away or the disk was full; what came until then is kept.",
        "python -m stages.capture record --port /dev/ttyUSB0 --out rom.arrows --duration 60 --note rom",
    )
    exits.add_tracker(parser)
    parser.add_argument("--out", type=Path, required=True, help="the archive to write (.arrows)")
    parser.add_argument("--duration", type=float, metavar="S", help="stop after so many seconds")
    parser.add_argument("--countdown", type=int, default=0, metavar="S", help="count so many seconds first")
    parser.add_argument("--note", action="append", default=[], metavar="TEXT", help="kept with the recording")
    return parser


def main(arguments: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    return exits.run(build_parser().parse_args(arguments), record_tracker)


def record_tracker(arguments: argparse.Namespace) -> int:
    """Record, and say what was kept."""
    from stages.capture.record import session
    from stages.capture.record.port import open_port
    from stages.capture.record.stopping import Stop, signals_ask
    from stages.capture.record.terminal import Terminal

    plan = plan_of(arguments)
    about = about_of(arguments)
    stop = Stop()
    with signals_ask(stop):
        port = open_port(arguments.port, arguments.baud, arguments.line_rate)
        try:
            with Terminal(sys.stderr, sys.stdin) as terminal:
                ending = session.record(plan, port, terminal, stop, about)
        finally:
            port.close()
    return _told(arguments.out, arguments.port, ending)


def plan_of(arguments: argparse.Namespace) -> Plan:
    """Check the arguments. Raises InputError."""
    from stages.capture.record.session import Plan

    if arguments.duration is not None and not 0 < arguments.duration < 1e6:
        raise InputError(f"--duration: is {arguments.duration:g}; expected seconds above 0")
    if arguments.countdown < 0:
        raise InputError(f"--countdown: is {arguments.countdown}; expected 0 or more seconds")
    if arguments.out.suffix != ".arrows":
        raise InputError(f"--out: is {arguments.out}; expected a name that ends with .arrows")
    return Plan(
        arguments.out,
        wishes_of(arguments),
        arguments.duration,
        arguments.countdown,
        tuple(arguments.note),
        arguments.allow_slower,
    )


def wishes_of(arguments: argparse.Namespace) -> Wishes:
    """Check what the arguments ask of the tracker. Raises InputError."""
    from stages.capture.record import wishes

    mode = "ascii" if arguments.ascii else "binary"
    if arguments.rate is not None and arguments.tracker not in ("liberty", "viper"):
        raise InputError(f"--rate: a {arguments.tracker} has a rate of its own; leave it out")
    return wishes.Wishes(
        arguments.tracker,
        mode,
        wishes.parse_items(arguments.items, mode, arguments.tracker),
        arguments.rate,
        None if arguments.stations is None else wishes.parse_stations(arguments.stations),
        wishes.parse_hemisphere(arguments.hemisphere),
        arguments.no_filters,
    )


def about_of(arguments: argparse.Namespace) -> dict[str, Any]:
    """Say what the recording is, for the archive."""
    from datetime import UTC, datetime

    options = {name: value for name, value in vars(arguments).items() if name not in ("out", "note")}
    return {"options": options, "notes": arguments.note, "opened_utc": datetime.now(UTC).isoformat()}


def _told(out: Path, port: str, ending: Ending) -> int:
    """Print the summary; gives the exit code."""
    from stages.capture.record import summary

    if ending.totals is None:
        print(f"stopped before the first frame ({ending.reason}); no file is left", file=sys.stderr)
        return 0
    _print("\n".join(summary.lines(str(out), ending.reason, ending.totals, ending.notices)), sys.stdout)
    if not ending.failed:
        return 0
    seconds = ending.totals["seconds"]
    kept_s = ending.totals.get("seconds_kept", seconds)
    message = f"{port}: {ending.reason} after {seconds:.1f} s; {out} keeps the first {kept_s:.1f} s"
    _print(f"error: {message}", sys.stderr)
    return exits.EXIT_CUT_SHORT


def _print(text: str, stream: TextIO) -> None:
    """Print; where the terminal is gone nobody reads, and what is left in the buffer must not fail again."""
    try:
        print(text, file=stream, flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
