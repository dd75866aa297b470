"""What every stage's command line shares: how it fails, and how it says so."""

from __future__ import annotations

import argparse
import errno
import io
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schemas.errors import INTERNAL, InputError, TableError
from schemas.limits import FILE_NAME_BYTES, HAND_SIZES_MM

if TYPE_CHECKING:
    from checks.checked_recording import CheckedRecording
    from schemas.layout import Layout
    from schemas.parts import Part, PartsWriter
    from schemas.plan import SubjectPlan
    from schemas.tables import Provenance, Table

EXIT_BAD_INPUT = 2
OF_THE_MACHINE = {
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE,
    errno.EAGAIN, errno.ESTALE, errno.ETIMEDOUT,
}  # fmt: skip
"""Errors of the system that come and go with the machine: nothing that a table should say of a subject."""


def add_plan_options(
    parser: argparse.ArgumentParser,
    *,
    calibration: str = "",
    evaluated: str = "",
    sizes: Sequence[str] = (),
    sheets: Sequence[str] = (),
) -> None:
    """Add the options that say which hands a stage works on; `plan_of` reads them.

    A study gives --plan. A hand alone is given by poses files, a layout and a model: calibration, evaluated
    are names of the options for files, such as --poses, sizes and sheets of those that the stage uses.
    """
    parser.add_argument(
        "--plan", type=Path, help="the subject's plan, in place of the options of a hand alone"
    )
    alone = parser.add_argument_group("a hand alone")
    for dest, option, help_text in (
        ("calibration", calibration, "poses files that the joints are solved from"),
        ("evaluated", evaluated, "poses files to evaluate the hand in"),
    ):
        if option:
            alone.add_argument(option, dest=dest, type=Path, nargs="*", default=[], help=help_text)
    alone.add_argument("--layout", help="a layout that ships, or a path")
    alone.add_argument("--model", help="a skeleton model that ships, or a path")
    alone.add_argument("--subject", help="whose hand (default: as the poses say)")
    alone.add_argument("--session", help="in which session (default: as the poses say)")
    alone.add_argument("--hand", choices=("right", "left"), help="which hand (default: as the poses say)")
    for name in sizes:
        alone.add_argument(f"--{name.replace('_', '-')}", type=float, help=_SIZES[name])
    for name in sheets:
        alone.add_argument(f"--{name}", type=Path, help=f"sheet of {name}")


_SIZES = {
    "hand_length_mm": "wrist crease to the middle finger's tip (default: not measured)",
    "hand_breadth_mm": "across the knuckles of digits 2 to 5 (default: not measured)",
}
"""Help of the sizes of a hand."""


