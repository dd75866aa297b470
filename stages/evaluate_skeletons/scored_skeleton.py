"""One skeleton of a hand as the subject's tables have it; what a table cannot give, its message says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from shukotsu.anatomy.known_digits import known_digits
from shukotsu.errors import InputError, TableError, joined
from shukotsu.schemas import catalogue
from shukotsu.schemas.config_files import REFERENCE
from shukotsu.schemas.parts import Part, PartsReader
from shukotsu.schemas.plan import SubjectPlan
from shukotsu.schemas.poses import RecordingName
from shukotsu.schemas.tables import Table
from shukotsu.skeleton.digit_chain import Rows
from shukotsu.skeleton.rotations import Array

Row = dict[str, Any]
T = TypeVar("T")
_OF_A_FIT = {"joint_centres": "fitted_joints", "bone_lengths": "fitted_bones"}
"""Tables whose file is called otherwise where a fit of the whole hand writes it."""

QUATERNION = ("qw", "qx", "qy", "qz")
TIP = ("tip_x_mm", "tip_y_mm", "tip_z_mm")


@dataclass(frozen=True)
class Stated:
    """What a skeleton states of itself: joint_centres by joint, bone_lengths by segment."""

    joints: Rows
    bones: Rows


def readable(read: Callable[[], T], reasons: list[str]) -> T | None:
    """The result of `read`, or None and its message among the reasons; a TableError is raised."""
    try:
        return read()
    except TableError:
        raise
    except InputError as error:
        reasons.append(error.message)
        return None


Opened = Callable[[Path, Table], PartsReader]
"""Opens a subject's table, of which all skeletons have a part, or gives the one that is open."""


@dataclass(frozen=True)
class PartTable:
    """A table's file, and the part of it that is read; a part that failed is empty, its message a reason."""

    opened: Opened
    path: Path
    table: Table
    part: Part

    def rows(self, reasons: list[str]) -> list[Row]:
        """Rows of the part."""
        return readable(lambda: self.opened(self.path, self.table).rows(self.part), reasons) or []

    def columns(
        self, name: RecordingName, by: str, own: str, columns: Sequence[str], reasons: list[str]
    ) -> Array | None:
        """Numbers (T, columns) of one recording, of one digit or segment; None where there are none."""
        key = (self.part, name.task, name.trial, by, columns)
        read = readable(lambda: self.opened(self.path, self.table).recording(*key, name=own), reasons)
        return None if read is None else read.get(own)


@dataclass(frozen=True)
class ScoredSkeleton:
    """A skeleton and where its tables are.

    calibrated_on : tasks, or "task, trial", and tasks : that it was made from. posed_tips : of the whole
    hand; None where the model has none. metacarpals : by digit, or bone_poses by segment. tip_messages : by
    task, trial and digit. message : what could not be read. reference : whether it is the hand that anatomy
    alone expects, scored in the frames that it was posed in.
    """

    part: Part
    calibrated_on: str
    tasks: tuple[str, ...]
    stated: Stated
    tips: PartTable | None
    metacarpals: PartTable | None
    posed_tips: PartTable | None
    tip_messages: Mapping[tuple[str, str, str], str]
    message: str
    reference: bool = False

    def held_out(self, name: RecordingName) -> bool:
        """Whether the skeleton was made without this recording's task."""
        return self.reference or name.task not in self.tasks


def read_skeleton(opened: Opened, plan: SubjectPlan, part: Part) -> ScoredSkeleton:
    """Read the short tables of a skeleton; `message` says which parts failed. A TableError is raised."""

    def of(table: Table) -> PartTable:
        return PartTable(opened, plan.table(table.name), table, part)

    reasons: list[str] = []
    stated = _stated(of, reasons)
    errors = of(catalogue.TIP_ERRORS).rows(reasons)
    posed_tips = None
    if plan.models[part.model].fitting is not None:
        file = plan.fit_table(part.hand, part.model, catalogue.POSED_TIPS.name)
        posed_tips = PartTable(opened, file, catalogue.POSED_TIPS, part)
    calibrating = plan.calibrating(part.hand, part.model, part.made_without)
    return ScoredSkeleton(
        part=part,
        calibrated_on=";".join(", ".join(filter(None, (r.task, r.trial))) for r in calibrating),
        tasks=tuple(recording.task for recording in calibrating),
        stated=stated,
        tips=of(catalogue.TIPS),
        metacarpals=of(catalogue.METACARPALS),
        posed_tips=posed_tips,
        tip_messages={(row["task"], row["trial"], row["digit"]): row["message"] for row in errors},
        message=joined(reasons),
    )


def read_prior(opened: Opened, plan: SubjectPlan, hand: str) -> ScoredSkeleton | None:
    """Read the hand that anatomy expects, a reference for all models; None without known digits."""
    layout, part = plan.layouts[hand], plan.part(hand, REFERENCE)
    digits = {digit.name for digit in known_digits(layout)}
    if not digits:
        return None

    def of(table: Table) -> PartTable:
        path = plan.fit_table(hand, REFERENCE, _OF_A_FIT.get(table.name, table.name))
        return PartTable(opened, path, table, part)

    reasons: list[str] = []
    stated = _stated(of, reasons)
    unknown = "no published anatomy of this digit"
    return ScoredSkeleton(
        part=part,
        calibrated_on="",
        tasks=tuple(recording.task for recording in plan.all_calibrating(hand)),
        stated=stated,
        tips=None,
        metacarpals=None if reasons else of(catalogue.BONE_POSES),
        posed_tips=None if reasons else of(catalogue.POSED_TIPS),
        tip_messages={
            (recording.task, recording.trial, digit): unknown
            for recording in plan.evaluated(hand)
            for digit in layout.digits.keys() - digits
        },
        message=joined(reasons),
        reference=True,
    )


def _stated(of: Callable[[Table], PartTable], reasons: list[str]) -> Stated:
    joints, bones = of(catalogue.JOINT_CENTRES).rows(reasons), of(catalogue.BONE_LENGTHS).rows(reasons)
    return Stated({row["joint"]: row for row in joints}, {row["bone"]: row for row in bones})
