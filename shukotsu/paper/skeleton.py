"""Assemble a skeleton from projected or fitted joints, add verdicts, and write its joints and bones."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.arrays import Array, Index
from shukotsu.errors import InputError, TableError
from shukotsu.hand.digit_chain import Rows
from shukotsu.hand.measured import not_measured_text, not_worn
from shukotsu.paper.hand import BuiltHand, build_hand, pose_metacarpals
from shukotsu.study import verdict
from shukotsu.study.layout import Layout
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import BONE_LENGTHS, BONE_POSES, DISTAL_RECEIVER, JOINT_CENTRES
from shukotsu.tables.parts import Opened, Part, PartsWriter, read_part
from shukotsu.tables.poses import poses_reader, seen_segments, usable_poses
from shukotsu.tables.typed_table import rows_of

if TYPE_CHECKING:
    from shukotsu.tables.rows import BoneLengthsRow, JointCentresRow

_KEPT_OF_FAILED = ("joint", "parent_segment", "child_segment", "dof", "n_frames", "source")
"""Columns that a row keeps if the fit failed or a receiver was not worn."""

_OF_JOINTWISE_SOLUTION = ("gap_rms_free_mm", "n_frames", "n_effective")
"""Columns that only joints solved one by one have."""


def merge_fitted(
    fitted_rows: Sequence[JointCentresRow], projected_rows: Sequence[JointCentresRow]
) -> list[JointCentresRow]:
    """Merge the joints of a whole-hand fit with those that were solved one by one.

    Parameters
    ----------
    fitted_rows, projected_rows : sequence of dict
        Rows of joint_centres from the fit, and from plane projection.

    Returns
    -------
    list of dict
        Projected joints in their order, replaced by those of the fit if it has them, then its other joints.

    """
    fitted = _by("joint", fitted_rows)
    merged: list[JointCentresRow] = []
    for projected in projected_rows:
        row = fitted.pop(projected["joint"], None)
        numbers = {name: value for name, value in projected.items() if name in _OF_JOINTWISE_SOLUTION}
        merged.append(projected if row is None else row | numbers)
    return [*merged, *fitted.values()]


def _without_numbers(row: JointCentresRow, message: str) -> JointCentresRow:
    """Reduce a row of joint_centres to that of a failed joint."""
    kept: Any = {name: value for name, value in row.items() if name in _KEPT_OF_FAILED}
    failed: JointCentresRow = {"status": "failed", "message": message}
    failed |= verdict.UNJUDGED | kept
    return failed


def judge_hand(
    hand: BuiltHand, layout: Layout, suspicion: verdict.Doubts, worn: Collection[str] | None = None
) -> BuiltHand:
    """Add the verdict on every joint and bone.

    Parameters
    ----------
    hand : BuiltHand
        The assembled hand.
    layout : Layout
        Layout of the hand, with the wanted accuracy.
    suspicion : mapping
        Doubts due to suspect recordings; empty if there are none.
    worn : collection of str, optional
        Segments whose receivers have a pose in the calibration; all if omitted. Joints that they do not
        measure lose their numbers.

    Returns
    -------
    BuiltHand
        The same hand with verdicts.

    """
    wanted_mm = layout.wanted_mm
    unworn = {} if worn is None else _unworn(_by("joint", hand.joints), layout, worn)
    rows = [
        _without_numbers(row, not_measured_text(unworn[row["joint"]])) if row["joint"] in unworn else row
        for row in hand.joints
    ]
    doubts = knuckles_too_close(_by("joint", rows), layout)  # none of them is unworn: those have no centre
    doubts |= {joint: {verdict.NOT_WORN: {"segments": lacking}} for joint, lacking in unworn.items()}
    joints = {
        row["joint"]: verdict.judged_joint(row, wanted_mm, {**suspicion, **doubts.get(row["joint"], {})})
        for row in rows
    }
    gone = {name for name, digit in layout.digits.items() if unworn.keys() >= {*digit.joints} & joints.keys()}
    why = "not measured: no receiver on this digit"
    bones: list[BoneLengthsRow] = [
        {**bone, "length_mm": None, "sd_mm": None, "message": why} if bone["digit"] in gone else bone
        for bone in hand.bones
    ]
    bones = [verdict.judged_bone(bone, joints, wanted_mm, is_whole=is_whole(bone, layout)) for bone in bones]
    return replace(hand, joints=[*joints.values()], bones=bones)


def _unworn(joints: Rows, layout: Layout, worn: Collection[str]) -> dict[str, list[str]]:
    """Return missing receivers by joint, for digit joints that are not measured or failed without them."""
    unworn = {}
    for name in (name for digit in layout.digits.values() for name in digit.joints if name in joints):
        sides = (layout.joints[name].parent_receiver, layout.joints[name].child)
        lacking = not_worn(layout, name, worn)
        if not lacking and joints[name]["status"] == "failed":
            lacking = [side for side in sides if layout.segments[side].measured and side not in worn]
        if lacking:
            unworn[name] = lacking
    return unworn


def knuckles_too_close(joints: Rows, layout: Layout) -> dict[str, verdict.Doubts]:
    """Find neighbouring MCP centres that are implausibly close to each other.

    Parameters
    ----------
    joints : mapping
        Rows of joint_centres by joint.
    layout : Layout
        Layout of the hand.

    Returns
    -------
    dict
        Joint -> the doubt about it.

    """
    knuckles = [digit.joints[1] for digit in layout.digits.values() if layout.is_hand and digit.joints[1:]]
    doubts: dict[str, verdict.Doubts] = {}
    for pair in pairwise(joint for joint in knuckles if joint in joints):
        first, second = (
            np.array([joints[joint].get(f"parent_{axis}_mm") for axis in "xyz"], float) for joint in pair
        )
        apart_mm = float(np.linalg.norm(first - second))
        receivers = {layout.joints[joint].parent_receiver for joint in pair}
        if len(receivers) == 1 and apart_mm < verdict.LEAST_KNUCKLES_MM:
            doubts |= {joint: {verdict.TOO_CLOSE: {"joints": [*pair], "mm": apart_mm}} for joint in pair}
    return doubts


def is_whole(bone: BoneLengthsRow, layout: Layout) -> bool:
    """Return whether a row of bone_lengths spans the whole bone: from its joint to the next or its tip."""
    joint_of = {joint.child: name for name, joint in layout.joints.items()}
    return bool(bone["starts_at"] == joint_of.get(bone["bone"]) and bone["ends_at"] != DISTAL_RECEIVER)


def write_skeleton(plan: SubjectPlan, part: Part, opened: Opened, tables: Mapping[str, PartsWriter]) -> None:
    """Write one skeleton's rows of joint_centres, bone_lengths and metacarpals.

    opened : opens the tables to read. tables : writers by name.
    """
    layout, model = plan.layouts[part.hand], plan.models[part.model]
    projected = list(rows_of(read_part(plan.table("projected_joints"), JOINT_CENTRES, part)))
    calibration = plan.calibrating(part.hand, part.model, part.made_without)
    usable = usable_poses([plan.poses(r) for r in calibration])[0]
    reader = poses_reader(usable, layout.measured)
    rows = projected
    fitted_bones: Mapping[str, BoneLengthsRow] = {}
    if model.fitting is not None:
        try:
            fit = (part.hand, part.model)
            fitted = read_part(plan.table("fitted_joints", *fit), JOINT_CENTRES, part)
            rows = merge_fitted(list(rows_of(fitted)), projected)
            bone_rows = rows_of(read_part(plan.table("fitted_bones", *fit), BONE_LENGTHS, part))
            fitted_bones = _by("bone", bone_rows)
        except TableError:
            raise
        except InputError as error:  # the reason goes into the rows
            of_fit: JointCentresRow = {"source": "fit of the whole hand"}
            rows = [_without_numbers({**row, **of_fit}, str(error)) for row in projected]
    hand = build_hand(_by("joint", rows), layout, model, reader, fitted_bones)
    parameters = {"calibrated_on": [recording.title for recording in calibration]}
    suspects = [recording.title for recording in plan.suspect if recording.hand.hand == part.hand]
    worn = {segment for path in usable for segment in seen_segments(path)} or None
    hand = judge_hand(hand, layout, {verdict.SUSPECT: {"recordings": suspects}} if suspects else {}, worn)
    tables["joint_centres"].rows(part, hand.joints, **parameters)
    tables["bone_lengths"].rows(part, hand.bones, **parameters)
    tables["metacarpals"].rows(part, [], **parameters)
    for recording in plan.posed(part.hand, part.made_without):
        fitted_turns = partial(_fitted_turns, plan, part, opened, recording)
        for path in usable_poses([plan.poses(recording)])[0]:
            reader = poses_reader([path], layout.measured)
            for columns in pose_metacarpals(hand, reader, fitted_turns):
                tables["metacarpals"].columns(part, {**recording.key, **columns})


def _fitted_turns(
    plan: SubjectPlan, part: Part, opened: Opened, recording: Recording, segment: str, frames: Index
) -> Array | None:
    """Read quaternions (T, 4) of a segment at those frames as the whole-hand fit posed it."""
    keys = (part, recording.task, recording.trial, [f"q{name}" for name in "wxyz"])
    with opened(plan.table("bone_poses", part.hand, part.model), BONE_POSES) as parts:
        return parts.recording(*keys, len(frames), frames, segment).get(segment)


def _by(key: str, rows: Any) -> Any:
    """Index rows by the value of a column."""
    return {row[key]: row for row in rows}
