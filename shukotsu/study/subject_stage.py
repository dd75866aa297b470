"""The stages of a subject share options that name a plan or a hand alone, tables, failures and provenance."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu import command_line
from shukotsu.errors import InputError, TableError
from shukotsu.tables.limits import HAND_SIZES_MM
from shukotsu.tables.whole_files import remedy_of

if TYPE_CHECKING:
    from shukotsu.study.plan import SubjectPlan
    from shukotsu.tables.parts import Part, PartsWriter
    from shukotsu.tables.typed_table import Provenance

Writes = Mapping[str, str | Sequence[str]]
"""By the name of an output's argument the table in that file, or those in that folder."""

_TABLES = {
    "findings": "what check_recordings refuses and suspects (default: nothing)",
    "joint_solutions": "joints as solve_joints wrote them",
    "projected_joints": "joints as project_planes wrote them",
    "joint_centres": "joints with the wrist point, as estimate_metacarpals wrote them",
    "bone_lengths": "bones of the same skeletons",
    "metacarpals": "metacarpals of the same skeletons",
    "tips": "tips as evaluate_tips wrote them",
    "tip_errors": "tip errors as evaluate_tips wrote them",
    "events": "events as align_events wrote them (default: none)",
    "clocks": "clocks as align_events wrote them (default: all are trusted)",
}
"""Help of the options that name a subject's tables; every other one is a fit's, a file a hand and model."""

_SIZES = {
    "hand_length_mm": "wrist crease to the middle finger's tip (default: not measured)",
    "hand_breadth_mm": "across the knuckles of digits 2 to 5 (default: not measured)",
}
"""Help of the sizes of a hand."""

_CALIBRATION, _EVALUATED = (
    "poses files that the joints are solved from",
    "poses files to evaluate the hand in",
)


def add_plan_options(
    parser: argparse.ArgumentParser,
    *tables: str,
    calibration: str = "",
    evaluated: str = "",
    sizes: Sequence[str] = (),
    sheets: Sequence[str] = (),
) -> None:
    """Add the options that say which hands a stage works on and name its tables; `plan_of` reads them.

    tables : the subject's tables that the stage reads. A study gives --plan and all poses. A hand alone is
    poses files, a layout and a model: calibration, evaluated are names of the options for files, such as
    --poses, sizes and sheets of those that the stage uses.
    """
    parser.add_argument(
        "--plan", type=Path, help="the subject's plan, in place of the options of a hand alone"
    )
    for dest, option, help_text in (
        ("calibration", calibration, _CALIBRATION),
        ("evaluated", evaluated, _EVALUATED),
    ):
        more = (
            "; with --plan all of the subject's (default: those that it names)" if option == "--poses" else ""
        )
        if option:
            parser.add_argument(option, dest=dest, type=Path, nargs="*", default=[], help=help_text + more)
    add_tables(parser, *tables)
    alone = parser.add_argument_group("a hand alone")
    alone.add_argument("--layout", help="a layout that ships, or a path")
    alone.add_argument("--model", help="a skeleton model that ships, or a path")
    alone.add_argument("--subject", help="whose hand (default: as the poses say)")
    alone.add_argument("--session", help="in which session (default: as the poses say)")
    alone.add_argument("--hand", choices=("right", "left"), help="which hand (default: as the poses say)")
    for name in sizes:
        alone.add_argument(command_line.option_of(name), type=float, help=_SIZES[name])
    for name in sheets:
        alone.add_argument(f"--{name}", type=Path, help=f"sheet of {name}")


def add_tables(parser: argparse.ArgumentParser, *tables: str) -> None:
    """Add an option for each of these tables of a subject."""
    parser.set_defaults(tables=tables)
    for name in tables:
        is_of_fit = name not in _TABLES
        parser.add_argument(
            command_line.option_of(name),
            type=Path,
            nargs="*" if is_of_fit else 1,
            default=[],
            metavar="FILE",
            help=f"{name} of every fit_hand, in any order" if is_of_fit else _TABLES[name],
        )


def plan_of(arguments: argparse.Namespace) -> SubjectPlan:
    """Read the plan that the options of `add_plan_options` name, or make one of a hand alone.

    It reads the tables that the options name. Raises InputError where neither is given, where a size is none
    that a hand has, and as reading does.
    """
    from shukotsu.study.layout import read_layout
    from shukotsu.study.model import read_model
    from shukotsu.study.plan import NamedHand, plan_of_poses
    from shukotsu.study.plan_file import read_plan
    from shukotsu.study.sheets import HAND_SHEETS
    from shukotsu.tables.catalogue import JOINT_CENTRES, JOINT_SOLUTIONS
    from shukotsu.tables.parts import one_hand_of

    options: dict[str, Any] = vars(arguments)
    tables = {name: options[name] for name in arguments.tables if name != "findings"}
    calibration, evaluated = options.get("calibration", []), options.get("evaluated", [])
    if arguments.plan is not None:
        plan = read_plan(arguments.plan).naming([*calibration, *evaluated], tables)
    elif arguments.layout is None:
        raise InputError("--plan or --layout: give the subject's plan, or the poses and the layout of a hand")
    else:
        for name, (least, largest) in HAND_SIZES_MM.items():
            value = options.get(name)
            if value is not None and not least < value < largest:
                raise InputError(
                    f"{command_line.option_of(name)}: is {value:g}; expected millimetres, {least:g} to "
                    f"{largest:g}"
                )
        whose = {name: options[name] for name in ("subject", "session", "hand")}
        if not calibration and not evaluated and (joints := next(filter(None, tables.values()), None)):
            table = JOINT_SOLUTIONS if options.get("joint_solutions") else JOINT_CENTRES
            whose = vars(one_hand_of(joints[0], table, **whose))
        sizes_mm = {name: options.get(name) for name in _SIZES}
        sheets = {name: options.get(name) for name in HAND_SHEETS}
        alone = NamedHand(calibration, evaluated, **whose, sizes_mm=sizes_mm, sheets=sheets)
        models = [] if arguments.model is None else [read_model(arguments.model)]
        plan = plan_of_poses(alone, read_layout(arguments.layout), models).naming([], tables)
    return plan.checked(*options["findings"]) if options.get("findings") else plan


