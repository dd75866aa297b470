"""Command line `shukotsu COMMAND`; only the module of that command is imported."""

from __future__ import annotations

import signal
import sys


def main(argv: list[str] | None = None) -> int:
    """Run the command that the first argument names with the other arguments; return its exit code."""
    if argv is None and hasattr(signal, "pthread_sigmask"):  # until `run_command` can report them
        signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
    import importlib

    from shukotsu import command_line
    from shukotsu.commands import COMMANDS, build_parser

    arguments = sys.argv[1:] if argv is None else argv

    def command() -> int:
        if not arguments:
            build_parser().print_help()
            return command_line.EXIT_BAD_INPUT
        name = COMMANDS[build_parser().parse_args(arguments[:1]).command].module
        return int(importlib.import_module(f"shukotsu.commands.{name}").main(arguments[1:]))

    status = command_line.run_command(command)
    command_line.block_ending(argv is None)  # the work is done; let Python exit undisturbed
    return status


if __name__ == "__main__":
    sys.exit(main())
