"""One skeleton of a subject: its joints and bones, and its metacarpals in every recording, written."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from shukotsu.errors import InputError, TableError
from shukotsu.hand.rotations import Array
from shukotsu.paper.hand import (
    BuiltHand,
    Index,
    build_hand,
    failed_joints,
    judged,
    merge_fitted,
    pose_metacarpals,
)
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.study.verdict import SUSPECT
from shukotsu.tables.catalogue import BONE_LENGTHS, BONE_POSES, JOINT_CENTRES
from shukotsu.tables.parts import Part, PartsWriter, open_parts, read_part
from shukotsu.tables.poses import poses_reader, usable_poses
from shukotsu.tables.typed_table import rows_of


def write_part(plan: SubjectPlan, part: Part, tables: Mapping[str, PartsWriter]) -> None:
    """Write one skeleton's rows of joint_centres, bone_lengths and metacarpals."""
    layout, model = plan.layouts[part.hand], plan.models[part.model]
    projected = list(rows_of(read_part(plan.table("projected_joints"), JOINT_CENTRES, part)))
    calibration = plan.calibrating(part.hand, part.model, part.made_without)
    reader = poses_reader(usable_poses([plan.poses(r) for r in calibration])[0], layout.measured)
    if model.fitting is None:
        hand = build_hand(_by("joint", projected), layout, model, reader)
    else:
        try:
            fit = (part.hand, part.model)
            fitted = read_part(plan.table("fitted_joints", *fit), JOINT_CENTRES, part)
            rows = merge_fitted(list(rows_of(fitted)), projected)
            bone_rows = rows_of(read_part(plan.table("fitted_bones", *fit), BONE_LENGTHS, part))
            fitted_bones = _by("bone", bone_rows)
        except TableError:
            raise
        except InputError as error:  # digits without numbers then say why
            rows, fitted_bones = failed_joints(projected, str(error)), {}
        hand = build_hand(_by("joint", rows), layout, model, reader, fitted_bones)
    parameters = {"calibrated_on": [", ".join(filter(None, (r.task, r.trial))) for r in calibration]}
    keys = {**plan.who._asdict(), "model": part.model, "made_without": part.made_without}
    suspects = [recording.title for recording in plan.suspect if recording.hand.hand == part.hand]
    hand = judged(hand, layout, {SUSPECT: {"recordings": suspects}} if suspects else {})
    tables["joint_centres"].rows(part, [{**row, **keys} for row in hand.joints], **parameters)
    tables["bone_lengths"].rows(part, [{**row, **keys} for row in hand.bones], **parameters)
    tables["metacarpals"].rows(part, [], **parameters)
    for recording in plan.evaluated(part.hand, part.made_without):
        _pose_recording(plan, part, hand, recording, tables["metacarpals"])


def _pose_recording(
    plan: SubjectPlan, part: Part, hand: BuiltHand, recording: Recording, metacarpals: PartsWriter
) -> None:
    """Write the metacarpals of one recording, if it holds poses."""
    layout, model = plan.layouts[part.hand], plan.models[part.model]

    def posed_by_fit(segment: str, frames: Index) -> Array | None:
        keys = (part, recording.task, recording.trial, "segment", [f"q{name}" for name in "wxyz"])
        with open_parts(plan.table("bone_poses", part.hand, part.model), BONE_POSES) as parts:
            return parts.recording(*keys, len(frames), frames, segment).get(segment)

    for path in usable_poses([plan.poses(recording)])[0]:
        fitted = posed_by_fit if model.fitting is not None and hand.metacarpals else None  # else it failed
        for columns in pose_metacarpals(hand, layout, model, poses_reader([path], layout.measured), fitted):
            keys = {**plan.who._asdict(), "task": recording.task, "trial": recording.trial}
            metacarpals.columns(part, {**keys, **columns})


def _by(key: str, rows: Any) -> dict[str, dict[str, Any]]:
    return {row[key]: row for row in rows}
