"""Command line of the capture stage: one word says what to do, and only that module is imported."""

from __future__ import annotations

import argparse
import sys

from shukotsu.stages import command_line

COMMANDS = {
    "record": ("shukotsu.stages.capture.record_tracker", "record a tracker into a raw capture"),
    "import": ("shukotsu.stages.capture.import_and_check", "turn a recording's file into the poses table"),
    "inspect": (
        "shukotsu.stages.capture.inspect_file",
        "say what is in a file, and draft the mapping that it needs",
    ),
    "emulate": (
        "shukotsu.stages.capture.emulate_tracker",
        "be a tracker, for a recorder without one at hand",
    ),
}
"""Subcommand -> the module whose `main` takes its arguments, and what it does in a line."""


def build_parser() -> argparse.ArgumentParser:
    """Give the parser of the first word; every subcommand parses its own."""
    width = max(map(len, COMMANDS))
    parser = argparse.ArgumentParser(
        prog="shukotsu stage capture",
        description="Bring recordings into the pipeline.\n\ncommands:\n"
        + "\n".join(f"  {name:{width}}  {summary}" for name, (_, summary) in COMMANDS.items()),
        epilog="example:\n  shukotsu import --help",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("command", choices=COMMANDS, metavar="command", help=", ".join(COMMANDS))
    return parser


def main(arguments: list[str]) -> int:
    """Hand the arguments after the first to the subcommand that the first one names."""

    def command() -> int:
        module, _ = COMMANDS[build_parser().parse_args(arguments[:1]).command]
        return command_line.dispatched(module, arguments[1:])

    return command_line.ended(command)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
