"""Start and end of every command: options, exit codes, one sentence for each error, and signals."""

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
from typing import Any, TextIO

from shukotsu.errors import INTERNAL, InputError, TableError, on_one_line
from shukotsu.tables.limits import FILE_NAME_BYTES

EXIT_BAD_INPUT = 2
_SIGPIPE = 13
MACHINE_ERRORS = {
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE,
    errno.EAGAIN, errno.ESTALE, errno.ETIMEDOUT,
}  # fmt: skip
"""Errors of the machine (disk, memory, network), which are not recorded as results of a subject."""
ENDING = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)}
"""Signals that ask a process to end; Windows has no SIGHUP."""
ONE_THREAD = (
    "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS", "NUMBA_NUM_THREADS",
)  # fmt: skip
"""Environment variables for the number of threads, all set to 1 before any library is imported. The order of
summation, and with it the last bits of a result, must not depend on the machine; computations on small
matrices gain nothing from threads."""


class Ended(SystemExit):
    """Raised when a signal asks this process to end; then : text to append to the message."""

    def __init__(self, number: int, then: str = "") -> None:
        super().__init__(128 + number)
        self.number = number
        how = "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"
        self.sentence = "; ".join(filter(None, (how, then)))


def parser(program: str, description: str, example: str) -> argparse.ArgumentParser:
    """Return a parser with a description and an example."""
    built = argparse.ArgumentParser(
        prog=program,
        description=description,
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    built.register("type", Path, _path)
    built.set_defaults(stage=program.removeprefix("shukotsu stage "))
    return built


def add_outputs(parser: argparse.ArgumentParser, writes: Mapping[str, str | Sequence[str]]) -> None:
    """Add a required option for each output of a stage, which is a table or a folder of several tables."""
    for name, tables in writes.items():
        is_one = isinstance(tables, str)
        what = f"the {tables} table to write" if is_one else f"folder for {', '.join(tables)}"
        parser.add_argument(option_of(name), type=Path, required=True, help=what)


def study_parser(stage: str, description: str) -> argparse.ArgumentParser:
    """Return the parser of a stage that works on a whole study and writes into its results folder."""
    example = f"shukotsu stage {stage} --study config/demo.yaml --results results/demo"
    built = parser(f"shukotsu stage {stage}", description, example)
    add_study_options(built)
    return built


def add_study_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a stage that works on a whole study: its file and its results folder."""
    parser.add_argument("--study", type=Path, required=True, metavar="YAML", help="the study file")
    results = "the study's results folder"
    parser.add_argument("--results", type=Path, required=True, metavar="FOLDER", help=results)


def option_of(name: str) -> str:
    """Return the command-line option for the name of an argument or table."""
    return f"--{name.replace('_', '-')}"


def _path(text: str) -> Path:
    """Convert an argument to a path; reject an empty one, which may come from an unset shell variable."""
    if not text:
        raise argparse.ArgumentTypeError("is empty; expected a path")
    return Path(text)


def script(
    build_parser: Callable[[], argparse.ArgumentParser],
    work: Callable[[argparse.Namespace], int | None],
    record_failure: Callable[[argparse.Namespace, str], None] | None = None,
    record_bug: Callable[[argparse.Namespace, str], None] | None = None,
) -> Callable[..., int]:
    """Return the `main` function of a stage or command, which returns the exit code.

    It takes the arguments, by default those of this process, parses them and does the work. If it can write
    an error to the outputs, it has the option --record-failure, which does so instead of ending with 2, so
    that the study's other subjects continue.

    Parameters
    ----------
    build_parser
        Function that returns the parser.
    work
        Function that is called with the parsed arguments and may return an exit code.
    record_failure
        For a stage whose outputs have no parts: writes a message, of bad input or of a bug, to the outputs.
    record_bug
        For a stage whose outputs have parts: writes the message of a bug outside all parts.

    """

    def command(argv: Sequence[str] | None) -> int | None:
        status = None
        parser, record = build_parser(), record_failure or record_bug
        if record is not None:
            how = "on bad input write the reason into the output tables and end with 0: a study continues"
            parser.add_argument("--record-failure", action="store_true", help=how)
        arguments = parser.parse_args(argv)
        _refuse_odd_text(arguments)
        _refuse_outputs_over_inputs(arguments)
        is_recorded = record is not None and arguments.record_failure
        with keep_failure(arguments, is_recorded, only_bugs=record_failure is None) as messages:
            status = work(arguments)
        if messages and record is not None:
            record(arguments, messages[0])
        return status

    return lambda argv=None: run_command(lambda: command(argv))


def run_command(command: Callable[[], int | None]) -> int:
    """Run a command and return its exit code.

    It is 0 or what the command returns; 2, with one sentence on stderr, after an error of the input, the
    configuration or the machine; 130 after Ctrl-C, 143 after SIGTERM and 129 after SIGHUP, each with a
    sentence; 141 if the reader of stdout has closed it. Any other exception is a bug and is raised.
    """
    try:
        begin()
        try:
            return command() or 0
        finally:
            sys.stdout.flush()  # here, where an error can still be reported in one sentence
    except InputError as error:
        return _print_refusal(str(error))
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("shukotsu"):
            raise  # a bug: the module is part of this program
        return _print_refusal(
            f"{error.name} is not installed for {sys.executable}; install this program again, with all that "
            "it needs (`pip install`, or `make demo` in its folder)"
        )
    except UnicodeEncodeError as error:  # from a path: `begin` makes all text printable
        return _print_refusal(
            f"{error.object!a}: no file can have this name in this system's encoding ({error.encoding}); set "
            "LC_ALL=C.UTF-8"
        )
    except MemoryError as error:
        return _print_refusal(
            f"not enough memory ({error or 'none is left'}); run fewer jobs at once, give the job more of "
            "it, or cut the recording"
        )
    except BrokenPipeError:  # the reader of stdout, such as `head`, has ended
        sys.stdout = _nowhere()
        return 128 + _SIGPIPE
    except (KeyboardInterrupt, Ended) as asked:
        block_ending()
        end = asked if isinstance(asked, Ended) else Ended(signal.SIGINT)
        _print_refusal(end.sentence)
        return int(end.code or 0)
    except OSError as error:
        if error.filename is None:
            if error.errno not in MACHINE_ERRORS:
                raise
            sys.stdout = _nowhere()
        where = error.filename or "standard output, or a file"
        return _print_refusal(f"{where}: cannot be read or written ({error.strerror or error})")


def _print_refusal(why: str) -> int:
    """Print the reason on stderr, unless stderr is closed; return the exit code for bad input."""
    try:
        print(f"error: {why}", file=sys.stderr, flush=True)
    except OSError:
        sys.stderr = _nowhere()
    return EXIT_BAD_INPUT


def _nowhere() -> TextIO:
    """Return a replacement for a standard stream that is closed or full.

    Python flushes standard streams at exit, which would fail again.
    """
    return open(os.devnull, "r+", encoding="utf-8")  # noqa: PTH123


def _values(arguments: argparse.Namespace) -> Iterator[tuple[str, Any]]:
    """Yield the name of each argument with each of its values."""
    for name, value in vars(arguments).items():
        for each in value if isinstance(value, list | tuple) else [value]:
            yield name, each


def _refuse_odd_text(arguments: argparse.Namespace) -> None:
    """Raise InputError if an argument is not UTF-8 text, as tables and captures require, or no valid path."""
    for name, value in _values(arguments):
        option, text = option_of(name), str(value)
        if name in ("subject", "task") and not text.strip():
            raise InputError(f"{option}: is empty; expected a name")
        if any("\ud800" <= letter <= "\udfff" for letter in text):
            raise InputError(f"{option}: {text}: is not UTF-8 text; write it in UTF-8")
        if not isinstance(value, Path):
            continue
        longest = max((len(part.encode()) for part in value.parts), default=0)
        if "\0" in text or longest > FILE_NAME_BYTES:
            raise InputError(f"{option}: {text}: no file can have this name; give a shorter, plain one")


def _refuse_outputs_over_inputs(arguments: argparse.Namespace) -> None:
    """Raise InputError if an output is also an input, which would be lost, or if two outputs are one file."""
    paths = [(name, path) for name, path in _values(arguments) if isinstance(path, Path)]
    inputs = [path for name, path in paths if not name.startswith("out")]
    outputs: list[Path] = []
    for name, path in paths:
        if not name.startswith("out"):
            continue
        output = f"{option_of(name)}: {path}"
        if any(_same_file(path, read) for read in inputs):
            raise InputError(f"{output}: is also an input, which would be overwritten; give another name")
        if any(_same_file(path, former) for former in outputs):
            raise InputError(f"{output}: is also the file of another output; give a different name")
        outputs.append(path)


def _same_file(first: Path, second: Path) -> bool:
    """Return whether two paths lead to the same file, also through links; False for folders."""
    try:
        if first.is_dir() or second.is_dir():
            return False
        return first.resolve() == second.resolve() or first.samefile(second)
    except (OSError, RuntimeError):  # missing, or a link to itself: opening the file reports it
        return False


@contextmanager
def keep_failure(
    arguments: argparse.Namespace, record: bool, *, only_bugs: bool = False
) -> Iterator[list[str]]:
    """Catch an exception in the block, print its message and put it into the list that is yielded.

    record : if False, exceptions are raised instead. only_bugs : raise errors of the input as well. A damaged
    table, a lack of memory or disk space and a missing package are always raised: a subject's data does not
    cause them.
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
    except Exception as error:  # the study must not lose its other parts to a bug in one
        if not record or (isinstance(error, OSError) and error.errno in MACHINE_ERRORS):
            raise
        traceback.print_exc()
        text = on_one_line(f"{type(error).__name__}: {error}")
        messages.append(f"{INTERNAL} {arguments.stage} ({text}); please report it with the log")


def begin() -> None:
    """Prepare the process: one thread, signal handlers, standard streams. It can be called repeatedly.

    SIGTERM and SIGHUP raise `Ended`, so that partly written files are removed. Closed standard streams are
    opened on the null device; otherwise the next file to be opened would get their descriptor.
    """
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    for name in ("stdin", "stdout", "stderr"):  # in order: open() takes the lowest free descriptor
        if getattr(sys, name) is None:
            setattr(sys, name, _nowhere())
    if isinstance(sys.stdout, io.TextIOWrapper):  # print names that the encoding lacks as escapes
        sys.stdout.reconfigure(errors="backslashreplace")
    for number in ENDING - {signal.SIGINT}:
        with suppress(ValueError):  # not in the main thread
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, _end)
    block_ending(False)


def _end(number: int, _: object) -> None:
    raise Ended(number)


def block_ending(blocked: bool = True) -> None:
    """Block the signals in ENDING, or unblock them, which delivers those that are pending."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK if blocked else signal.SIG_UNBLOCK, ENDING)


def run_script(path: str | Path, argv: Sequence[str]) -> int:
    """Run a stage's script in this process and return its exit code."""
    status: int = runpy.run_path(str(path))["main"](argv)
    return status