def plan_of(arguments: argparse.Namespace, joints: tuple[Path, Table] | None = None) -> SubjectPlan:
    """Read the plan that the options of `add_plan_options` name, or make one of a hand alone.

    joints : a subject table, and which one it is to be, that says whose hand it is where no poses file does.
    Raises InputError where neither is given, where a size is none that a hand has, and as reading does.
    """
    from schemas.layout import read_layout
    from schemas.model import read_model
    from schemas.parts import one_hand_of
    from schemas.plan import plan_of_poses, read_plan
    from schemas.sheets import HAND_SHEETS

    given: dict[str, Any] = vars(arguments)
    if arguments.plan is not None:
        return read_plan(arguments.plan)
    if arguments.layout is None:
        raise InputError("--plan or --layout: give the subject's plan, or the poses and the layout of a hand")
    for name, (least, largest) in HAND_SIZES_MM.items():
        value = given.get(name)
        if value is not None and not least < value < largest:
            option = f"--{name.replace('_', '-')}"
            raise InputError(f"{option}: is {value:g}; expected millimetres, {least:g} to {largest:g}")
    whose = {name: given[name] for name in ("subject", "session", "hand")}
    if joints is not None and not given.get("calibration") and not given.get("evaluated"):
        whose = vars(one_hand_of(*joints, **whose))
    return plan_of_poses(
        given.get("calibration", []),
        given.get("evaluated", []),
        read_layout(arguments.layout),
        [] if arguments.model is None else [read_model(arguments.model)],
        **whose,
        sizes_mm={name: given.get(name) for name in _SIZES},
        sheets={name: given.get(name) for name in HAND_SHEETS},
    )


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
        if Path(__file__).parents[1].joinpath((error.name or "").split(".")[0]).is_dir():
            raise  # one of this program's own
        print(
            f"error: {error.name} is not installed for {sys.executable}; run `./bootstrap requirements.lock` "
            "once in the folder of this program, and then its .venv/bin/shukotsu",
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
def recording_failure(arguments: argparse.Namespace, part: Part, *tables: PartsWriter) -> Iterator[None]:
    """With --record-failure, write why a part of the tables cannot be had into them, and go on.

    That holds for a bug too: it must not cost a study its other hands and models, and its traceback stays in
    the log. A TableError is no result of the subject's data, and is raised.
    """
    with recorded(arguments, arguments.record_failure) as messages:
        yield
    for message in messages:
        for table in tables:
            table.failure(part, message)


def record_failed_parts(message: str, tables: Mapping[Path, Table], parts: Iterable[Part]) -> None:
    """Write tables of which no part can be had, and why: of a stage that a bug ended outside of its parts."""
    from schemas.parts import parts_writer
    from schemas.tables import Provenance

    failed = list(parts)
    for path, table in tables.items():
        with parts_writer(path, table, Provenance()) as writer:
            for part in failed:
                writer.failure(part, message)


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
        messages.append(str(error))
        print(f"error: {error}", file=sys.stderr)
    except Exception as error:  # also a bug must not cost the study its other parts
        if not record or (isinstance(error, OSError) and error.errno in OF_THE_MACHINE):
            raise
        traceback.print_exc()
        what = f"{arguments.stage} ({type(error).__name__}: {error})"
        messages.append(str(InputError(f"{INTERNAL} {what}; please report it with the log")))


def poses_files(plan: SubjectPlan) -> list[Path]:
    """Give the poses files of every recording of a plan that is not excluded.

    Raises TableError where one is of another recording than the plan says, or was imported with a layout
    of other segments than the plan's.
    """
    from schemas.poses import check_layout, recording_name

    files = []
    for recording in plan.recordings:
        if recording.exclude:
            continue
        path, name = plan.poses(recording), recording_name(plan.poses(recording))
        if (name.of_hand, name.task, name.trial) != (recording.hand, recording.task, recording.trial):
            raise TableError(
                f"{path}: is of {name}; expected {recording.hand}, {recording.name}; remove it and run the "
                "study again"
            )
        check_layout(path, plan.layouts[recording.hand.hand])
        files.append(path)
    return files


def provenance_of(plan: SubjectPlan, tables: Sequence[Path], files: Sequence[Path]) -> Provenance:
    """Give what a stage's outputs are made from: subject tables of other stages, and other files.

    Raises TableError where one of the tables is another subject's or, in a study, was made from another
    version of one of the rest.
    """
    from schemas.parts import check_subject
    from schemas.tables import Provenance, read_metadata

    for path in tables:
        check_subject(path, *plan.who)
    provenance = Provenance.of([*tables, *files], plan.folder)
    digests = dict(provenance.inputs) if plan.is_study else {}
    for path in tables:
        for entry in read_metadata(path)["inputs"] if digests else ():
            if digests.get(entry["file"], entry["sha256"]) != entry["sha256"]:
                raise TableError(
                    f"{path}: was made from another {entry['file']} than the one that is there; "
                    "remove it and run the study again"
                )
    return provenance


def check_made_together(*tables: Path) -> None:
    """Raise TableError where tables that one run of a stage writes are of several runs on other inputs."""
    from schemas.tables import read_metadata

    inputs = {path: {entry["sha256"] for entry in read_metadata(path)["inputs"]} for path in tables}
    known = [(path, digests) for path, digests in inputs.items() if digests]
    for path, digests in known[1:]:
        if digests != known[0][1]:
            raise TableError(
                f"{path}: was not made from the same files as {known[0][0]}; expected tables of one hand, "
                "made together"
            )


def checked_poses(path: Path, layout: Layout, hand: str | None = None) -> CheckedRecording:
    """Check what was declared about the recording of a poses file; hand : in place of the file's own.

    Raises InputError as reading does.
    """
    from collections import Counter

    import pyarrow.compute as pc

    from checks.checked_recording import LEFT_OUT, check_recording
    from checks.declared import Declared
    from schemas.catalogue import POSES
    from schemas.poses import read_poses, recording_name
    from schemas.tables import read_metadata, read_table

    declared = Declared.of(read_metadata(path)["parameters"].get("mapping"))
    flags = read_table(path, POSES, ["segment", "flags"])
    flagged = {
        flag: Counter(flags.filter(pc.match_substring(flags["flags"], flag))["segment"].to_pylist())
        for flag in LEFT_OUT
    }
    left_out = {flag: counts for flag, counts in flagged.items() if counts}
    poses, side = read_poses(path, layout.measured), hand or recording_name(path).hand
    return check_recording(poses, layout, side, declared, left_out)


def config_files(arguments: argparse.Namespace) -> list[Path]:
    """Give the files that say how a hand is worked on: the plan, or those behind --layout and --model."""
    from schemas.config_files import config_path

    given = vars(arguments)
    if given.get("plan") is not None:
        return [arguments.plan]
    names = {kind: given[kind] for kind in ("layout", "model") if given[kind] is not None}
    return [config_path(name, kind, Path()) for kind, name in names.items()]


def begin() -> None:
    """Begin a process of a study, one of hundreds that a cluster may end at any moment.

    When it is asked to end, it removes what it had half written first.
    """
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
