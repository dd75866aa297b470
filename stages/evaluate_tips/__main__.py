"""Command line: poses, joints, bones and metacarpals -> tips and tip_errors tables."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from stages import command_line


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "stages.evaluate_tips",
        "Replay the skeleton and measure how far its tips are from the distal receivers (section 6).",
        "python -m stages.evaluate_tips --poses opposition/poses.parquet "
        "--calibration rom/poses.parquet --joints joint_centres.parquet "
        "--bones bone_lengths.parquet --metacarpals metacarpals.parquet --layout liberty16 "
        "--model paper-fig4 --out tips.parquet --out-errors tip_errors.parquet",
    )
    parser.add_argument("--poses", type=Path, nargs="*", default=[], help="poses to replay, of one hand")
    parser.add_argument(
        "--calibration",
        type=Path,
        nargs="*",
        default=[],
        help="poses that the joints were solved from; the others count as held out",
    )
    parser.add_argument("--joints", type=Path, required=True, help="joint_centres with the wrist point")
    parser.add_argument("--bones", type=Path, required=True, help="the hand's bone_lengths")
    parser.add_argument("--metacarpals", type=Path, required=True, help="metacarpals of the same poses")
    parser.add_argument("--layout", required=True, help="a layout that ships, or a path")
    parser.add_argument("--model", required=True, help="a skeleton model that ships, or a path")
    parser.add_argument("--out", type=Path, required=True, help="the tips table to write")
    parser.add_argument("--out-errors", type=Path, required=True, help="the tip_errors table to write")
    return parser


def evaluate(arguments: argparse.Namespace) -> None:
    """Read the skeleton, replay every recording, write both tables."""
    from schemas.catalogue import TIP_ERRORS, TIPS
    from schemas.poses import one_hand
    from schemas.table_rows import in_row_groups
    from schemas.tables import Provenance, columns_from_rows, table_in_parts, write_table
    from stages.evaluate_tips.recording import evaluate_recording

    skeleton, subject, hand = _read_skeleton(arguments)
    one_hand([*arguments.poses, *arguments.calibration], subject, hand)
    calibration = {path.resolve() for path in arguments.calibration}
    files = [*arguments.poses, arguments.joints, arguments.bones, arguments.metacarpals]
    provenance = Provenance.of([*files, *command_line.config_files(arguments)])
    rows: list[dict[str, Any]] = []
    blocks = (
        block
        for path in arguments.poses
        for block in evaluate_recording(path, skeleton, rows, held_out=path.resolve() not in calibration)
    )
    with table_in_parts(arguments.out, TIPS, provenance) as write:
        for part in in_row_groups(blocks):
            write(part)
    write_table(arguments.out_errors, TIP_ERRORS, columns_from_rows(TIP_ERRORS, rows), provenance)


def _read_skeleton(arguments: argparse.Namespace) -> Any:
    """Read the hand's skeleton; give it with subject and hand."""
    from schemas.catalogue import BONE_LENGTHS, JOINT_CENTRES, METACARPALS
    from schemas.layout import read_layout
    from schemas.model import read_model
    from schemas.table_rows import TableRows
    from schemas.tables import read_table, rows_of
    from stages.evaluate_tips.recording import Skeleton

    joints = {row["joint"]: row for row in rows_of(read_table(arguments.joints, JOINT_CENTRES))}
    bones: dict[str, dict[str, Any]] = {}
    for row in rows_of(read_table(arguments.bones, BONE_LENGTHS)):
        bones.setdefault(row["digit"], {})[row["bone"]] = row
    turns = [f"q{part}" for part in "wxyz"]
    skeleton = Skeleton(
        read_layout(arguments.layout),
        read_model(arguments.model),
        joints,
        bones,
        TableRows(arguments.metacarpals, METACARPALS, ("task", "trial", "digit"), turns),
    )
    first = next(iter(joints.values()))
    return skeleton, first["subject"], first["hand"]


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write both tables without rows and the reason."""
    from schemas.catalogue import TIP_ERRORS, TIPS
    from schemas.tables import Provenance, write_failure

    provenance = Provenance.of([arguments.joints])
    write_failure(arguments.out, TIPS, message, provenance)
    write_failure(arguments.out_errors, TIP_ERRORS, message, provenance)


def main(words: list[str] | None = None) -> int:
    """Run the stage on the words of a command line; give its exit code."""
    return command_line.run(build_parser().parse_args(words), evaluate, record_failure)


if __name__ == "__main__":
    sys.exit(main())
