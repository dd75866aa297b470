"""Command line: poses of a hand's calibration recordings -> which joints need more motion."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from stages import command_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stages.check_calibration.advice import Advice

ENDINGS = (".csv", ".parquet")
COLUMNS = ("joint", "range_deg", "sd_now_mm", "sd_moved_mm", "advice")
_HEADS = ("joint", "range deg", "sd now mm", "sd with more motion mm", "advice")


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "stages.check_calibration",
        "Say which joints the calibration recordings move too little, and how they would gain from more.",
        "python -m stages.check_calibration --poses results/demo/sub-01/right/rom/poses.parquet "
        "--layout liberty16",
    )
    parser.add_argument(
        "--poses", type=Path, nargs="+", required=True, help="poses of one hand's calibration"
    )
    parser.add_argument("--layout", required=True, help="a layout that ships, or a path")
    parser.add_argument(
        "--hand-length-mm", type=float, help="wrist crease to the middle finger's tip (default: not measured)"
    )
    parser.add_argument("--out", type=Path, help="write the table there too, as .csv or .parquet")
    return parser


def check(arguments: argparse.Namespace) -> None:
    """Read the poses, weigh every joint, print the table."""
    from schemas.errors import InputError
    from schemas.layout import read_layout
    from schemas.poses import one_hand
    from stages.check_calibration.advice import advise
    from stages.solve_joints.anatomical import HandSample, check_hand_length, fit_hand
    from stages.solve_joints.solve import stream

    if arguments.out is not None and arguments.out.suffix not in ENDINGS:
        raise InputError(f"{arguments.out}: the ending says the format; expected {' or '.join(ENDINGS)}")
    check_hand_length(arguments.hand_length_mm)
    layout = read_layout(arguments.layout)
    _, hand = one_hand(arguments.poses, None, None)
    sample = HandSample(layout.solvable)
    moments, _ = stream(arguments.poses, layout, sample)
    found = advise(fit_hand(sample, moments, layout, hand, arguments.hand_length_mm), sample, layout)
    print(as_text(found))
    if arguments.out is not None:
        _write(arguments.out, found)


def as_text(found: Sequence[Advice]) -> str:
    """Give the table as lines of text with aligned columns."""
    rows = [_HEADS, *(_cells(one) for one in found)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(_HEADS) - 1)]
    return "\n".join(
        "  ".join(
            [row[0].ljust(widths[0]), *(row[i].rjust(widths[i]) for i in range(1, len(widths))), row[-1]]
        )
        for row in rows
    )


def _cells(one: Advice) -> tuple[str, ...]:
    numbers = (
        "-" if value is None else format(value, form)
        for value, form in ((one.range_deg, ".0f"), (one.sd_now_mm, ".1f"), (one.sd_moved_mm, ".1f"))
    )
    return (one.joint, *numbers, one.advice)


def _write(path: Path, found: Sequence[Advice]) -> None:
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet as pq

    from schemas.files import replacing

    kinds = (pa.string(), pa.float64(), pa.float64(), pa.float64(), pa.string())
    table = pa.table(
        {
            name: pa.array([getattr(one, name) for one in found], kind)
            for name, kind in zip(COLUMNS, kinds, strict=True)
        }
    )
    with replacing(path) as temporary:
        if path.suffix == ".csv":
            pa.csv.write_csv(table, temporary)
        else:
            pq.write_table(table, temporary)


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write a table whose only row, of no joint, is the reason."""
    from stages.check_calibration.advice import Advice

    if arguments.out is not None and arguments.out.suffix in ENDINGS:
        _write(arguments.out, [Advice("", None, None, None, message)])


def main(words: list[str] | None = None) -> int:
    """Run the stage on the words of a command line; give its exit code."""
    return command_line.run(build_parser().parse_args(words), check, record_failure)


if __name__ == "__main__":
    sys.exit(main())
