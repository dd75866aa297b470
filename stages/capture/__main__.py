"""Command line of the capture stage: one word says what to do, and only that module is imported."""

from __future__ import annotations

import argparse
import importlib
import sys
from dataclasses import dataclass


@dataclass(frozen=True)
class Command:
    """One subcommand: the module whose `main` takes its arguments, and what it does in a line."""

    module: str
    summary: str


COMMANDS = {
    "record": Command("stages.capture.record_tracker", "record a tracker into a raw capture"),
    "devices": Command("stages.capture.list_devices", "list the ports at which a tracker may be"),
    "check": Command("stages.capture.check_tracker", "say what a tracker answers, without recording"),
    "decode": Command("stages.capture.decode_capture", "turn a raw capture into a table of every record"),
    "import": Command("stages.capture.import_recording", "turn a recording's file into the poses table"),
    "inspect": Command(
        "stages.capture.inspect_file", "say what is in a file, and draft the mapping that it needs"
    ),
    "emulate": Command("stages.capture.emulate_tracker", "be a tracker, for a recorder without one at hand"),
    "export-bids": Command("stages.capture.export_bids", "write poses tables into a Motion-BIDS dataset"),
}


def build_parser() -> argparse.ArgumentParser:
    """Give the parser of the first word; every subcommand parses its own."""
    width = max(map(len, COMMANDS))
    parser = argparse.ArgumentParser(
        prog="python -m stages.capture",
        description="Bring recordings into the pipeline.\n\ncommands:\n"
        + "\n".join(f"  {name:{width}}  {command.summary}" for name, command in COMMANDS.items()),
        epilog="example:\n  python -m stages.capture import --help",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("command", choices=COMMANDS, metavar="command", help=", ".join(COMMANDS))
    return parser


def main(arguments: list[str]) -> int:
    """Hand the arguments after the first to the subcommand that the first one names."""
    command = COMMANDS[build_parser().parse_args(arguments[:1]).command]
    status: int = importlib.import_module(command.module).main(arguments[1:])
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
