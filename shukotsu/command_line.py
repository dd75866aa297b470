"""Start and end of every command: exit codes, one sentence for each error, signals."""

from __future__ import annotations

import argparse
import errno
import io
import os
import runpy
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from shukotsu.errors import INTERNAL, InputError, TableError, on_one_line
from shukotsu.tables.limits import FILE_NAME_BYTES

EXIT_BAD_INPUT = 2
_SIGPIPE = 13
OF_THE_MACHINE = {
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE,
    errno.EAGAIN, errno.ESTALE, errno.ETIMEDOUT,
}  # fmt: skip
"""Errors of the machine (disk, memory, network), which are not recorded as results of a subject."""
ENDING = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)}
"""Signals by which a process is asked to end; Windows has no SIGHUP."""
ONE_THREAD = (
    "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS", "NUMBA_NUM_THREADS",
)  # fmt: skip
"""Environment variables for the number of threads, all set to 1 before any library is imported: the order of
summation, and so every bit of a result, must not depend on the machine; small matrices gain nothing from
threads."""


class Ended(SystemExit):
    """Raised where a signal asks this process to end. then : text added to its message after a semicolon."""

    def __init__(self, number: int, then: str = "") -> None:
        super().__init__(128 + number)
        self.number = number
        how = "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"
        self.sentence = "; ".join(filter(None, (how, then)))


