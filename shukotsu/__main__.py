"""Command line: `shukotsu`, one command a thing to do; only the module of that command is imported."""

from __future__ import annotations

import signal
import sys


def main(argv: list[str] | None = None) -> int:
    """Hand the arguments after the first to the command that the first one names; return its exit code."""
    if argv is None and hasattr(signal, "pthread_sigmask"):  # until there is a sentence for it
        signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
    import importlib

    from shukotsu import command_line
    from shukotsu.commands import COMMANDS, build_parser

    arguments = sys.argv[1:] if argv is None else argv

    def command() -> int:
        if not arguments:
            build_parser().print_help()
            return command_line.EXIT_BAD_INPUT
        module = importlib.import_module(COMMANDS[build_parser().parse_args(arguments[:1]).command].module)
        return int(module.main(arguments[1:]))

    status = command_line.run_command(command)
    command_line.block_ending(argv is None)  # nothing is left to be cut short but Python's own end
    return status


if __name__ == "__main__":
    sys.exit(main())
