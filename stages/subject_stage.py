"""The stages of a subject share options that name a plan or a hand alone, failures and provenance."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.errors import InputError, TableError
from shukotsu.files.limits import HAND_SIZES_MM
from shukotsu.stages import command_line

if TYPE_CHECKING:
    from shukotsu.schemas.parts import Part, PartsWriter
    from shukotsu.schemas.plan import SubjectPlan
    from shukotsu.schemas.tables import Provenance, Table


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
    add_plan(parser, "the subject's plan, in place of the options of a hand alone")
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


def add_plan(parser: argparse.ArgumentParser, help_text: str, **options: Any) -> None:
    """Add the options that name the subject's plan, and the files that are read of what is in its folder.

    options : of argparse, for the first one.
    """
    parser.add_argument("--plan", type=Path, help=help_text, **options)
    parser.add_argument(
        "--inputs",
        type=Path,
        nargs="*",
        metavar="FILE",
        help="with --plan: poses and tables of the subject to read, and no others (default: all that lie "
        "where the plan says)",
    )


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
    from shukotsu.schemas.layout import read_layout
    from shukotsu.schemas.model import read_model
    from shukotsu.schemas.parts import one_hand_of
    from shukotsu.schemas.plan import plan_of_poses, read_plan
    from shukotsu.schemas.sheets import HAND_SHEETS

    given: dict[str, Any] = vars(arguments)
    if arguments.plan is not None:
        return read_plan(arguments.plan, arguments.inputs)
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


def config_files(arguments: argparse.Namespace) -> list[Path]:
    """Return the files that say how a hand is worked on: the plan, or those behind --layout and --model."""
    from shukotsu.schemas.config_files import config_path

    given = vars(arguments)
    if given.get("plan") is not None:
        return [arguments.plan]
    names = {kind: given[kind] for kind in ("layout", "model") if given[kind] is not None}
    return [config_path(name, kind, Path()) for kind, name in names.items()]


def poses_files(plan: SubjectPlan) -> list[Path]:
    """Return the poses files of every recording of a plan that is not excluded.

    Raises TableError where one is of another recording than the plan says, or was imported with a layout
    of other segments than the plan's.
    """
    from shukotsu.schemas.poses import check_layout, recording_name

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
    """Return the provenance of a stage's outputs: subject tables of other stages, and other files.

    Raises TableError where one of the tables is another subject's or, in a study, was made from another
    version of one of the rest.
    """
    from shukotsu.schemas.parts import check_subject
    from shukotsu.schemas.tables import Provenance, read_metadata

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
    from shukotsu.schemas.tables import read_metadata

    inputs = {path: {entry["sha256"] for entry in read_metadata(path)["inputs"]} for path in tables}
    known = [(path, digests) for path, digests in inputs.items() if digests]
    for path, digests in known[1:]:
        if digests != known[0][1]:
            raise TableError(
                f"{path}: was not made from the same files as {known[0][0]}; expected tables of one hand, "
                "made together"
            )


@contextmanager
def recording_failure(arguments: argparse.Namespace, part: Part, *tables: PartsWriter) -> Iterator[None]:
    """With --record-failure, write why a part of the tables cannot be had into them, and go on.

    That holds for a bug too: it must not cost a study its other hands and models, and its traceback stays in
    the log. A TableError is no result of the subject's data, and is raised.
    """
    with command_line.recorded(arguments, arguments.record_failure) as messages:
        yield
    for message in messages:
        for table in tables:
            table.failure(part, message)


def record_failed_parts(message: str, tables: Mapping[Path, Table], parts: Iterable[Part]) -> None:
    """Write tables of which no part can be had, and why: of a stage that a bug ended outside of its parts."""
    from shukotsu.schemas.parts import parts_writer
    from shukotsu.schemas.tables import Provenance

    failed = list(parts)
    for path, table in tables.items():
        with parts_writer(path, table, Provenance()) as writer:
            for part in failed:
                writer.failure(part, message)