def parser(
    program: str, description: str, example: str, *, records_failure: bool | None = None
) -> argparse.ArgumentParser:
    """Return a parser with a description and an example; that of a stage also has --record-failure."""
    built = argparse.ArgumentParser(
        prog=program,
        description=description,
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    built.register("type", Path, _path)
    built.set_defaults(stage=program.removeprefix("shukotsu stage "))
    if program.startswith("shukotsu stage ") if records_failure is None else records_failure:
        built.add_argument(
            "--record-failure",
            action="store_true",
            help="on bad input write the reason into the output tables and end with 0: a study goes on",
        )
    return built


def add_outputs(parser: argparse.ArgumentParser, writes: Mapping[str, str | Sequence[str]]) -> None:
    """Add a required option for each output of a stage: a table, or a folder of several tables."""
    for name, tables in writes.items():
        help_text = (
            f"the {tables} table to write" if isinstance(tables, str) else f"folder for {', '.join(tables)}"
        )
        parser.add_argument(option_of(name), type=Path, required=True, help=help_text)


def study_parser(stage: str, description: str) -> argparse.ArgumentParser:
    """Return the parser of a stage that works on a whole study and writes into its results folder."""
    example = f"shukotsu stage {stage} --study config/demo.yaml --results results/demo"
    built = parser(f"shukotsu stage {stage}", description, example, records_failure=False)
    add_study_options(built)
    return built


def add_study_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a stage that works on a whole study: its file and its results folder."""
    parser.add_argument("--study", type=Path, required=True, metavar="YAML", help="the study file")
    results = "the study's results folder"
    parser.add_argument("--results", type=Path, required=True, metavar="FOLDER", help=results)


def option_of(name: str) -> str:
    """Return the option of an argument, or of a table, of that name."""
    return f"--{name.replace('_', '-')}"


def _path(text: str) -> Path:
    """Convert an argument to a path; refuse an empty one, which comes from an unset variable of the shell."""
    if not text:
        raise argparse.ArgumentTypeError("is empty; expected a path")
    return Path(text)


def run(
    build_parser: Callable[[], argparse.ArgumentParser],
    argv: Sequence[str] | None,
    work: Callable[[argparse.Namespace], int | None],
    record_failure: Callable[[argparse.Namespace, str], None] | None = None,
    record_bug: Callable[[argparse.Namespace, str], None] | None = None,
) -> int:
    """Parse the arguments, do the work, which may return an exit code, and return the exit code.

    With --record-failure an error is written to the outputs instead of ending with 2, so that the study's
    other subjects continue. record_failure : writes the message, of bad input or of a bug, for a stage whose
    outputs have no parts. record_bug : writes that of a bug outside all parts, for a stage whose outputs
    have parts.
    """

    def command() -> int | None:
        status = None
        arguments = build_parser().parse_args(argv)
        record = record_failure or record_bug
        _refuse_odd_text(arguments)
        _refuse_outputs_over_inputs(arguments)
        asked = record is not None and arguments.record_failure
        with keep_failure(arguments, asked, only_bugs=record_failure is None) as messages:
            status = work(arguments)
        if messages and record is not None:
            record(arguments, messages[0])
        return status

    return run_command(command)


def script(
    build_parser: Callable[[], argparse.ArgumentParser],
    work: Callable[[argparse.Namespace], int | None],
    record_failure: Callable[[argparse.Namespace, str], None] | None = None,
    record_bug: Callable[[argparse.Namespace, str], None] | None = None,
) -> Callable[..., int]:
    """Return the `main` of a stage or command: it takes arguments and returns the exit code; see `run`."""
    return lambda argv=None: run(build_parser, argv, work, record_failure, record_bug)


def run_command(command: Callable[[], int | None]) -> int:
    """Run a command and return its exit code.

    0, or what the command returns; 2, with one sentence on stderr, for an error of the input, the
    configuration or the machine; 130 after Ctrl-C, 143 after SIGTERM and 129 after SIGHUP, each with a
    sentence; 141 where the reader of stdout has closed it. Any other exception is a bug and is raised.
    """
    try:
        begin()
        try:
            return command() or 0
        finally:
            sys.stdout.flush()  # and not when Python ends, in its own words
    except InputError as error:
        return _print_refusal(str(error))
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("shukotsu"):
            raise  # one of this program's own
        return _print_refusal(
            f"{error.name} is not installed for {sys.executable}; install this program again, with all that "
            "it needs (`pip install`, or `make demo` in its folder)"
        )
    except UnicodeEncodeError as error:  # of a path: what is printed was seen to
        return _print_refusal(
            f"{error.object!a}: no file can have this name in this system's encoding ({error.encoding}); set "
            "LC_ALL=C.UTF-8"
        )
    except MemoryError as error:
        return _print_refusal(
            f"not enough memory ({error or 'none is left'}); run fewer jobs at once, give the job more of "
            "it, or cut the recording"
        )
    except BrokenPipeError:  # whoever read what is printed has read enough
        sys.stdout = _nowhere()
        return 128 + _SIGPIPE
    except (KeyboardInterrupt, Ended) as asked:
        block_ending()
        end = asked if isinstance(asked, Ended) else Ended(signal.SIGINT)
        _print_refusal(end.sentence)
        return int(end.code or 0)
    except OSError as error:
        if error.filename is None:
            if error.errno not in OF_THE_MACHINE:
                raise
            sys.stdout = _nowhere()
        where = error.filename or "standard output, or a file"
        return _print_refusal(f"{where}: cannot be read or written ({error.strerror or error})")


def _print_refusal(why: str) -> int:
    """Print the reason on stderr, unless it is closed; return the exit code."""
    try:
        print(f"error: {why}", file=sys.stderr, flush=True)
    except OSError:
        sys.stderr = _nowhere()
    return EXIT_BAD_INPUT


def _nowhere() -> TextIO:
    """Return a replacement for a standard stream that is closed or full: Python flushes it at exit and would
    fail again.
    """
    return open(os.devnull, "r+", encoding="utf-8")  # noqa: PTH123


def _refuse_odd_text(arguments: argparse.Namespace) -> None:
    """Raise InputError where an argument is not UTF-8 text, which tables and captures need, or not a path."""
    for name, value in vars(arguments).items():
        option = option_of(name)
        for each in value if isinstance(value, list | tuple) else [value]:
            text = str(each)
            if name in ("subject", "task") and not text.strip():
                raise InputError(f"{option}: is empty; expected a name")
            if any("\ud800" <= letter <= "\udfff" for letter in text):
                raise InputError(f"{option}: {text}: is not UTF-8 text; write it in UTF-8")
            if not isinstance(each, Path):
                continue
            longest = max((len(part.encode()) for part in each.parts), default=0)
            if "\0" in text or longest > FILE_NAME_BYTES:
                raise InputError(f"{option}: {text}: no file can have this name; give a shorter, plain one")


def _refuse_outputs_over_inputs(arguments: argparse.Namespace) -> None:
    """Raise InputError where an output is also an input, which would be lost, or two outputs are one file."""
    named = [
        (name, path)
        for name, value in vars(arguments).items()
        for path in (value if isinstance(value, list | tuple) else [value])
        if isinstance(path, Path)
    ]
    for at, (name, path) in enumerate(named):
        if not name.startswith("out"):
            continue
        option = option_of(name)
        for other, read in named:
            if not other.startswith("out") and _same_file(path, read):
                raise InputError(
                    f"{option}: {path}: is the file that is read, which would be lost; give another name"
                )
        if any(other.startswith("out") and _same_file(path, former) for other, former in named[:at]):
            raise InputError(f"{option}: {path}: is to hold another output too; give each a name of its own")


def _same_file(first: Path, second: Path) -> bool:
    """Return whether two paths are the same file, also through a link; False for folders."""
    try:
        if first.is_dir() or second.is_dir():
            return False
        return first.resolve() == second.resolve() or first.samefile(second)
    except (OSError, RuntimeError):  # not there, or a link to itself: whoever opens it says so
        return False


@contextmanager
def keep_failure(
    arguments: argparse.Namespace, record: bool, *, only_bugs: bool = False
) -> Iterator[list[str]]:
    """Print and collect the message of an exception in the block; without `record` let it pass.

    A damaged table, a lack of memory or disk space, and a package that is not installed always pass: they
    are not results of a subject. only_bugs : let errors of the input pass too.
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
        messages.append(f"{INTERNAL} {arguments.stage} ({text}); please report it with the log")


def begin() -> None:
    """Prepare the process: one thread, signals, standard streams. May be called again.

    SIGTERM and SIGHUP raise `Ended`, so that files half written are removed. Closed standard streams are
    opened on the null device; otherwise the next file opened would get their descriptor.
    """
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    for name in ("stdin", "stdout", "stderr"):  # in the order of their numbers, the lowest of which is free
        if getattr(sys, name) is None:
            setattr(sys, name, _nowhere())
    if isinstance(sys.stdout, io.TextIOWrapper):  # a name that the terminal's encoding lacks must not end it
        sys.stdout.reconfigure(errors="backslashreplace")
    for number in ENDING - {signal.SIGINT}:
        with suppress(ValueError):  # not in the main thread
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, _end)
    block_ending(False)


def _end(number: int, _: object) -> None:
    raise Ended(number)


def block_ending(blocked: bool = True) -> None:
    """Block the signals that ask for an end, or unblock them, which delivers those pending."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK if blocked else signal.SIG_UNBLOCK, ENDING)


def run_script(path: str | Path, argv: Sequence[str]) -> int:
    """Run a stage's script in this process; return its exit code."""
    status: int = runpy.run_path(str(path))["main"](argv)
    return status
