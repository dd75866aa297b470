"""Command line: simulate a recording of a hand, and write it with its truth."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from shukotsu import command_line

ANATOMIES = ("blend", "ct", "xray", "buchholz", "myohand")
REALISM_OPTIONS = ("anatomy", "mounts", "artefact", "faults")


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu stage simulate",
        "Simulate a hand recorded with 16 receivers at 240 Hz, and write the exact truth beside it.",
        "shukotsu stage simulate --subject 01 --hand right --task opposition --seed 7 "
        "--anatomy ct --out sub-01_hand-right_task-opposition.parquet",
    )
    add = parser.add_argument
    add("--subject", required=True, help="any name; it and the seed determine the person")
    add("--session", default="", help="any name; receivers are put on anew in each session")
    add("--hand", required=True, choices=("right", "left"))
    add("--task", required=True, choices=("opposition", "rom"), help="rom: range of motion")
    add("--seed", type=int, default=0, help="equal seeds give equal bytes (default: 0)")
    add("--out", required=True, type=Path, help="tidy recording, .parquet or .csv")
    add("--forearm", action="store_true", help="wear a receiver on the forearm too")
    add("--frames", type=int, help="number of frames (default: opposition 3774, rom 7200)")
    # an option for each real-world effect; --realism sets those that are not given
    add = parser.add_argument_group("realism").add_argument
    exact = "exact: every assumption of the paper holds to rounding (default: full)"
    add("--realism", choices=("full", "exact"), default="full", help=exact)
    drawn_from = (
        "mean of the hands that the person is drawn from: a random blend of published hands, or one of them "
        "(default: blend)"
    )
    add("--anatomy", choices=ANATOMIES, help=drawn_from)
    for name, what in (
        ("mounts", "how far receivers are misplaced"),
        ("artefact", "how far skin moves receivers"),
        ("faults", "how often the tracker loses poses, mistakes the hemisphere and jumps"),
    ):
        usual = 0 if name == "faults" else 1
        relative = f"{what}, relative to what is usual (default: {usual}; exact: 0)"
        add(f"--{name}", type=_scale, help=relative)
    return parser


def _scale(text: str) -> float:
    """Return the option's number, which must be from 0 to 10."""
    try:
        scale = float(text)
    except ValueError:
        scale = -1.0
    if not 0.0 <= scale <= 10.0:
        raise argparse.ArgumentTypeError(f"is {text!r}; expected a number from 0 to 10")
    return scale


def write_simulation(arguments: argparse.Namespace) -> None:
    """Simulate one recording and write it with its truth."""
    from shukotsu.simulate.realism import Realism
    from shukotsu.simulate.recording import check_ending, write_recording, write_truth
    from shukotsu.simulate.simulation import simulate
    from shukotsu.tables.poses import RecordingName
    from shukotsu.tables.typed_table import Provenance  # not at start-up: --help needs no NumPy

    check_ending(arguments.out)
    options = {name: getattr(arguments, name) for name in REALISM_OPTIONS}
    options = {name: value for name, value in options.items() if value is not None}
    realism = replace(Realism.exact() if arguments.realism == "exact" else Realism(), **options)
    name = RecordingName(arguments.subject, arguments.hand, arguments.task, session=arguments.session)
    simulated = simulate(name, arguments.seed, realism, arguments.frames, forearm=arguments.forearm)
    write_recording(arguments.out, simulated)
    folder = arguments.out.with_name(f"{arguments.out.stem}_truth")
    names = ("subject", "hand", "task", "seed", "realism", "forearm")
    options |= {"session": arguments.session} if arguments.session else {}
    provenance = Provenance(parameters={name: getattr(arguments, name) for name in names} | options)
    write_truth(folder, simulated, provenance)


main = command_line.script(build_parser, write_simulation)


if __name__ == "__main__":
    raise SystemExit(main())
