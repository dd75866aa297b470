"""One skeleton of a hand as the subject's tables have it; what a table cannot give, its message says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from shukotsu.errors import joined
from shukotsu.hand.digit_chain import Rows
from shukotsu.hand.known_digits import known_digits
from shukotsu.hand.posed_recording import Opened, RecordingReader, readable
from shukotsu.study.config_files import REFERENCE
from shukotsu.study.model import read_model
from shukotsu.study.plan import SubjectPlan
from shukotsu.tables.catalogue import BONE_LENGTHS, JOINT_CENTRES, TIP_ERRORS
from shukotsu.tables.parts import Part
from shukotsu.tables.poses import RecordingName

Row = dict[str, Any]

_OF_A_FIT = {"joint_centres": "fitted_joints", "bone_lengths": "fitted_bones"}
"""Tables of the hand that anatomy alone expects, which its fit alone writes."""

TIP = ("tip_x_mm", "tip_y_mm", "tip_z_mm")


@dataclass(frozen=True)
class Stated:
    """What a skeleton states of itself: joint_centres by joint, bone_lengths by segment."""

    joints: Rows
    bones: Rows


@dataclass(frozen=True)
class ScoredSkeleton:
    """A skeleton and the reader of its tables.

    reader : of any recording of the hand. calibrated_on : tasks, or "task, trial", and tasks : that it was
    made from. stated : what its tables say. tip_messages : by task, trial and digit. message : what could
    not be read. reference : whether it is the hand that anatomy alone expects, scored in the frames that it
    was posed in.
    """

    reader: RecordingReader
    calibrated_on: str
    tasks: tuple[str, ...]
    stated: Stated
    tip_messages: Mapping[tuple[str, str, str], str]
    message: str
    reference: bool = False

    def held_out(self, name: RecordingName) -> bool:
        """Whether the skeleton was made without this recording's task."""
        return self.reference or name.task not in self.tasks


def read_skeleton(opened: Opened, plan: SubjectPlan, part: Part) -> ScoredSkeleton:
    """Read the short tables of a skeleton; `message` says which parts failed. A TableError is raised.

    part : of the tables; under the model REFERENCE the hand that anatomy expects, which stands beside all
    models.
    """
    hand, layout, reference = part.hand, plan.layouts[part.hand], part.model == REFERENCE
    any_recording = next(each for each in plan.recordings if each.hand.hand == hand)
    reader = RecordingReader(
        any_recording,
        layout,
        read_model(REFERENCE) if reference else plan.models[part.model],
        part,
        plan.poses_files[any_recording],
        lambda name: plan.table(_OF_A_FIT.get(name, name) if reference else name, hand, part.model),
        opened,
    )
    reasons: list[str] = []
    joints, bones = (
        readable(lambda table=table: reader.rows(table), reasons) or []  # type: ignore[misc]
        for table in (JOINT_CENTRES, BONE_LENGTHS)
    )
    stated = Stated({row["joint"]: row for row in joints}, {row["bone"]: row for row in bones})
    if reference:
        calibrating, calibrated_on = plan.all_calibrating(hand), ""
        unknown = layout.digits.keys() - {digit.name for digit in known_digits(layout)}
        tip_messages = {
            (recording.task, recording.trial, digit): "no published anatomy of this digit"
            for recording in plan.evaluated(hand)
            for digit in unknown
        }
    else:
        calibrating = plan.calibrating(hand, part.model, part.made_without)
        calibrated_on = ";".join(", ".join(filter(None, (r.task, r.trial))) for r in calibrating)
        errors = readable(lambda: reader.rows(TIP_ERRORS), reasons) or []
        tip_messages = {(row["task"], row["trial"], row["digit"]): row["message"] for row in errors}
    tasks = tuple(recording.task for recording in calibrating)
    return ScoredSkeleton(reader, calibrated_on, tasks, stated, tip_messages, joined(reasons), reference)
