"""Command line: poses, joints, bones and metacarpals -> tips and tip_errors tables."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.stages import command_line, subject_stage

if TYPE_CHECKING:
    from shukotsu.schemas.parts import Part, PartsWriter
    from shukotsu.schemas.plan import SubjectPlan
    from shukotsu.schemas.study import Recording
    from shukotsu.skeleton.posing import Skeleton
    from shukotsu.skeleton.rotations import Array
    from shukotsu.stages.evaluate_tips.tip_tables import Index


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage evaluate_tips",
        "Replay the skeleton and measure how far its tips are from the distal receivers (section 6).",
        "shukotsu stage evaluate_tips --poses opposition/poses.parquet "
        "--calibration rom/poses.parquet --joints joint_centres.parquet "
        "--bones bone_lengths.parquet --metacarpals metacarpals.parquet --layout liberty16 "
        "--model paper-fig4 --out tips.parquet --out-errors tip_errors.parquet",
    )
    subject_stage.add_plan_options(parser, calibration="--calibration", evaluated="--poses")
    parser.add_argument("--joints", type=Path, required=True, help="joint_centres with the wrist point")
    parser.add_argument("--bones", type=Path, required=True, help="bone_lengths of the same skeletons")
    parser.add_argument("--metacarpals", type=Path, required=True, help="metacarpals of the same skeletons")
    parser.add_argument("--out", type=Path, required=True, help="the tips table to write")
    parser.add_argument("--out-errors", type=Path, required=True, help="the tip_errors table to write")
    return parser


def evaluate(arguments: argparse.Namespace) -> None:
    """Replay every skeleton of the plan in its recordings, write both tables."""
    from shukotsu.schemas.catalogue import BONE_LENGTHS, JOINT_CENTRES, METACARPALS, TIP_ERRORS, TIPS
    from shukotsu.schemas.parts import part_metadata, parts_writer
    from shukotsu.skeleton.posed_recording import read_skeleton

    plan = subject_stage.plan_of(arguments, (arguments.joints, JOINT_CENTRES))
    tables = [arguments.joints, arguments.bones, arguments.metacarpals]
    for path, table in zip(tables, (JOINT_CENTRES, BONE_LENGTHS, METACARPALS), strict=True):
        part_metadata(path, table)  # another table is called that before it is held against the rest
    files = [*subject_stage.poses_files(plan), *subject_stage.config_files(arguments)]
    provenance = subject_stage.provenance_of(plan, tables, files)
    subject_stage.check_made_together(*tables)
    with (
        parts_writer(arguments.out, TIPS, provenance) as tips,
        parts_writer(arguments.out_errors, TIP_ERRORS, provenance) as errors,
    ):
        for part in plan.parts():
            with subject_stage.recording_failure(arguments, part, tips, errors):
                layout, model = plan.layouts[part.hand], plan.models[part.model]
                skeleton = read_skeleton(arguments.joints, arguments.bones, layout, model, part)
                tips.rows(part, [])
                errors.rows(part, [])
                for recording in plan.evaluated(part.hand, part.made_without):
                    _evaluate_recording(arguments, plan, part, recording, skeleton, tips, errors)


def _evaluate_recording(
    arguments: argparse.Namespace,
    plan: SubjectPlan,
    part: Part,
    recording: Recording,
    skeleton: Skeleton,
    tips: PartsWriter,
    errors: PartsWriter,
) -> None:
    """Replay one recording; one whose import failed has rows of tip_errors that say why."""
    from shukotsu.errors import InputError, TableError
    from shukotsu.schemas.catalogue import METACARPALS
    from shukotsu.schemas.parts import open_parts
    from shukotsu.schemas.poses import frame_count, poses_reader
    from shukotsu.stages.evaluate_tips.tip_tables import replay_recording, unavailable_rows

    calibrated = plan.calibrating(part.hand, part.model, part.made_without)
    keys: dict[str, Any] = recording.key
    row_keys = {**keys, "held_out": recording not in calibrated}
    try:
        frame_count(plan.poses(recording))
    except TableError:
        raise
    except InputError as error:
        for digit in skeleton.layout.digits:
            errors.rows(part, [{**row_keys, **row} for row in unavailable_rows(digit, str(error))])
        return

    def turns(digit: str, frames: Index) -> dict[str, Array]:
        keys = (recording.task, recording.trial, "digit", [f"q{name}" for name in "wxyz"])
        with open_parts(arguments.metacarpals, METACARPALS) as parts:
            return parts.recording(part, *keys, len(frames), frames, digit)

    reader = poses_reader([plan.poses(recording)], skeleton.layout.measured)
    for columns, rows in replay_recording(skeleton, reader, turns):
        if columns is not None:
            tips.columns(part, {**keys, **columns})
        errors.rows(part, [{**row_keys, **row} for row in rows])


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why no skeleton was replayed, of every part."""
    from shukotsu.schemas.catalogue import JOINT_CENTRES, TIP_ERRORS, TIPS

    tables = {arguments.out: TIPS, arguments.out_errors: TIP_ERRORS}
    parts = subject_stage.plan_of(arguments, (arguments.joints, JOINT_CENTRES)).parts()
    subject_stage.record_failed_parts(message, tables, parts)


def main(argv: list[str] | None = None) -> int:
    """Run the stage; return its exit code."""
    return command_line.run(build_parser, argv, evaluate, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
