"""Command line: a tracker -> raw archive, with a live view."""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from shukotsu.errors import InputError
from shukotsu.stages import command_line
from shukotsu.stages.capture import tracker_options

if TYPE_CHECKING:
    from shukotsu.trackers.record.session import Ending, RecordingPlan

EXIT_CUT_SHORT = 3
"""The recording ended before it was asked to: the port went away, or the disk was full. What came is kept."""


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = command_line.parser(
        "shukotsu record",
        "Record every byte that a tracker sends, with a live view; q, Ctrl-C or --duration ends it.\n"
        "Exit code: 0 after a stop that was asked for, 2 where nothing could be recorded, 3 where the port\n"
        "went away or the disk was full; what came until then is kept.",
        "shukotsu record --port /dev/ttyUSB0 --out rom.arrows --duration 60 --note rom",
        records_failure=False,
    )
    tracker_options.add_tracker(parser)
    parser.add_argument("--out", type=Path, required=True, help="the archive to write (.arrows)")
    parser.add_argument("--duration", type=float, metavar="S", help="stop after so many seconds")
    parser.add_argument("--countdown", type=int, default=0, metavar="S", help="count so many seconds first")
    parser.add_argument(
        "--lsl-outlet", nargs="?", const="shukotsu", metavar="NAME", help="send it as an LSL stream too"
    )
    parser.add_argument("--note", action="append", default=[], metavar="TEXT", help="kept with the recording")
    parser.add_argument(
        "--marks",
        action="store_true",
        help='keep lines of JSON from standard input, read in place of keys: {"kind": "stop"} ends it',
    )
    parser.add_argument("--quiet", action="store_true", help="show no state, only notes and the summary")
    return parser


def main(argv: list[str]) -> int:
    """Run the subcommand; gives the exit code, and ends the program with another where it was cut short."""
    return command_line.run(build_parser, argv, record_tracker)


def record_tracker(options: argparse.Namespace) -> None:
    """Record, and say what was kept."""
    from shukotsu.trackers.record import session
    from shukotsu.trackers.record.marks import Marks
    from shukotsu.trackers.record.port import open_port
    from shukotsu.trackers.record.recording_terminal import StopRequest, Terminal, stop_on_signals

    plan = recording_plan(options)
    about = _about(options, plan)
    stop = StopRequest()
    with stop_on_signals(stop):
        port = open_port(options.port, options.baud, options.line_rate)
        try:
            marks = Marks(0, stop) if options.marks else None
            with Terminal(sys.stderr, None if marks else sys.stdin) as terminal:
                ending = session.record(plan, port, terminal, stop, about, marks=marks)
        finally:
            port.close()
    _report(options.out, options.port, ending)


def recording_plan(options: argparse.Namespace) -> RecordingPlan:
    """Check the options. Raises InputError."""
    from shukotsu.trackers.record.session import RecordingPlan

    if options.duration is not None and not 0 < options.duration < 1e6:
        raise InputError(f"--duration: is {options.duration:g}; expected seconds above 0")
    if options.countdown < 0:
        raise InputError(f"--countdown: is {options.countdown}; expected 0 or more seconds")
    if options.out.suffix != ".arrows":
        raise InputError(f"--out: is {options.out}; expected a name that ends with .arrows")
    outlet = None
    if options.lsl_outlet is not None:
        from shukotsu.trackers.lsl.outlet import Outlet
        from shukotsu.trackers.lsl.port import pylsl

        pylsl()
        outlet = partial(Outlet, options.lsl_outlet)
    return RecordingPlan(
        options.out,
        tracker_options.recording_request(options),
        options.duration,
        options.countdown,
        tuple(options.note),
        options.allow_slower,
        outlet,
        options.quiet,
    )


def _about(options: argparse.Namespace, plan: RecordingPlan) -> dict[str, Any]:
    """Describe the recording, for the archive."""
    from datetime import UTC, datetime

    named = {name: value for name, value in vars(options).items() if name not in ("out", "note")}
    named["tracker"] = plan.request.family
    return {"options": named, "notes": options.note, "opened_utc": datetime.now(UTC).isoformat()}


def _report(out: Path, port: str, ending: Ending) -> None:
    """Print the summary; raises SystemExit where the recording was cut short."""
    from shukotsu.trackers.record import display

    if ending.totals is None:
        print(f"stopped before the first frame ({ending.reason}); no file is left", file=sys.stderr)
        return
    _print("\n".join(display.summary(str(out), ending.reason, ending.totals, ending.notices)), sys.stdout)
    if not ending.failed:
        return
    seconds = ending.totals["seconds"]
    kept_s = ending.totals.get("seconds_kept", seconds)
    message = f"{port}: {ending.reason} after {seconds:.1f} s; {out} keeps the first {kept_s:.1f} s"
    _print(f"error: {message}", sys.stderr)
    sys.exit(EXIT_CUT_SHORT)


def _print(text: str, stream: TextIO) -> None:
    """Print; where the terminal is gone nobody reads, and what is left in the buffer must not fail again."""
    try:
        print(text, file=stream, flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
