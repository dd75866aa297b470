"""What every stage's command line shares: how it fails, and how it says so."""

from __future__ import annotations

import argparse
import signal
import sys
import traceback
from collections.abc import Callable
from pathlib import Path

from schemas.errors import InputError

EXIT_BAD_INPUT = 2


def parser(module: str, description: str, example: str) -> argparse.ArgumentParser:
    """Give a parser in the house's style: what it does, an example, one way to record failures."""
    made = argparse.ArgumentParser(
        prog=f"python -m {module}",
        description=description,
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument(
        "--record-failure",
        action="store_true",
        help="on bad input write the reason into the output tables and end with 0, so that a study goes on",
    )
    return made


def run(
    arguments: argparse.Namespace,
    work: Callable[[argparse.Namespace], None],
    record_failure: Callable[[argparse.Namespace, str], None],
) -> int:
    """Do the stage's work; turn bad input into one sentence on stderr and exit code 2.

    With --record-failure any failure is written into the outputs instead, with exit code 0. That holds
    for a bug too: it must not cost a study its other subjects, and its traceback stays in the log.
    """
    try:
        work(arguments)
    except InputError as error:
        message = str(error)
        print(f"error: {message}", file=sys.stderr)
        if not arguments.record_failure:
            return EXIT_BAD_INPUT
    except Exception as error:
        if not arguments.record_failure:
            raise
        traceback.print_exc()
        message = f"internal error ({type(error).__name__}: {error}); please report it with the log"
    else:
        return 0
    try:
        record_failure(arguments, message)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    return 0


def config_files(arguments: argparse.Namespace) -> list[Path]:
    """Give the files behind --layout and --model."""
    from schemas.config_files import config_path

    kinds = ("layout", "model")
    return [config_path(getattr(arguments, kind), kind, Path()) for kind in kinds]


def begin() -> None:
    """Begin a process of a study, one of hundreds that a cluster may end at any moment.

    Nothing in it finds pandas: pyarrow imports it where it is installed, which takes longer than most stages'
    work and serves nothing. When it is told to end, it removes what it had half written first.
    """
    sys.meta_path.insert(0, _WithoutPandas)
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))


class _WithoutPandas:
    @staticmethod
    def find_spec(name: str, *_: object) -> None:
        if name == "pandas":
            raise ModuleNotFoundError("pandas is not for the stages", name=name)
