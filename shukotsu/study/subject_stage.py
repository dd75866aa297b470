"""What stages of a subject share: options for a plan or a single hand, tables, failures and provenance."""

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
"""By output argument: the name of the table in that file, or the names of the tables in that folder."""

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
"""Help of the options that name a subject's tables; all others are a fit's, one file per hand and model."""

_SIZES = {
    "hand_length_mm": "wrist crease to the middle finger's tip (default: not measured)",
    "hand_breadth_mm": "across the knuckles of digits 2 to 5 (default: not measured)",
}
"""Help of the options for the sizes of a hand."""


def add_plan_options(
    parser: argparse.ArgumentParser,
    *tables: str,
    calibration: str = "",
    evaluated: str = "",
    sizes: Sequence[str] = (),
    sheets: Sequence[str] = (),
) -> None:
    """Add the options that select the hands that a stage works on and its input tables; see `plan_of`.

    In a study a stage is passed --plan and all poses. Outside a study, a single hand is described by poses
    files, a layout and a model.

    Parameters
    ----------
    parser
        The stage's parser.
    *tables
        Names of the subject's tables that the stage reads.
    calibration, evaluated
        Names of the options for poses files, such as --poses; empty to omit the option.
    sizes, sheets
        The sizes of the hand (SIZES) and the sheets (HAND_SHEETS) that the stage uses.

    """
    in_place = "the subject's plan, in place of the options of a hand alone"
    parser.add_argument("--plan", type=Path, help=in_place)
    of_plan = "; with --plan all of the subject's (default: those that it names)"
    for dest, option, help_text in (
        ("calibration", calibration, "poses files that the joints are solved from"),
        ("evaluated", evaluated, "poses files to evaluate the hand in"),
    ):
        more = of_plan if option == "--poses" else ""
        if option:
            parser.add_argument(option, dest=dest, type=Path, nargs="*", default=[], help=help_text + more)
    add_tables(parser, *tables)
    alone = parser.add_argument_group("a hand alone")
    alone.add_argument("--layout", help="a layout that ships, or a path")
    alone.add_argument("--model", help="a skeleton model that ships, or a path")
    alone.add_argument("--subject", help="whose hand (default: from the poses)")
    alone.add_argument("--session", help="in which session (default: from the poses)")
    alone.add_argument("--hand", choices=("right", "left"), help="which hand (default: from the poses)")
    for name in sizes:
        alone.add_argument(command_line.option_of(name), type=float, help=_SIZES[name])
    for name in sheets:
        alone.add_argument(f"--{name}", type=Path, help=f"sheet of {name}")


def add_tables(parser: argparse.ArgumentParser, *tables: str) -> None:
    """Add an option for each of the named tables of a subject."""
    parser.set_defaults(tables=tables)
    for name in tables:
        number = 1 if name in _TABLES else "*"
        what = _TABLES.get(name, f"{name} of every fit_hand, in any order")
        option = command_line.option_of(name)
        parser.add_argument(option, type=Path, nargs=number, default=[], metavar="FILE", help=what)


def plan_of(arguments: argparse.Namespace) -> SubjectPlan:
    """Read the plan named by --plan, or make one from the options for a single hand.

    Tables and poses named by options replace those of the plan, and findings are applied. Raises InputError
    if there is neither a plan nor a layout, if a size is impossible for a hand, or if a file cannot be read.
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
    """Return the parts of a table that has one part per hand of the subject."""
    plan = plan_of(arguments)
    return [plan.part(hand) for hand in plan.hands]


def config_files(arguments: argparse.Namespace) -> list[Path]:
    """Return the configuration files that a stage uses: the plan, or the files of --layout and --model."""
    from shukotsu.study.config_files import config_path

    if arguments.plan is not None:
        return [arguments.plan]
    names = {"layout": arguments.layout, "model": arguments.model}
    return [config_path(name, kind, Path()) for kind, name in names.items() if name is not None]


def poses_files(plan: SubjectPlan) -> list[Path]:
    """Return the poses files of all recordings of a plan that are not excluded.

    Raises TableError if a file is of another recording than the plan states, or was imported with a layout
    whose segments differ from the plan's.
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
    """Return the provenance of a stage's outputs.

    tables : input tables of this subject that other stages wrote. files : the other inputs.
    Raises TableError if a table is of another subject or, in a study, was made from another version of an
    input than the one passed here.
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
                    f"{path}: was made from another version of {entry['file']} than the present one; "
                    f"{remedy_of(path)}"
                )
    return provenance


def check_made_together(*tables: Path) -> None:
    """Raise TableError if tables that a stage writes together come from runs with different inputs."""
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
    """Open the tables that a stage writes and yield their writers by table name."""
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
    """Return the `main` function of a stage that writes tables in parts.

    With --record-failure, an unexpected error outside the parts is written to every part as the reason why it
    is missing.

    Parameters
    ----------
    build_parser, work
        Functions that build the stage's parser, and that do its work with the parsed arguments.
    writes
        Tables by output argument.
    parts
        Function that returns the parts of a table by its name; by default one for each skeleton of the plan.
    each
        Function that splits the arguments into those of several units of work; by default one unit.

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
    """With --record-failure, write the reason why a part failed into the tables and continue.

    This includes unexpected errors, so that the study's other hands and models are not lost; the traceback is
    in the log. A TableError is raised because it is not caused by the subject's data.
    """
    with command_line.keep_failure(arguments, arguments.record_failure) as messages:
        yield
    for message in messages:
        for table in tables:
            table.failure(part, message)