def hands_of(arguments: argparse.Namespace, _: str = "") -> list[Part]:
    """Return the parts of a table that has one for each of a subject's hands."""
    plan = plan_of(arguments)
    return [plan.part(hand) for hand in plan.hands]


def config_files(arguments: argparse.Namespace) -> list[Path]:
    """Return the files that say how a hand is worked on: the plan, or those behind --layout and --model."""
    from shukotsu.study.config_files import config_path

    options = vars(arguments)
    if options.get("plan") is not None:
        return [arguments.plan]
    names = {kind: options[kind] for kind in ("layout", "model") if options[kind] is not None}
    return [config_path(name, kind, Path()) for kind, name in names.items()]


def poses_files(plan: SubjectPlan) -> list[Path]:
    """Return the poses files of every recording of a plan that is not excluded.

    Raises TableError where one is of another recording than the plan says, or was imported with a layout
    of other segments than the plan's.
    """
    from shukotsu.tables.poses import check_layout, recording_name

    files = []
    for recording in plan.recordings:
        if recording.exclude:
            continue
        path, name = plan.poses(recording), recording_name(plan.poses(recording))
        if (name.of_hand, name.task, name.trial) != (recording.hand, *recording.key_in_session[1:]):
            raise TableError(
                f"{path}: is of {name}; expected {recording.hand}, {recording.name}; {remedy_of(path)}"
            )
        layout = plan.layouts[recording.hand.hand]
        check_layout(path, layout.name, layout.measured, layout.segments)
        files.append(path)
    return files


def provenance_of(plan: SubjectPlan, tables: Sequence[Path], files: Sequence[Path]) -> Provenance:
    """Return the provenance of a stage's outputs: subject tables of other stages, and other files.

    Raises TableError where one of the tables is another subject's or, in a study, was made from another
    version of one of the rest.
    """
    from shukotsu.tables.parts import check_subject
    from shukotsu.tables.typed_table import Provenance, read_metadata

    for path in tables:
        check_subject(path, *plan.who)
    provenance = Provenance.of([*tables, *files], plan.folder)
    digests = dict(provenance.inputs) if plan.is_study else {}
    for path in tables:
        for entry in read_metadata(path)["inputs"] if digests else ():
            if digests.get(entry["file"], entry["sha256"]) != entry["sha256"]:
                raise TableError(
                    f"{path}: was made from another {entry['file']} than the one that is there; "
                    f"{remedy_of(path)}"
                )
    return provenance


def check_made_together(*tables: Path) -> None:
    """Raise TableError where tables that one run of a stage writes are of several runs on other inputs."""
    from shukotsu.tables.typed_table import read_metadata

    inputs = {path: {entry["sha256"] for entry in read_metadata(path)["inputs"]} for path in tables}
    digests_of = [(path, digests) for path, digests in inputs.items() if digests]
    for path, digests in digests_of[1:]:
        if digests != digests_of[0][1]:
            raise TableError(
                f"{path}: was not made from the same files as {digests_of[0][0]}; expected tables of one "
                "hand, made together"
            )


@contextmanager
def writing(
    arguments: argparse.Namespace, writes: Writes, provenance: Provenance
) -> Iterator[dict[str, PartsWriter]]:
    """Open the tables that a stage writes, by their names, for their parts to be written."""
    from shukotsu.tables.catalogue import table_in
    from shukotsu.tables.parts import parts_writer

    files: dict[str, Path] = {}
    for argument, names in writes.items():
        path: Path = getattr(arguments, argument)
        files |= {names: path} if isinstance(names, str) else {n: path / f"{n}.parquet" for n in names}
    with ExitStack() as stack:
        yield {
            name: stack.enter_context(parts_writer(path, table_in(name), provenance))
            for name, path in files.items()
        }


def script(
    build_parser: Callable[[], argparse.ArgumentParser],
    work: Callable[[argparse.Namespace], None],
    writes: Writes,
    parts: Callable[[argparse.Namespace, str], Iterable[Part]] = lambda options, _: plan_of(options).parts(),
    each: Callable[[argparse.Namespace], Iterable[argparse.Namespace]] = lambda options: [options],
) -> Callable[..., int]:
    """Return the `main` of a stage that writes tables in parts.

    With --record-failure a bug outside of all parts is written as the reason why each of them is missing.
    parts : of a table, by its name; by default every skeleton of the plan. each : the units of work, one
    after the other, where there are several.
    """

    def record_bug(arguments: argparse.Namespace, message: str) -> None:
        from shukotsu.tables.typed_table import Provenance

        for of_one in each(arguments):
            with writing(of_one, writes, Provenance()) as tables:
                for name, table in tables.items():
                    for part in parts(of_one, name):
                        table.failure(part, message)

    return command_line.script(build_parser, work, record_bug=record_bug)


@contextmanager
def recording_failure(arguments: argparse.Namespace, part: Part, *tables: PartsWriter) -> Iterator[None]:
    """With --record-failure, write why a part of the tables cannot be had into them, and go on.

    That includes bugs: the study's other hands and models must not be lost, and the traceback stays in the
    log. A TableError is no result of the subject's data, and is raised.
    """
    with command_line.keep_failure(arguments, arguments.record_failure) as messages:
        yield
    for message in messages:
        for table in tables:
            table.failure(part, message)
