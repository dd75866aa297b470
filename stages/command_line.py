"""Every stage's command line fails in the same way, and says so."""

from __future__ import annotations

import argparse
import errno
import io
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from shukotsu.errors import InputError, TableError, on_one_line
from shukotsu.files.limits import FILE_NAME_BYTES, too_little_to_start
from shukotsu.sentences.messages import message_of

EXIT_BAD_INPUT = 2
OF_THE_MACHINE = {
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE,
    errno.EAGAIN, errno.ESTALE, errno.ETIMEDOUT,
}  # fmt: skip
"""Errors of the system that come and go with the machine: nothing that a table should say of a subject."""


def parser(
    program: str, description: str, example: str, *, records_failure: bool = True
) -> argparse.ArgumentParser:
    """Give a parser in the house's style: what it does, an example, one way to record failures."""
    built = argparse.ArgumentParser(
        prog=program,
        description=description,
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    built.set_defaults(stage=program.removeprefix("shukotsu stage "))
    if records_failure:
        built.add_argument(
            "--record-failure",
            action="store_true",
            help="on bad input write the reason into the output tables and end with 0: a study goes on",
        )
    return built


def run(
    arguments: argparse.Namespace,
    work: Callable[[argparse.Namespace], None],
    record_failure: Callable[[argparse.Namespace, str], None] | None = None,
    record_bug: Callable[[argparse.Namespace, str], None] | None = None,
) -> int:
    """Do the stage's work; turn bad input into one sentence on stderr and exit code 2.

    record_failure : of a stage whose outputs have no parts; with --record-failure called with the message in
    place of ending with 2, also for a bug, which must not cost a study its other subjects. record_bug : of a
    stage whose outputs have parts, called so for a bug that is in none of them.
    """
    record = record_failure or record_bug
    if isinstance(sys.stdout, io.TextIOWrapper):  # a name that the terminal's encoding lacks must not end it
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        _refuse_odd_text(arguments)
        _refuse_outputs_over_inputs(arguments)
        asked = record is not None and arguments.record_failure
        with recorded(arguments, asked, only_bugs=record_failure is None) as messages:
            work(arguments)
        if messages and record is not None:
            record(arguments, messages[0])
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("shukotsu"):
            raise  # one of this program's own
        print(
            f"error: {error.name} is not installed for {sys.executable}; install this program again, with "
            "all that it needs (`pip install`, or `make demo` in its folder)",
            file=sys.stderr,
        )
        return EXIT_BAD_INPUT
    except UnicodeEncodeError as error:  # of a path: what is printed was seen to
        print(
            f"error: {error.object!a}: no file can have this name in this system's encoding "
            f"({error.encoding}); set LC_ALL=C.UTF-8",
            file=sys.stderr,
        )
        return EXIT_BAD_INPUT
    except BrokenPipeError:  # whoever read what is printed has read enough
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115 - for what Python still flushes
        return 128 + signal.SIGPIPE
    except MemoryError as error:
        print(
            f"error: not enough memory ({error or 'none is left'}); run fewer jobs at once, give the job "
            "more of it, or cut the recording",
            file=sys.stderr,
        )
        return EXIT_BAD_INPUT
    return 0


def _refuse_odd_text(arguments: argparse.Namespace) -> None:
    """Raise InputError where an argument is not in UTF-8, as tables and captures have it, or no path."""
    for name, value in vars(arguments).items():
        option = f"--{name.replace('_', '-')}"
        for each in value if isinstance(value, list | tuple) else [value]:
            text = str(each)
            if any("\ud800" <= letter <= "\udfff" for letter in text):
                raise InputError(f"{option}: {text}: is not UTF-8 text; write it in UTF-8")
            if not isinstance(each, Path):
                continue
            longest = max((len(part.encode()) for part in each.parts), default=0)
            if "\0" in text or longest > FILE_NAME_BYTES:
                raise InputError(f"{option}: {text}: no file can have this name; give a shorter, plain one")


def _refuse_outputs_over_inputs(arguments: argparse.Namespace) -> None:
    """Raise InputError where a file to write is one to read, which would be lost, or another one to write."""
    named = [
        (name, path)
        for name, value in vars(arguments).items()
        for path in (value if isinstance(value, list | tuple) else [value])
        if isinstance(path, Path)
    ]
    for at, (name, path) in enumerate(named):
        if not name.startswith("out"):
            continue
        option = f"--{name.replace('_', '-')}"
        for other, read in named:
            if not other.startswith("out") and _same_file(path, read):
                raise InputError(
                    f"{option}: {path}: is the file that is read, which would be lost; give another name"
                )
        if any(other.startswith("out") and _same_file(path, own) for other, own in named[:at]):
            raise InputError(f"{option}: {path}: is to hold another output too; give each a name of its own")


def _same_file(first: Path, second: Path) -> bool:
    """Whether two paths are of one file, be it by a link; a folder takes several."""
    try:
        if first.is_dir() or second.is_dir():
            return False
        return first.resolve() == second.resolve() or first.samefile(second)
    except (OSError, RuntimeError):  # not there, or a link to itself: whoever opens it says so
        return False


@contextmanager
def recorded(arguments: argparse.Namespace, record: bool, *, only_bugs: bool = False) -> Iterator[list[str]]:
    """Keep and print the message of what is raised inside; raise it without `record`.

    A TableError is raised, and that memory or the disk's room ran out or a package is not installed: no
    results of a subject's. only_bugs : raise bad input too.
    """
    messages: list[str] = []
    try:
        yield messages
    except (TableError, MemoryError, ModuleNotFoundError):
        raise
    except InputError as error:
        if not record or only_bugs:
            raise
        messages.append(error.message)
        print(f"error: {error}", file=sys.stderr)
    except Exception as error:  # also a bug must not cost the study its other parts
        if not record or (isinstance(error, OSError) and error.errno in OF_THE_MACHINE):
            raise
        traceback.print_exc()
        text = on_one_line(f"{type(error).__name__}: {error}")
        messages.append(message_of("internal", stage=arguments.stage, text=text))


def can_start() -> bool:
    """Say whether there is the memory that libraries take, which would end the process in their own words."""
    too_little = too_little_to_start()
    if too_little:
        print(f"error: {too_little}", file=sys.stderr)
    return not too_little


def begin() -> None:
    """Begin a process of a study, one of hundreds that a cluster may end at any moment.

    When it is asked to end, it removes what it had half written first.
    """
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
