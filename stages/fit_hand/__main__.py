"""Command line: calibration poses and joints one by one -> the whole hand, and recordings posed with it."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stages import command_line
from stages.fit_hand import NO_CALIBRATION

if TYPE_CHECKING:
    from collections.abc import Mapping

    from schemas.layout import Layout
    from schemas.model import HandFitting
    from schemas.tables import Provenance
    from stages.fit_hand.fingertips import Fingertips

OUTPUTS = {
    "out": ("joint_centres", "the joint_centres table to write, the wrist point and the palm's joints in it"),
    "out_bones": ("bone_lengths", "the bone_lengths table to write: the bones themselves, joint to joint"),
    "out_receivers": ("receivers", "the receivers table to write"),
    "out_gains": ("gains", "the gains table to write: what measuring one more thing would gain"),
    "out_angles": ("joint_angles", "the joint_angles table to write"),
    "out_bone_poses": ("bone_poses", "the bone_poses table to write"),
    "out_tips": ("posed_tips", "the posed_tips table to write"),
}
"""Attribute of the command line to its table and its help."""


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "stages.fit_hand",
        "Fit the whole hand at once to its calibration, and pose recordings with it.",
        "python -m stages.fit_hand --poses rom/poses.parquet --joints projected_joints.parquet "
        "--replay opposition/poses.parquet --layout liberty16 --model whole-hand "
        "--out fitted_joints.parquet --out-bones fitted_bones.parquet --out-receivers receivers.parquet "
        "--out-gains gains.parquet --out-angles joint_angles.parquet --out-bone-poses bone_poses.parquet "
        "--out-tips posed_tips.parquet",
    )
    parser.add_argument("--poses", type=Path, nargs="*", default=[], help="poses of one hand's calibration")
    parser.add_argument("--joints", type=Path, required=True, help="joint_centres from stages.project_planes")
    parser.add_argument(
        "--other-poses",
        type=Path,
        nargs="*",
        default=[],
        help="calibration poses of the same person's other hand, whose bones are as long",
    )
    parser.add_argument("--replay", type=Path, nargs="*", default=[], help="poses to pose the hand in")
    parser.add_argument("--layout", required=True, help="a layout that ships, or a path")
    parser.add_argument("--model", required=True, help="a skeleton model that ships, or a path")
    parser.add_argument("--hand-length-mm", type=float, help="wrist crease to the middle finger's tip")
    parser.add_argument("--hand-breadth-mm", type=float, help="across the knuckles of digits 2 to 5")
    parser.add_argument(
        "--measurements", type=Path, nargs="?", help="sheet of measurements taken on the hands"
    )
    parser.add_argument("--touches", type=Path, nargs="?", help="sheet of touches of points that are known")
    for name, (_, what) in OUTPUTS.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=Path, required=True, help=what)
    return parser


def fit(arguments: argparse.Namespace) -> None:
    """Read the calibration, fit the hand, write what it is and how it moved."""
    from schemas.catalogue import BONE_LENGTHS, GAINS, JOINT_CENTRES, RECEIVERS
    from schemas.errors import InputError
    from schemas.layout import read_layout
    from schemas.model import read_model
    from schemas.poses import one_hand
    from schemas.tables import Provenance, columns_from_rows, read_table, rows_of, write_table
    from stages.fit_hand.gains import gains
    from stages.fit_hand.hand_tables import bone_rows, gain_rows, joint_rows, receiver_rows

    layout, model = read_layout(arguments.layout), read_model(arguments.model)
    if model.fitting is None:
        raise InputError(
            f"model {model.name} fits no whole hand; expected fit: {{whole_hand: true}} in its file"
        )
    started = list(rows_of(read_table(arguments.joints, JOINT_CENTRES)))
    subject, hand = one_hand([*arguments.poses, *arguments.replay], started[0]["subject"], started[0]["hand"])
    names = {"subject": subject, "hand": hand, "model": model.name}
    tips, loose = _calibrated(arguments, layout, model.fitting, subject, hand)
    files = [
        arguments.joints,
        *arguments.poses,
        *arguments.other_poses,
        *command_line.config_files(arguments),
    ]
    sheets = [sheet for sheet in (arguments.measurements, arguments.touches) if sheet]
    provenance = Provenance.of([*files, *sheets])
    for path, table, rows in (
        (arguments.out, JOINT_CENTRES, joint_rows(tips.fit, started)),
        (arguments.out_bones, BONE_LENGTHS, bone_rows(tips.fit)),
        (arguments.out_receivers, RECEIVERS, receiver_rows(tips, loose)),
        (arguments.out_gains, GAINS, gain_rows(gains(tips))),
    ):
        write_table(path, table, columns_from_rows(table, [{**row, **names} for row in rows]), provenance)
    _pose(arguments, tips, model.name, provenance)


def _pose(arguments: argparse.Namespace, tips: Fingertips, model: str, provenance: Provenance) -> None:
    """Pose every recording with the fitted hand and write the three tables block by block."""
    from schemas.catalogue import BONE_POSES, JOINT_ANGLES, POSED_TIPS
    from schemas.poses import usable_poses
    from schemas.tables import table_in_parts
    from stages.fit_hand.posed_tables import posed_blocks

    with (
        table_in_parts(arguments.out_angles, JOINT_ANGLES, provenance) as angles,
        table_in_parts(arguments.out_bone_poses, BONE_POSES, provenance) as bones,
        table_in_parts(arguments.out_tips, POSED_TIPS, provenance) as posed_tips,
    ):
        for block in posed_blocks(tips, model, usable_poses(arguments.replay)[0]):
            angles(block.angles)
            bones(block.bones)
            posed_tips(block.tips)


def _calibrated(
    arguments: argparse.Namespace, layout: Layout, fitting: HandFitting, subject: str, hand: str
) -> tuple[Fingertips, Mapping[str, Mapping[str, Any]]]:
    """Fit the hand, and the person's other one where there is one to share lengths with.

    Gives the hand with its fingertips, and what `receivers` says of those that came loose.
    """
    from schemas.errors import InputError
    from stages.fit_hand.calibration import Asked, Person, check_size, fit_calibration, shared, touched

    check_size("--hand-length-mm", arguments.hand_length_mm, 50, 400)
    check_size("--hand-breadth-mm", arguments.hand_breadth_mm, 30, 200)
    person = Person(arguments.hand_length_mm, arguments.hand_breadth_mm)
    asked = Asked(layout, fitting, person, arguments.measurements, arguments.touches)
    own = fit_calibration(arguments.poses, asked, subject, hand)
    if arguments.other_poses and fitting.share_lengths:
        other_hand = "left" if hand == "right" else "right"
        try:
            own = shared(own, fit_calibration(arguments.other_poses, asked, subject, other_hand))
        except InputError as error:
            print(f"note: the other hand's lengths are not shared: {error}", file=sys.stderr)
    return touched(own, asked), own.loose


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write joints that failed and why, the reason where the study looks for it, and nothing posed.

    The stages after this one go on then, and say of every digit why it has no numbers. A hand that nothing
    calibrates is no problem of this stage: what became of its recordings stands with them.
    """
    from schemas.catalogue import TABLES
    from schemas.tables import Provenance, columns_from_rows, write_failure, write_table

    provenance = Provenance.of([arguments.joints])
    joints = _failed_joints(arguments, message)
    gathered = () if message.startswith(NO_CALIBRATION) else ("out_receivers", "out_gains")
    for name, (table, _) in OUTPUTS.items():
        path, rows = getattr(arguments, name), joints if name == "out" else []
        if joints is None or name in gathered:
            write_failure(path, TABLES[table], message, provenance)
        else:
            write_table(path, TABLES[table], columns_from_rows(TABLES[table], rows or []), provenance)


def _failed_joints(arguments: argparse.Namespace, message: str) -> list[dict[str, Any]] | None:
    """The hand's joints without numbers; None where not even their names can be read."""
    from schemas.catalogue import JOINT_CENTRES
    from schemas.errors import InputError
    from schemas.tables import read_table, rows_of

    kept = ("subject", "hand", "model", "joint", "parent_segment", "child_segment", "dof", "n_frames")
    try:
        rows = list(rows_of(read_table(arguments.joints, JOINT_CENTRES)))
    except InputError:
        return None
    failed = {"source": "fit of the whole hand", "status": "failed", "message": message}
    return [{name: row[name] for name in kept} | failed for row in rows]


def main(words: list[str] | None = None) -> int:
    """Run the stage on the words of a command line; give its exit code."""
    return command_line.run(build_parser().parse_args(words), fit, record_failure)


if __name__ == "__main__":
    sys.exit(main())
