"""Command line of the simulation."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from schemas.errors import InputError
from stages.command_line import EXIT_BAD_INPUT

_EXAMPLE = (
    "python -m stages.simulate --subject 01 --hand right --task opposition --seed 7 "
    "--out sub-01_hand-right_task-opposition.parquet"
)


def main(words: list[str] | None = None) -> int:
    """Simulate one recording; give the exit code. It writes no table that could record a failure."""
    arguments = _parser().parse_args(words)
    try:
        _work(arguments)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    return 0


def _parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog="python -m stages.simulate",
        description="Simulate a hand recorded with 16 receivers at 240 Hz; write the exact truth beside it.",
        epilog=f"example:\n  {_EXAMPLE}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument("--subject", required=True, help="any name; together with the seed it is a person")
    made.add_argument("--hand", required=True, choices=("right", "left"))
    made.add_argument("--task", required=True, choices=("opposition", "rom"), help="rom: range of motion")
    made.add_argument("--seed", type=int, default=0, help="same seed, same bytes (default: 0)")
    made.add_argument("--out", required=True, type=Path, help="tidy recording, .parquet or .csv")
    made.add_argument(
        "--truth", type=Path, help="folder of the truth tables (default: the recording's stem + _truth)"
    )
    made.add_argument(
        "--realism",
        choices=("full", "exact"),
        default="full",
        help="exact: every assumption of the paper holds to rounding (default: full)",
    )
    made.add_argument("--forearm", action="store_true", help="wear a receiver on the forearm too")
    made.add_argument("--frames", type=int, help="frames (default: opposition 3774, rom 7200)")
    return made


def _work(arguments: argparse.Namespace) -> None:
    from schemas.tables import Provenance  # not at start-up: --help needs no NumPy
    from stages.simulate.realism import Realism
    from stages.simulate.recording import check_ending, write_recording
    from stages.simulate.simulation import simulate
    from stages.simulate.truth import write_truth

    check_ending(arguments.out)
    realism = Realism.exact() if arguments.realism == "exact" else Realism.full()
    simulated = simulate(
        arguments.subject,
        arguments.hand,
        arguments.task,
        arguments.seed,
        realism,
        arguments.frames,
        forearm=arguments.forearm,
    )
    try:
        write_recording(arguments.out, simulated)
        folder = arguments.truth or arguments.out.with_name(f"{arguments.out.stem}_truth")
        names = ("subject", "hand", "task", "seed", "realism", "forearm")
        provenance = Provenance(parameters={name: getattr(arguments, name) for name in names})
        write_truth(folder, simulated.truth, simulated.written(), provenance)
    except OSError as error:
        raise InputError(f"{error.filename}: cannot be written ({error.strerror})") from error


if __name__ == "__main__":
    sys.exit(main())
