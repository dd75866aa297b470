"""Command line: skeletons of one hand, its recordings and their truth -> skeleton_scores, joint_errors."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stages import command_line

if TYPE_CHECKING:
    from schemas.tables import Provenance
    from stages.evaluate_skeletons.truth_folder import TruthFolder


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "stages.evaluate_skeletons",
        "Score every skeleton of a hand, beside references and, for simulated hands, against the truth.",
        "python -m stages.evaluate_skeletons --poses opposition/poses.parquet "
        "--calibration rom/poses.parquet --skeletons models/paper-fig4/sub-01/right "
        "models/whole-hand/sub-01/right models/whole-hand/sub-01/right/without-opposition "
        "--layout liberty16 "
        "--out skeleton_scores.parquet --out-joints joint_errors.parquet",
    )
    parser.add_argument("--poses", type=Path, nargs="*", default=[], help="poses to score, of one hand")
    parser.add_argument(
        "--calibration", type=Path, nargs="*", default=[], help="poses that the hand is calibrated on"
    )
    parser.add_argument(
        "--skeletons",
        type=Path,
        nargs="*",
        default=[],
        help="folders of a hand under a model; without-TASK: made without, and scored on, that task",
    )
    parser.add_argument(
        "--truth", type=Path, nargs="*", default=[], help="folders of truth tables of simulated recordings"
    )
    parser.add_argument("--layout", required=True, help="a layout that ships, or a path")
    parser.add_argument("--subject", help="whose hand (default: as the poses say)")
    parser.add_argument("--hand", choices=("right", "left"), help="which hand (default: as the poses say)")
    parser.add_argument(
        "--hand-length-mm", type=float, help="for prior-only: wrist crease to middle finger's tip"
    )
    parser.add_argument("--out", type=Path, required=True, help="the skeleton_scores table to write")
    parser.add_argument("--out-joints", type=Path, required=True, help="the joint_errors table to write")
    return parser


def evaluate(arguments: argparse.Namespace) -> None:
    """Read the skeletons, score them in every recording, write both tables."""
    from schemas.catalogue import JOINT_ERRORS, SKELETON_SCORES
    from schemas.layout import read_layout
    from schemas.poses import one_hand, recording_name
    from schemas.tables import columns_from_rows, write_table
    from stages.evaluate_skeletons.evaluation import joint_rows, score_rows
    from stages.evaluate_skeletons.references import fit_prior
    from stages.evaluate_skeletons.scores import read_recording
    from stages.evaluate_skeletons.skeleton_folder import read_folder
    from stages.fit_hand.calibration import check_size

    layout = read_layout(arguments.layout)
    subject, hand = one_hand([*arguments.poses, *arguments.calibration], arguments.subject, arguments.hand)
    check_size("--hand-length-mm", arguments.hand_length_mm, 50, 400)
    folders = [read_folder(path, subject, hand) for path in arguments.skeletons]
    truths = _truths(arguments.truth, subject, hand)
    prior = fit_prior(arguments.calibration, layout, hand, arguments.hand_length_mm)
    scores = [
        row
        for path in arguments.poses
        for row in score_rows(read_recording(path, layout, truths), folders, prior)
    ]
    calibration = [recording_name(path) for path in arguments.calibration]
    words, provenance = {"subject": subject, "hand": hand}, _provenance(arguments)
    errors = [words | row for row in joint_rows(calibration, layout, folders, truths, prior)]
    for path, table, rows in (
        (arguments.out, SKELETON_SCORES, scores),
        (arguments.out_joints, JOINT_ERRORS, errors),
    ):
        columns = columns_from_rows(table, _first_of_each(rows, table.key))
        write_table(path, table, columns, provenance)


def _first_of_each(rows: list[dict[str, Any]], key: tuple[str, ...]) -> list[dict[str, Any]]:
    """Rows whose key no earlier one has: a model that never used a task is itself without it, twice asked."""
    found: dict[tuple[Any, ...], dict[str, Any]] = {}
    for row in rows:
        found.setdefault(tuple(row[name] for name in key), row)
    return list(found.values())


def _truths(paths: list[Path], subject: str, hand: str) -> list[TruthFolder]:
    """Truth folders that are there; one that is not costs its columns and no more."""
    from stages.evaluate_skeletons.truth_folder import read_truth

    found = []
    for path in paths:
        if path.is_dir():
            found.append(read_truth(path, subject, hand))
        else:
            print(f"note: no truth: {path}: no such folder", file=sys.stderr)
    return found


def _provenance(arguments: argparse.Namespace) -> Provenance:
    from schemas.config_files import config_path
    from schemas.tables import Provenance
    from stages.evaluate_skeletons.skeleton_folder import TABLES

    layout = config_path(arguments.layout, "layout", Path())
    folders = [*arguments.skeletons, *arguments.truth]
    files = [folder / f"{table.name}.parquet" for folder in folders for table in TABLES]
    return Provenance.of([*arguments.poses, *arguments.calibration, *files, layout])


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write both tables without rows and the reason."""
    from schemas.catalogue import JOINT_ERRORS, SKELETON_SCORES
    from schemas.tables import Provenance, write_failure

    provenance = Provenance.of([*arguments.poses, *arguments.calibration])
    write_failure(arguments.out, SKELETON_SCORES, message, provenance)
    write_failure(arguments.out_joints, JOINT_ERRORS, message, provenance)


def main(words: list[str] | None = None) -> int:
    """Run the stage on the words of a command line; give its exit code."""
    return command_line.run(build_parser().parse_args(words), evaluate, record_failure)


if __name__ == "__main__":
    sys.exit(main())
