"""One skeleton of a hand under a model that fits it whole: fitted, and every recording posed with it."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from shukotsu.errors import InputError
from shukotsu.fit.calibration import calibrated_hand, partner_poses, read_thinned
from shukotsu.fit.gains import gains
from shukotsu.fit.hand_tables import bone_rows, joint_rows, moved_rows, receiver_rows
from shukotsu.fit.loose_receivers import moved_in
from shukotsu.fit.posed_tables import posed_blocks, posed_sample
from shukotsu.study.config_files import REFERENCE
from shukotsu.study.model import read_model
from shukotsu.study.plan import SubjectPlan
from shukotsu.tables.parts import Part, PartsWriter
from shukotsu.tables.poses import recording_name, usable_poses


def fitted_plan(plan: SubjectPlan, hand: str | None, model: str | None) -> SubjectPlan:
    """Return the plan with the reference where that is to be made, of the recordings that the fit reads."""
    if model == REFERENCE:
        plan = replace(plan, models={REFERENCE: read_model(REFERENCE)})
    planned = plan.models.get(model or "") if plan.is_study else None
    fitting = None if planned is None else planned.fitting
    if hand is None or (fitting is not None and fitting.share_lengths):
        return plan
    return replace(plan, recordings=tuple(r for r in plan.recordings if r.hand.hand == hand))


def parts_of(plan: SubjectPlan, hand: str | None, model: str | None) -> list[Part]:
    """Return skeletons of the hand under the model; InputError where the plan has no such hand or model."""
    if model is None:
        raise InputError("--model: is missing; expected a skeleton model that fits the whole hand")
    model = model if plan.is_study else next(iter(plan.models))
    if model not in plan.models:
        raise InputError(f"--plan: has no model {model!r}; expected one of {', '.join(plan.models)}")
    hand = hand or next(iter(plan.layouts))
    if hand not in plan.layouts:
        raise InputError(f"--plan: has no {hand} hand; expected {' or '.join(plan.layouts)}")
    parts = [part for part in plan.parts(model) if part.hand == hand]
    return parts or [plan.part(hand, model)]


def fitted_tables(plan: SubjectPlan, part: Part, tables: Mapping[str, PartsWriter]) -> list[PartsWriter]:
    """Return the tables into which goes why the skeleton cannot be fitted; the others get no row here.

    Of a hand without a usable recording the study's problems are those of recordings, which say it all.
    """
    recorded = dict(tables)
    calibration = plan.calibrating(part.hand, part.model, part.made_without)
    if not usable_poses([plan.poses(recording) for recording in calibration])[0]:
        for name in ("receivers", "moved_receivers", "gains"):
            recorded.pop(name).rows(part, [])
    return list(recorded.values())


def write_part(
    plan: SubjectPlan, part: Part, other_poses: Sequence[Path], tables: Mapping[str, PartsWriter]
) -> None:
    """Fit one skeleton and write its rows of every table."""
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
