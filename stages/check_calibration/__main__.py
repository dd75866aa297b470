"""Command line: poses of a hand's calibration recordings -> which joints need more motion."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stages import command_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stages.check_calibration.advice import Advice

ENDINGS = (".csv", ".parquet")
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
        "--poses", type=Path, nargs="*", default=[], required=True, help="poses of one hand's calibration"
    )
    parser.add_argument("--layout", required=True, help="a layout that ships, or a path")
    parser.add_argument(
        "--hand-length-mm", type=float, help="wrist crease to the middle finger's tip (default: not measured)"
    )
    parser.add_argument("--subject", help="whose hand (default: as the poses say)")
    parser.add_argument("--hand", choices=("right", "left"), help="which hand (default: as the poses say)")
    parser.add_argument("--out", type=Path, help="write the table there too, as .csv or .parquet")
    return parser


def check(arguments: argparse.Namespace) -> None:
    """Read the poses, weigh every joint, print the table."""
    from schemas.errors import InputError
    from schemas.layout import read_layout
    from schemas.poses import one_hand, usable_poses
    from stages.check_calibration.advice import advise
    from stages.solve_joints.anatomical import check_hand_length
    from stages.solve_joints.solve import stream

    if arguments.out is not None and arguments.out.suffix not in ENDINGS:
        raise InputError(f"{arguments.out}: the ending says the format; expected {' or '.join(ENDINGS)}")
    check_hand_length(arguments.hand_length_mm)
    layout = read_layout(arguments.layout)
    subject, hand = one_hand(arguments.poses, arguments.subject, arguments.hand)
    usable, reasons = usable_poses(arguments.poses)
    if not usable and arguments.record_failure and arguments.out is not None:
        _write(arguments, [])  # what became of the recordings stands with them
        return
    if not usable:
        raise InputError(f"no calibration recording: {'; '.join(reasons) or 'none is given'}")
    fit = stream(usable, layout, spread=True).fit(layout, hand, arguments.hand_length_mm)
    found = advise(fit, layout)
    print(as_text(found))
    if arguments.out is not None:
        rows = [{"subject": subject, "hand": hand, **vars(one)} for one in found]
        _write(arguments, rows)


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


def _write(arguments: argparse.Namespace, rows: Sequence[dict[str, Any]]) -> None:
    import pyarrow as pa
    import pyarrow.csv

    from schemas.catalogue import CALIBRATION_ADVICE
    from schemas.config_files import config_path
    from schemas.files import replacing
    from schemas.tables import Provenance, columns_from_rows, write_table

    columns = columns_from_rows(CALIBRATION_ADVICE, rows)
    if arguments.out.suffix == ".csv":
        with replacing(arguments.out) as temporary:
            pa.csv.write_csv(pa.table(columns), temporary)
        return
    layout = config_path(arguments.layout, "layout", Path())
    write_table(arguments.out, CALIBRATION_ADVICE, columns, Provenance.of([*arguments.poses, layout]))


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the table without rows and the reason; in CSV, a row of no joint that says it."""
    from schemas.catalogue import CALIBRATION_ADVICE
    from schemas.tables import Provenance, write_failure

    if arguments.out is not None and arguments.out.suffix == ".parquet":
        write_failure(arguments.out, CALIBRATION_ADVICE, message, Provenance.of(arguments.poses))
    elif arguments.out is not None and arguments.out.suffix == ".csv":
        whose = {"subject": arguments.subject or "", "hand": arguments.hand or ""}
        _write(arguments, [{**whose, "joint": "", "advice": message}])


def main(words: list[str] | None = None) -> int:
    """Run the stage on the words of a command line; give its exit code."""
    return command_line.run(build_parser().parse_args(words), check, record_failure)


if __name__ == "__main__":
    sys.exit(main())
