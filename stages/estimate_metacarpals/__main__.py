"""Command line: poses and joint centres -> wrist point, bone lengths and metacarpal postures."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.stages import command_line, subject_stage

if TYPE_CHECKING:
    from shukotsu.schemas.parts import Part, PartsWriter
    from shukotsu.schemas.plan import SubjectPlan
    from shukotsu.schemas.study import Recording
    from shukotsu.skeleton.rotations import Array
    from shukotsu.stages.estimate_metacarpals.hand import BuiltHand, Index


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage estimate_metacarpals",
        "Locate the wrist, measure the bones and pose the metacarpals (Eq. 8-11 of the paper).",
        "shukotsu stage estimate_metacarpals --joints projected_joints.parquet "
        "--calibration rom/poses.parquet --poses opposition/poses.parquet --layout liberty16 "
        "--model paper-fig4 --out-joints joint_centres.parquet --out-bones bone_lengths.parquet "
        "--out metacarpals.parquet",
    )
    subject_stage.add_plan_options(parser, calibration="--calibration", evaluated="--poses")
    parser.add_argument(
        "--joints", type=Path, required=True, help="joint_centres from shukotsu.stages.project_planes"
    )
    parser.add_argument(
        "--fit",
        type=Path,
        help="of a hand alone whose model fits it: folder that shukotsu.stages.fit_hand wrote",
    )
    parser.add_argument("--out-joints", type=Path, required=True, help="joint_centres with the wrist point")
    parser.add_argument("--out-bones", type=Path, required=True, help="the bone_lengths table to write")
    parser.add_argument("--out", type=Path, required=True, help="the metacarpals table to write")
    return parser


def estimate(arguments: argparse.Namespace) -> None:
    """Build every skeleton of the plan, write the three tables."""
    from shukotsu.schemas.catalogue import BONE_LENGTHS, JOINT_CENTRES, METACARPALS
    from shukotsu.schemas.parts import parts_writer

    plan = subject_stage.plan_of(arguments, (arguments.joints, JOINT_CENTRES))
    fitted = [(hand, model) for hand in plan.hands for model in plan.fitted_models]
    names = ("fitted_joints", "fitted_bones", "bone_poses")
    fits = [_fit_file(plan, arguments.fit, *whose, name) for whose in fitted for name in names]
    files = [*subject_stage.poses_files(plan), *subject_stage.config_files(arguments)]
    provenance = subject_stage.provenance_of(plan, [arguments.joints, *fits], files)
    with (
        parts_writer(arguments.out_joints, JOINT_CENTRES, provenance) as joints,
        parts_writer(arguments.out_bones, BONE_LENGTHS, provenance) as bones,
        parts_writer(arguments.out, METACARPALS, provenance) as metacarpals,
    ):
        for part in plan.parts():
            with subject_stage.recording_failure(arguments, part, joints, bones, metacarpals):
                _estimate_part(arguments, plan, part, (joints, bones, metacarpals))


def _estimate_part(
    arguments: argparse.Namespace,
    plan: SubjectPlan,
    part: Part,
    tables: tuple[PartsWriter, PartsWriter, PartsWriter],
) -> None:
    from shukotsu.errors import InputError, TableError
    from shukotsu.schemas.catalogue import BONE_LENGTHS, JOINT_CENTRES
    from shukotsu.schemas.parts import read_part
    from shukotsu.schemas.poses import poses_reader, usable_poses
    from shukotsu.schemas.tables import rows_of
    from shukotsu.schemas.verdict import SUSPECT
    from shukotsu.stages.estimate_metacarpals.hand import build_hand, failed_joints, judged, merge_fitted

    joints, bones, metacarpals = tables
    layout, model = plan.layouts[part.hand], plan.models[part.model]
    projected = list(rows_of(read_part(arguments.joints, JOINT_CENTRES, part)))
    calibration = plan.calibrating(part.hand, part.model, part.made_without)
    reader = poses_reader(usable_poses([plan.poses(r) for r in calibration])[0], layout.measured)
    if model.fitting is None:
        hand = build_hand(_by("joint", projected), layout, model, reader)
    else:
        try:
            fit_file = partial(_fit_file, plan, arguments.fit, part.hand, part.model)
            fitted = read_part(fit_file("fitted_joints"), JOINT_CENTRES, part)
            rows = merge_fitted(list(rows_of(fitted)), projected)
            bone_rows = rows_of(read_part(fit_file("fitted_bones"), BONE_LENGTHS, part))
            fitted_bones = _by("bone", bone_rows)
        except TableError:
            raise
        except InputError as error:  # digits without numbers then say why
            rows, fitted_bones = failed_joints(projected, str(error)), {}
        hand = build_hand(_by("joint", rows), layout, model, reader, fitted_bones)
    parameters = {"calibrated_on": [", ".join(filter(None, (r.task, r.trial))) for r in calibration]}
    keys = {**plan.who._asdict(), "model": part.model, "made_without": part.made_without}
    suspects = [own.title for own in plan.suspect if own.hand.hand == part.hand]
    hand = judged(hand, layout, {SUSPECT: {"recordings": suspects}} if suspects else {})
    joints.rows(part, [{**row, **keys} for row in hand.joints], **parameters)
    bones.rows(part, [{**row, **keys} for row in hand.bones], **parameters)
    metacarpals.rows(part, [], **parameters)
    for recording in plan.evaluated(part.hand, part.made_without):
        _pose_recording(arguments, plan, part, hand, recording, metacarpals)


def _pose_recording(
    arguments: argparse.Namespace,
    plan: SubjectPlan,
    part: Part,
    hand: BuiltHand,
    recording: Recording,
    metacarpals: PartsWriter,
) -> None:
    from shukotsu.schemas.catalogue import BONE_POSES
    from shukotsu.schemas.parts import open_parts
    from shukotsu.schemas.poses import poses_reader, usable_poses
    from shukotsu.stages.estimate_metacarpals.hand import pose_metacarpals

    layout, model = plan.layouts[part.hand], plan.models[part.model]

    def posed_by_fit(segment: str, frames: Index) -> Array | None:
        keys = (part, recording.task, recording.trial, "segment", [f"q{name}" for name in "wxyz"])
        file = _fit_file(plan, arguments.fit, part.hand, part.model, "bone_poses")
        with open_parts(file, BONE_POSES) as parts:
            return parts.recording(*keys, len(frames), frames, segment).get(segment)

    for path in usable_poses([plan.poses(recording)])[0]:
        fitted = posed_by_fit if model.fitting is not None and hand.metacarpals else None  # else it failed
        for columns in pose_metacarpals(hand, layout, model, poses_reader([path], layout.measured), fitted):
            keys = {**plan.who._asdict(), "task": recording.task, "trial": recording.trial}
            metacarpals.columns(part, {**keys, **columns})


def _fit_file(plan: SubjectPlan, folder: Path | None, hand: str, model: str, name: str) -> Path:
    """A table that a fit of the whole hand wrote, of the subject or, in one folder, of a hand alone."""
    from shukotsu.errors import InputError

    if plan.is_study:
        return plan.fit_table(hand, model, name)
    if folder is None:
        raise InputError(f"--fit: is missing; model {model} fits the whole hand (shukotsu.stages.fit_hand)")
    return folder / f"{name}.parquet"


def _by(key: str, rows: Any) -> dict[str, dict[str, Any]]:
    return {row[key]: row for row in rows}


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why no skeleton was built, of every part."""
    from shukotsu.schemas.catalogue import BONE_LENGTHS, JOINT_CENTRES, METACARPALS

    tables = {
        arguments.out_joints: JOINT_CENTRES,
        arguments.out_bones: BONE_LENGTHS,
        arguments.out: METACARPALS,
    }
    parts = subject_stage.plan_of(arguments, (arguments.joints, JOINT_CENTRES)).parts()
    subject_stage.record_failed_parts(message, tables, parts)


def main(argv: list[str] | None = None) -> int:
    """Run the stage; return its exit code."""
    return command_line.run(build_parser, argv, estimate, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
