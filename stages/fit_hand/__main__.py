"""Command line: calibration poses -> the whole hand, and recordings posed with it."""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu.stages import command_line, subject_stage

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from shukotsu.schemas.parts import Part, PartsWriter
    from shukotsu.schemas.plan import SubjectPlan


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage fit_hand",
        "Fit the whole hand at once to its calibration, and pose recordings with it.",
        "shukotsu stage fit_hand --plan results/demo/sub-01/plan.json --hand right --model whole-hand "
        "--out results/demo/sub-01/fits/right/whole-hand\n"
        "  shukotsu stage fit_hand --poses rom/poses.parquet --replay opposition/poses.parquet "
        "--layout liberty16 --model whole-hand --out fit",
    )
    subject_stage.add_plan_options(
        parser,
        calibration="--poses",
        evaluated="--replay",
        sizes=("hand_length_mm", "hand_breadth_mm"),
        sheets=("measurements", "touches"),
    )
    parser.add_argument(
        "--other-poses",
        type=Path,
        nargs="*",
        default=[],
        help="calibration poses of the same person's other hand, whose bones are as long",
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the tables to write")
    return parser


def fit(arguments: argparse.Namespace) -> None:
    """Fit every part of the hand and write what it is and how it moved."""
    from shukotsu.schemas.parts import parts_writer
    from shukotsu.schemas.poses import usable_poses
    from shukotsu.schemas.tables import Provenance
    from shukotsu.stages.fit_hand.compile_kernel import held_kernel
    from shukotsu.stages.fit_hand.hand_tables import FIT

    with held_kernel(alone=False):
        plan = _plan(arguments)
    parts = _parts(arguments, plan)
    files = [*subject_stage.poses_files(plan), *arguments.other_poses]
    files += [] if plan.is_study else plan.sheets.values()  # a study's hold other subjects' rows as well
    provenance = Provenance.of(files, plan.folder)
    with ExitStack() as stack:
        tables = {
            name: stack.enter_context(parts_writer(arguments.out / f"{name}.parquet", table, provenance))
            for name, table in FIT.items()
        }
        for part in parts:
            recorded = dict(tables)
            calibration = plan.calibrating(part.hand, part.model, part.made_without)
            if not usable_poses([plan.poses(recording) for recording in calibration])[0]:
                # the study's problems: those of recordings say it all
                for name in ("receivers", "moved_receivers", "gains"):
                    recorded.pop(name).rows(part, [])
            with subject_stage.recording_failure(arguments, part, *recorded.values()):
                _fit_part(plan, part, arguments.other_poses, tables)


def _plan(arguments: argparse.Namespace) -> SubjectPlan:
    """Return the plan, with the reference where that is to be made, of the recordings that the fit reads."""
    from dataclasses import replace

    from shukotsu.schemas.config_files import REFERENCE
    from shukotsu.schemas.model import read_model

    plan = subject_stage.plan_of(arguments)
    if arguments.model == REFERENCE:
        plan = replace(plan, models={REFERENCE: read_model(REFERENCE)})
    fitting = (
        plan.models[arguments.model].fitting if plan.is_study and arguments.model in plan.models else None
    )
    if arguments.hand is None or (fitting is not None and fitting.share_lengths):
        return plan
    return replace(plan, recordings=tuple(r for r in plan.recordings if r.hand.hand == arguments.hand))


def _parts(arguments: argparse.Namespace, plan: SubjectPlan) -> list[Part]:
    """Skeletons of the hand under the model; InputError where the plan has no such hand or model."""
    from shukotsu.errors import InputError

    if arguments.model is None:
        raise InputError("--model: is missing; expected a skeleton model that fits the whole hand")
    model = arguments.model if plan.is_study else next(iter(plan.models))
    if model not in plan.models:
        raise InputError(
            f"{arguments.plan}: has no model {model!r}; expected one of {', '.join(plan.models)}"
        )
    hand = arguments.hand or next(iter(plan.layouts))
    if hand not in plan.layouts:
        raise InputError(f"{arguments.plan}: has no {hand} hand; expected {' or '.join(plan.layouts)}")
    parts = [part for part in plan.parts(model) if part.hand == hand]
    return parts or [plan.part(hand, model)]


def _fit_part(
    plan: SubjectPlan, part: Part, other_poses: Sequence[Path], tables: Mapping[str, PartsWriter]
) -> None:
    from shukotsu.schemas.poses import recording_name, usable_poses
    from shukotsu.stages.fit_hand.calibration import calibrated_hand, partner_poses, read_thinned
    from shukotsu.stages.fit_hand.gains import gains
    from shukotsu.stages.fit_hand.hand_tables import bone_rows, joint_rows, moved_rows, receiver_rows
    from shukotsu.stages.fit_hand.loose_receivers import moved_in
    from shukotsu.stages.fit_hand.posed_tables import posed_blocks, posed_sample

    plan.check_calibration_left(part.hand)
    partner, alone = partner_poses(plan, part)
    if alone:
        print(f"note: {alone}", file=sys.stderr)
    tips, unsteady = calibrated_hand(plan, part, other_poses or partner)
    weighed = not plan.models[part.model].is_reference
    tables["fitted_joints"].rows(part, joint_rows(tips.fit, weighed=weighed))
    tables["fitted_bones"].rows(part, bone_rows(tips.fit, weighed=weighed))
    tables["receivers"].rows(part, receiver_rows(tips, unsteady), **({"note": alone} if alone else {}))
    tables["gains"].rows(part, gains(tips) if weighed else [])
    for name in ("moved_receivers", "joint_angles", "bone_poses", "posed_tips"):
        tables[name].rows(part, [])
    calibrating, tasks = (
        usable_poses([plan.poses(recording) for recording in recordings])[0]
        for recordings in (
            plan.calibrating(part.hand, part.model, part.made_without),
            plan.evaluated(part.hand, part.made_without),
        )
    )
    if not weighed:
        for path in tasks:
            for name, columns in posed_sample(tips, path).items():
                tables[name].columns(part, columns)
        return
    layout, suspect = plan.layouts[part.hand], {plan.poses(recording) for recording in plan.suspect}
    for path in tasks:
        # what is declared of a suspect recording is settled first
        moved = [] if path in suspect else moved_in(tips.fit, read_thinned(path, layout.measured))
        tables["moved_receivers"].rows(part, moved_rows(layout, recording_name(path), moved))
        for block in posed_blocks(tips, path, moved, calibrates=path in calibrating):
            for name, columns in block.items():
                tables[name].columns(part, columns)
    if part.made_without or not plan.is_study:
        return
    of_calibration = [plan.poses(own) for own in plan.recordings_of(part.hand, "calibration")]
    for path in usable_poses(of_calibration)[0]:  # their angles alone, which have a range of motion too
        for block in posed_blocks(tips, path, calibrates=True):
            tables["joint_angles"].columns(part, block["joint_angles"])


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why the hand was not fitted, of every part."""
    from shukotsu.stages.fit_hand.hand_tables import FIT

    tables = {arguments.out / f"{name}.parquet": table for name, table in FIT.items()}
    parts = _parts(arguments, _plan(arguments))
    subject_stage.record_failed_parts(message, tables, parts)


def main(argv: list[str] | None = None) -> int:
    """Run the stage; give its exit code."""
    return command_line.run(build_parser, argv, fit, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
