"""What the page of a recording is made from: its poses, and its hand's tables under each model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from schemas.catalogue import (
    BONE_POSES,
    JOINT_ANGLES,
    JOINT_CENTRES,
    JOINT_SOLUTIONS,
    POSED_TIPS,
    RECEIVERS,
    TIP_ERRORS,
    TIPS,
)
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.model import SkeletonModel, read_model
from schemas.results import Results
from schemas.study import Hand, Recording, Study
from schemas.tables import Table, open_table, read_table, rows_of
from stages.gather.parts import recording_row
from stages.report.read_once import small_table
from stages.report.recording.angles import JointAngles, joint_angles_of
from stages.report.viewer.motion import HandMotion, read_motion

Row = dict[str, Any]


@dataclass(frozen=True)
class ModelResults:
    """What one model says of the hand and the recording; angles is None unless it fits the whole hand.

    joints, solutions : rows of joint_centres and joint_solutions. tip_errors : this recording's rows.
    """

    name: str
    joints: list[Row]
    solutions: list[Row]
    tip_errors: list[Row]
    angles: JointAngles | None


@dataclass(frozen=True)
class RecordingResults:
    """One recording of a study; row is what the recordings table says of it.

    models : those with results, in the study's order. left_out : the others and why. motion : None where
    nothing can be shown; trouble then says why and is else empty.
    """

    study: Study
    paths: Results
    recording: Recording
    row: Row
    models: tuple[ModelResults, ...]
    left_out: dict[str, str]
    motion: HandMotion | None
    trouble: str


def evaluated_recording(study: Study, hand: Hand, name: str) -> Recording:
    """The hand's evaluated recording of that name; InputError where the study has no such one."""
    known = study.evaluated(hand)
    for recording in known:
        if recording.name == name:
            return recording
    raise InputError(
        f"study {study.name}: has no evaluated recording {name!r} of subject {hand.subject}, {hand.hand} "
        f"hand; expected one of: {', '.join(recording.name for recording in known) or 'none there'}"
    )


def read_recording(study: Study, paths: Results, recording: Recording) -> RecordingResults:
    """Read what belongs to the recording and nothing else.

    A model whose tables are absent, not to be read, empty or the record of a failure is left out with the
    reason; so is all motion where the poses are. Raises InputError where a model or a layout is wrong.
    """
    layout = read_layout(recording.layout.absolute())
    row = recording_row(recording, paths, [])
    models = {name: read_model(path.absolute()) for name, path in study.models.items()}
    found: dict[str, ModelResults] = {}
    left_out: dict[str, str] = {}
    for name, model in models.items():
        try:
            found[name] = _read_model_results(paths, recording, model)
        except InputError as error:
            left_out[name] = str(error)
    motion, trouble = None, "no model of the study has results of this hand"
    if row["status"] == "failed":
        trouble = row["message"]
    elif found:
        try:
            motion = read_motion(paths, recording, layout, [models[name] for name in found])
            trouble = ""
        except InputError as error:
            trouble = str(error)
    return RecordingResults(study, paths, recording, row, tuple(found.values()), left_out, motion, trouble)


def _read_model_results(paths: Results, recording: Recording, model: SkeletonModel) -> ModelResults:
    def path_of(table: Table) -> Path:
        return paths.hand_table(model.name, recording.hand, table.name)

    def whole(table: Table) -> list[Row]:
        return list(rows_of(small_table(path_of(table), table)))

    for table in (BONE_POSES, RECEIVERS) if model.fitting is not None else ():
        open_table(path_of(table), table).close()
    replayed = POSED_TIPS if model.fitting is not None else TIPS
    if not _has_rows(path_of(replayed), replayed, recording):
        raise InputError(f"the {replayed.name} table has no row of this recording")
    joints = whole(JOINT_CENTRES)
    if not joints:
        raise InputError("the joint_centres table has no row")
    angles = None
    if model.fitting is not None:
        angles = joint_angles_of(
            model.name, _ours(read_table(path_of(JOINT_ANGLES), JOINT_ANGLES), recording)
        )
    errors = _ours(small_table(path_of(TIP_ERRORS), TIP_ERRORS), recording)
    return ModelResults(model.name, joints, whole(JOINT_SOLUTIONS), list(rows_of(errors)), angles)


def _has_rows(path: Path, table: Table, recording: Recording) -> bool:
    """Whether the table has rows of this recording; mostly a row group's least and greatest values say so."""
    place = {column.name: index for index, column in enumerate(table.columns)}
    with open_table(path, table) as file:
        for index in range(file.num_row_groups):
            group = file.metadata.row_group(index)
            found = [group.column(place[name]) for name in ("task", "trial")]
            if all(
                column.path_in_schema == name
                and column.statistics is not None
                and column.statistics.min == column.statistics.max == getattr(recording, name)
                for name, column in zip(("task", "trial"), found, strict=True)
            ):
                return True
    return bool(_ours(read_table(path, table, ["task", "trial"]), recording).num_rows)


def _ours(table: pa.Table, recording: Recording) -> pa.Table:
    """The rows of this recording's task and trial."""
    same = (pc.equal(table[name], getattr(recording, name)) for name in ("task", "trial"))
    return table.filter(pc.and_(*same))


def angles_of(models: Iterable[ModelResults]) -> list[JointAngles]:
    """The joint angles of those models that state any, in their order."""
    return [model.angles for model in models if model.angles is not None]
