"""Command line: `shukotsu`, one command a thing to do; only the module of that command is imported."""

from __future__ import annotations

import sys

from shukotsu import command_line
from shukotsu.commands import COMMANDS, build_parser
from shukotsu.errors import InputError
from shukotsu.left import instead


def main(argv: list[str] | None = None) -> int:
    """Hand the arguments after the first to the command that the first one names; return its exit code."""
    return command_line.ended(lambda: _command(sys.argv[1:] if argv is None else argv))


def _command(argv: list[str]) -> int:
    if not argv:
        build_parser().print_help()
        return command_line.EXIT_BAD_INPUT
    if why := instead("command", argv[0]):
        raise InputError(why)
    command = COMMANDS[build_parser().parse_args(argv[:1]).command]
    return command_line.dispatched(command.module, argv[1:])


if __name__ == "__main__":
    sys.exit(main())
