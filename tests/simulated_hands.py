"""Simulated hands as a study with a plan and tables of the simulation's true bones.

The skeleton of `paper-fig4` has the true joints, bones and metacarpals and moves with the receivers,
including skin motion. The posed bones and tips of `whole-hand` are the true ones.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from simulated_poses import recorded, write_poses
from small_study import write_plans, write_study

from shukotsu.export.exported_motion import read_motion
from shukotsu.export.registry import ExportSettings, prepare
from shukotsu.hand.posed_recording import recording_reader
from shukotsu.hand.posing import PosedRecording
from shukotsu.simulate.random_hand import BONES, DIGITS
from shukotsu.simulate.recording import write_truth
from shukotsu.simulate.simulation import Simulated
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.plan_file import plan_of_results
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import BONE_LENGTHS, BONE_POSES, JOINT_CENTRES, METACARPALS, POSED_TIPS
from shukotsu.tables.parts import part_metadata, parts_writer, read_part
from shukotsu.tables.poses import NUMBERS, Poses, read_poses
from shukotsu.tables.typed_table import Provenance, Table, read_table, rows_of

REPLAYED, FITTED = "paper-fig4", "whole-hand"
TIPS = ("tip_x_mm", "tip_y_mm", "tip_z_mm", "skin_tip_x_mm", "skin_tip_y_mm", "skin_tip_z_mm")
Rows = list[dict[str, Any]]


@dataclass(frozen=True)
class SimulatedHand:
    """One hand of a subject: the subject's plan, and the simulation behind its tables."""

    plan_path: Path
    simulated: Simulated

    @property
    def plan(self) -> SubjectPlan:
        """The subject's plan."""
        return plan_of_results(self.plan_path)

    @property
    def recording(self) -> Recording:
        """The hand's only recording."""
        return self.plan.evaluated(self.simulated.name.hand)[0]

    def motion(self, model: str) -> PosedRecording:
        """Return the recording's motion under a model."""
        return read_motion(recording_reader(self.plan, self.recording, model))

    def ready(self, model: str = FITTED) -> PosedRecording:
        """Return the motion prepared for a format without gaps, with y up."""
        return prepare(self.motion(model), ExportSettings(gaps="cut"), holds_gaps=False, up="y")

    def poses(self) -> Poses:
        """Return the recording's poses."""
        return read_poses(
            self.plan.poses(self.recording), self.plan.layouts[self.simulated.name.hand].measured
        )

    def path(self, model: str, table: Table) -> Path:
        """Return a table's file."""
        if table in (BONE_POSES, POSED_TIPS):
            return self.plan.table(table.name, self.simulated.name.hand, model)
        return self.plan.table(table.name)

    def rows(self, model: str, table: Table) -> Rows:
        """Return the hand's rows of a table."""
        part = self.plan.part(self.simulated.name.hand, model)
        return list(rows_of(read_part(self.path(model, table), table, part)))

    def write(self, model: str, table: Table, rows: Rows | str) -> None:
        """Replace the hand's part of a table by other rows or a failure's message."""
        path, replaced = self.path(model, table), self.plan.part(self.simulated.name.hand, model)
        others = {part: rows_of(read_part(path, table, part)) for part in part_metadata(path, table)}
        with parts_writer(path, table, Provenance()) as writer:
            for part, unchanged in others.items():
                if part != replaced:
                    writer.rows(part, unchanged)
                elif isinstance(rows, str):
                    writer.failure(part, rows)
                else:
                    writer.rows(part, rows)


def simulated_hand(folder: Path, hand: str, n_frames: int = 240, subject: str = "01") -> SimulatedHand:
    """Simulate a recording with skin, mobile palm and oblique axes, and write its tables."""
    return simulated_hands(folder, [hand], n_frames, subject)[0]


def simulated_hands(
    folder: Path, sides: Sequence[str], n_frames: int, subject: str = "01"
) -> list[SimulatedHand]:
    """Simulate several hands of one subject, as `simulated_hand` does."""
    rows = [f"{subject} {side} opposition both {side}.parquet" for side in sides]
    plan_path = write_plans(write_study(folder, *rows, models=(REPLAYED, FITTED)))[subject]
    drawn = [recorded(side, "opposition", seed=7, n_frames=n_frames)[0] for side in sides]
    hands, plan = [SimulatedHand(plan_path, simulated) for simulated in drawn], plan_of_results(plan_path)
    for hand, simulated in zip(hands, drawn, strict=True):
        write_poses(plan.poses(hand.recording), simulated, simulated.name.hand, "opposition", subject)
        write_truth(folder / simulated.name.hand, simulated, Provenance())
        truth = simulated.truth
        bones = np.concatenate([truth.bone_position_mm, truth.bone_quaternion], -1)
        tips_mm = np.concatenate([truth.tip_mm, truth.skin_tip_mm], -1)
        of_recording = {"task": "opposition", "trial": "", "frame": simulated.frame, "flags": ""}
        for table, key, names, columns, values in (
            (BONE_POSES, "segment", BONES, NUMBERS, bones),
            (POSED_TIPS, "digit", DIGITS, TIPS, tips_mm),
        ):
            with parts_writer(hand.path(FITTED, table), table, Provenance()) as writer:
                nullable = [column.name for column in table.columns if column.nullable]
                unknown = dict.fromkeys(nullable, np.full(n_frames, np.nan))
                for index, name in enumerate(names):
                    numbers = dict(zip(columns, values[:, index].T, strict=True))
                    frames = unknown | of_recording | {key: name} | numbers
                    writer.columns(plan.part(simulated.name.hand, FITTED), frames)
    for table in (JOINT_CENTRES, BONE_LENGTHS, METACARPALS):
        with parts_writer(plan.table(table.name), table, Provenance()) as writer:
            for simulated in drawn:
                columns = read_table(folder / simulated.name.hand / f"{table.name}.parquet", table)
                for model in (REPLAYED, FITTED):
                    part = plan.part(simulated.name.hand, model)
                    others = set(columns.column_names) - {*asdict(part)}
                    writer.columns(part, {name: columns[name] for name in others})
    return hands
