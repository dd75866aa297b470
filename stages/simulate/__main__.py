"""Command line of the simulation."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from stages import command_line


def build_parser() -> argparse.ArgumentParser:
    """Give the command's argument parser."""
    parser = command_line.parser(
        "stages.simulate",
        "Simulate a hand recorded with 16 receivers at 240 Hz; write the exact truth beside it.",
        "python -m stages.simulate --subject 01 --hand right --task opposition --seed 7 "
        "--out sub-01_hand-right_task-opposition.parquet",
        records_failure=False,
    )
    parser.add_argument("--subject", required=True, help="any name; together with the seed it is a person")
    parser.add_argument("--hand", required=True, choices=("right", "left"))
    parser.add_argument("--task", required=True, choices=("opposition", "rom"), help="rom: range of motion")
    parser.add_argument("--seed", type=int, default=0, help="same seed, same bytes (default: 0)")
    parser.add_argument("--out", required=True, type=Path, help="tidy recording, .parquet or .csv")
    parser.add_argument(
        "--truth", type=Path, help="folder of the truth tables (default: the recording's stem + _truth)"
    )
    parser.add_argument(
        "--realism",
        choices=("full", "exact"),
        default="full",
        help="exact: every assumption of the paper holds to rounding (default: full)",
    )
    parser.add_argument("--forearm", action="store_true", help="wear a receiver on the forearm too")
    parser.add_argument("--frames", type=int, help="frames (default: opposition 3774, rom 7200)")
    return parser


def write_simulation(arguments: argparse.Namespace) -> None:
    """Simulate one recording; write it and its truth."""
    from schemas.errors import InputError
    from schemas.tables import Provenance  # not at start-up: --help needs no NumPy
    from stages.simulate.realism import Realism
    from stages.simulate.recording import check_ending, write_recording
    from stages.simulate.simulation import simulate
    from stages.simulate.written_truth import write_truth

    check_ending(arguments.out)
    simulated = simulate(
        arguments.subject,
        arguments.hand,
        arguments.task,
        arguments.seed,
        Realism.exact() if arguments.realism == "exact" else Realism.full(),
        arguments.frames,
        forearm=arguments.forearm,
    )
    try:
        write_recording(arguments.out, simulated)
        folder = arguments.truth or arguments.out.with_name(f"{arguments.out.stem}_truth")
        names = ("subject", "hand", "task", "seed", "realism", "forearm")
        provenance = Provenance(parameters={name: getattr(arguments, name) for name in names})
        write_truth(folder, simulated, provenance)
    except OSError as error:
        raise InputError(f"{error.filename}: cannot be written ({error.strerror})") from error


def main(argv: list[str] | None = None) -> int:
    """Run the command; give its exit code."""
    return command_line.run(build_parser().parse_args(argv), write_simulation)


if __name__ == "__main__":
    sys.exit(main())
