"""Command line: what a tracker answers, and two seconds of what it sends; nothing is recorded."""

from __future__ import annotations

import argparse

from shukotsu.stages import command_line
from shukotsu.stages.capture import tracker_options


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = command_line.parser(
        "shukotsu tracker",
        "Set a tracker up as `record` does, say what it answers and what two seconds of its stream\n"
        "hold, and set it back. Exit code: 0 where it works, 2 where it does not.",
        "shukotsu tracker --port /dev/ttyUSB0",
        records_failure=False,
    )
    tracker_options.add_tracker(parser)
    return parser


def main(argv: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    return command_line.run(build_parser, argv, check_tracker)


def check_tracker(options: argparse.Namespace) -> None:
    """Print what there is to say of the tracker."""
    from shukotsu.trackers.record.port import open_port
    from shukotsu.trackers.record.recording_terminal import StopRequest, stop_on_signals
    from shukotsu.trackers.record.tracker_check import check

    request = tracker_options.recording_request(options)
    stop = StopRequest()
    with stop_on_signals(stop):
        port = open_port(options.port, options.baud, options.line_rate)
        try:
            for line in check(port, request, stop):
                print(line, flush=True)
        finally:
            port.close()
