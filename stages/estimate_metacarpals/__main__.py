"""Command line: poses and joint centres -> wrist point, bone lengths and metacarpal postures."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from stages import command_line

if TYPE_CHECKING:
    from schemas.model import SkeletonModel
    from stages.estimate_metacarpals.fitted import Fitted


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "stages.estimate_metacarpals",
        "Locate the wrist, measure the bones and pose the metacarpals (Eq. 8-11 of the paper).",
        "python -m stages.estimate_metacarpals --joints projected_joints.parquet "
        "--calibration rom/poses.parquet --poses opposition/poses.parquet --layout liberty16 "
        "--model paper-fig4 --out-joints joint_centres.parquet --out-bones bone_lengths.parquet "
        "--out metacarpals.parquet",
    )
    parser.add_argument("--joints", type=Path, required=True, help="joint_centres from stages.project_planes")
    parser.add_argument("--calibration", type=Path, nargs="*", default=[], help="poses the joints come from")
    parser.add_argument("--poses", type=Path, nargs="*", default=[], help="poses to pose metacarpals in")
    parser.add_argument(
        "--fitted-bones",
        type=Path,
        nargs="?",
        help="bone_lengths from stages.fit_hand, for a model that fits the hand",
    )
    parser.add_argument(
        "--bone-poses", type=Path, nargs="?", help="bone_poses from stages.fit_hand, likewise"
    )
    parser.add_argument("--layout", required=True, help="a layout that ships, or a path")
    parser.add_argument("--model", required=True, help="a skeleton model that ships, or a path")
    parser.add_argument("--out-joints", type=Path, required=True, help="joint_centres with the wrist point")
    parser.add_argument("--out-bones", type=Path, required=True, help="the bone_lengths table to write")
    parser.add_argument("--out", type=Path, required=True, help="the metacarpals table to write")
    return parser


def estimate(arguments: argparse.Namespace) -> None:
    """Read poses and joints, write the three tables."""
    from kinematics.recordings import Recordings
    from schemas.catalogue import BONE_LENGTHS, JOINT_CENTRES, METACARPALS
    from schemas.layout import read_layout
    from schemas.model import read_model
    from schemas.poses import one_hand, usable_poses
    from schemas.table_rows import in_row_groups
    from schemas.tables import (
        Provenance,
        columns_from_rows,
        read_table,
        rows_of,
        table_in_parts,
        write_table,
    )
    from stages.estimate_metacarpals.hand import build_hand, pose_metacarpals

    layout, model = read_layout(arguments.layout), read_model(arguments.model)
    table = list(rows_of(read_table(arguments.joints, JOINT_CENTRES)))
    subject, hand = one_hand(
        [*arguments.calibration, *arguments.poses], table[0]["subject"], table[0]["hand"]
    )
    names = {"subject": subject, "hand": hand, "model": model.name}
    calibration = Recordings(usable_poses(arguments.calibration)[0], layout.measured)
    fitted = _fitted(arguments, model)
    built = build_hand({row["joint"]: row for row in table}, layout, model, calibration, fitted)
    files = [arguments.joints, *arguments.calibration, *arguments.poses]
    files += [path for path in (arguments.fitted_bones, arguments.bone_poses) if path]
    provenance = Provenance.of(
        [*files, *command_line.config_files(arguments)],
        calibrated_on=_calibrated_on(arguments),
        own_cmc=list(model.own_cmc),
    )
    joints = columns_from_rows(JOINT_CENTRES, [{**row, **names} for row in built.joints])
    write_table(arguments.out_joints, JOINT_CENTRES, joints, provenance)
    bones = columns_from_rows(BONE_LENGTHS, [{**row, **names} for row in built.bones])
    write_table(arguments.out_bones, BONE_LENGTHS, bones, provenance)
    parts = pose_metacarpals(built, layout, model, usable_poses(arguments.poses)[0])
    with table_in_parts(arguments.out, METACARPALS, provenance) as write:
        for part in in_row_groups(parts):
            write(part)


def _fitted(arguments: argparse.Namespace, model: SkeletonModel) -> Fitted | None:
    """What the fit of the whole hand says; None for a model without one. Raises InputError where it lacks."""
    from schemas.errors import InputError
    from stages.estimate_metacarpals.fitted import read_fitted

    given = {"--fitted-bones": arguments.fitted_bones, "--bone-poses": arguments.bone_poses}
    if model.fitting is None:
        return None
    for option, path in given.items():
        if path is None:
            raise InputError(
                f"{option}: is missing; model {model.name} fits the whole hand (stages.fit_hand)"
            )
    return read_fitted(arguments.fitted_bones, arguments.bone_poses)


def _calibrated_on(arguments: argparse.Namespace) -> list[str]:
    """Tasks, and trials where there are any, of the calibration; a file that is none is left out."""
    from schemas.errors import InputError
    from schemas.poses import recording_name

    names = []
    for path in arguments.calibration:
        try:
            name = recording_name(path)
        except InputError:
            continue
        names.append(", ".join(filter(None, (name.task, name.trial))))
    return names


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the three tables without rows and the reason."""
    from schemas.catalogue import BONE_LENGTHS, JOINT_CENTRES, METACARPALS
    from schemas.tables import Provenance, write_failure

    provenance = Provenance.of([arguments.joints], calibrated_on=_calibrated_on(arguments))
    write_failure(arguments.out_joints, JOINT_CENTRES, message, provenance)
    write_failure(arguments.out_bones, BONE_LENGTHS, message, provenance)
    write_failure(arguments.out, METACARPALS, message, provenance)


def main(words: list[str] | None = None) -> int:
    """Run the stage on the words of a command line; give its exit code."""
    return command_line.run(build_parser().parse_args(words), estimate, record_failure)


if __name__ == "__main__":
    sys.exit(main())
