"""Results as notebooks want them: a table as a DataFrame, a recording as a hand that moves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shukotsu.anatomy.neutral_bones import angle_axes, neutral_rotations, to_nail_side, zeros_facing
from shukotsu.errors import InputError, TableError, guess, listed
from shukotsu.posed_hand import PosedHand
from shukotsu.schemas.catalogue import TABLES
from shukotsu.schemas.plan import SubjectPlan, read_plan
from shukotsu.schemas.results import Results
from shukotsu.schemas.study import Recording
from shukotsu.schemas.tables import read_metadata, read_table
from shukotsu.skeleton.posed_recording import posed_recording
from shukotsu.skeleton.rotations import multiply

if TYPE_CHECKING:
    import pandas as pd


def read(path: str | Path) -> pd.DataFrame:
    """Read any Parquet table of a study as a DataFrame, checked as the stages check it.

    A gap is pandas' missing value; an integer or a truth value that may be missing has pandas' nullable type.
    `attrs` holds `table` (its name), `key` (the columns that tell rows apart), `units` and `descriptions` by
    column. Raises InputError where the file is absent, damaged, another program's or another version's, and
    where it holds the reason why its making failed.
    """
    import pandas as pd
    import pyarrow as pa

    path = Path(path)
    name = read_metadata(path)["schema"]
    if name not in TABLES:
        raise TableError(f"{path}: is a {name} table, which this program does not know; make it again")
    table = TABLES[name]
    data = read_table(path, table)
    frame = data.to_pandas()
    nullable = {pa.bool_(): pd.BooleanDtype()} | {
        kind: pd.array([], dtype=str(kind).replace("i", "I").replace("u", "U")).dtype
        for kind in (pa.int8(), pa.int16(), pa.int32(), pa.int64())
    }
    for column in table.columns:
        if column.nullable and column.type in nullable:
            frame[column.name] = data.column(column.name).to_pandas(types_mapper=nullable.get)
    frame.attrs = {
        "table": name,
        "key": list(table.key),
        "units": {column.name: column.unit for column in table.columns},
        "descriptions": {column.name: column.description for column in table.columns},
    }
    return frame


def pose(
    results: str | Path,
    subject: str,
    hand: str,
    task: str,
    *,
    model: str = "whole-hand",
    trial: str = "",
    session: str = "",
) -> PosedHand:
    """Pose a hand's bones in one of its recordings, as a study's results have them under a model.

    results : the study's folder, such as results/demo; it may have been moved. hand : right or left.
    Raises InputError where the study has no such subject, recording or model, where a table is absent or its
    making failed, and where the recording only calibrates and so is not posed.
    """
    plan = _plan_in_place(Results(Path(results)).plan(subject, session))
    recording = _recording(plan, hand, task, trial)
    if model not in plan.models:
        raise InputError(f"model {model!r} is not in study {plan.study}; {guess(model, list(plan.models))}")
    posed = posed_recording(plan, recording, model)
    poses = posed.poses()
    bones = posed.bones(poses)
    facing = to_nail_side(posed.layout, hand, bones.joints, bones.quaternion)
    for index, change in facing.items():
        bones.quaternion[:, index] = multiply(bones.quaternion[:, index], change)
    offset, rest = bones.constant_part()
    joints = zeros_facing(bones.joints, facing, hand)
    neutral = neutral_rotations(posed.layout, hand, joints)
    return PosedHand(
        hand=hand,
        joints=bones.names,
        digits=tuple(joint.digit for joint in bones.joints),
        parents=bones.parents,
        frame=poses.frame,
        time_s=poses.time_s,
        position_mm=bones.position_mm,
        quaternion=bones.quaternion,
        offset_mm=offset,
        rest=np.where(np.isfinite(neutral), neutral, rest),
        axes=np.stack([angle_axes(joint, hand) for joint in joints]),
    )


def _plan_in_place(path: Path) -> SubjectPlan:
    """A subject's plan with its paths where the results are now, whatever folder Python runs in."""
    plan, folder = read_plan(path, checked=False), path.parent
    files = {own: folder / file.relative_to(plan.folder) for own, file in plan.poses_files.items()}
    return replace(plan, folder=folder, poses_files=files).with_findings()


def _recording(plan: SubjectPlan, hand: str, task: str, trial: str) -> Recording:
    for own in plan.recordings:
        if (own.hand.hand, own.task, own.trial) == (hand, task, trial):
            if own.exclude:
                raise InputError(f"{own.name}: is excluded ({own.exclude})")
            return own
    there = [" ".join(filter(None, (own.hand.hand, own.task, own.trial))) for own in plan.recordings]
    wanted = " ".join(filter(None, (hand, task, trial)))
    raise InputError(f"subject {plan.subject} has no recording {wanted}; expected one of {listed(there)}")
