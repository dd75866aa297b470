"""Simulated hands as a study with a plan and tables: skeletons of which the truth is known.

The tables of both models are written from the simulation. `paper-fig4` rides on the receivers: its joints are
the true centres as the receivers carry them, skin and all, and its metacarpals point from the wrist, or the
thumb's own joint, to the MCP joints. `whole-hand` has the simulation's own bones as its posed bones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from simulated_poses import write_poses

from shukotsu.export.motion import read_motion
from shukotsu.export.registry import Settings, prepared
from shukotsu.hand.posed_recording import recording_reader
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import Array, bone_frame, from_matrix, rotate
from shukotsu.simulate.random_hand import BONES, DIGITS
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import Simulated, simulate
from shukotsu.study.layout import Layout
from shukotsu.study.plan import StudyPlans, SubjectPlan, plan_of_results, plan_text
from shukotsu.study.study import Recording, read_study
from shukotsu.study.verdict import UNJUDGED
from shukotsu.tables.catalogue import BONE_LENGTHS, BONE_POSES, JOINT_CENTRES, METACARPALS, POSED_TIPS
from shukotsu.tables.parts import part_metadata, parts_writer, read_part
from shukotsu.tables.poses import Poses, read_poses
from shukotsu.tables.typed_table import Provenance, Table, rows_of

REPLAYED, FITTED = "paper-fig4", "whole-hand"
LAYOUT = "liberty16"
POSE = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
TIPS = ("tip_x_mm", "tip_y_mm", "tip_z_mm", "skin_tip_x_mm", "skin_tip_y_mm", "skin_tip_z_mm")
BELIEVED = {**UNJUDGED, "verdict": "believe"}
SKIN_MM = 4.0
"""Of the skin beyond the last bone, along it."""
Rows = list[dict[str, Any]]


@dataclass(frozen=True)
class KnownHand:
    """One hand of a subject: the subject's plan, and the simulation that its tables are from."""

    plan_path: Path
    made: Simulated

    @property
    def plan(self) -> SubjectPlan:
        """The subject's plan."""
        return plan_of_results(self.plan_path)

    @property
    def recording(self) -> Recording:
        """The hand's one recording."""
        return self.plan.evaluated(self.made.hand)[0]

    @property
    def layout(self) -> Layout:
        """The layout."""
        return self.plan.layouts[self.made.hand]

    def motion(self, model: str) -> PosedRecording:
        """The recording's motion under that model."""
        return read_motion(recording_reader(self.plan, self.recording, model))

    def ready(self, model: str = "whole-hand", up: str = "y", **options: Any) -> PosedRecording:
        """The same as a format without gaps is to write it, with those settings."""
        return prepared(self.motion(model), Settings(**({"gaps": "cut"} | options)), holds_gaps=False, up=up)

    def poses(self) -> Poses:
        """The recording's poses."""
        return read_poses(self.plan.poses(self.recording), self.layout.measured)

    def path(self, model: str, table: Table) -> Path:
        """Where a table is."""
        if table in (BONE_POSES, POSED_TIPS):
            return self.plan.fit_table(self.made.hand, model, table.name)
        return self.plan.table(table.name)

    def rows(self, model: str, table: Table) -> Rows:
        """Rows of a table of the hand."""
        part = self.plan.part(self.made.hand, model)
        return list(rows_of(read_part(self.path(model, table), table, part)))

    def write(self, model: str, table: Table, rows: Rows | str) -> None:
        """Put other rows, or a failure's message, in the place of the hand's in a table."""
        path, own = self.path(model, table), self.plan.part(self.made.hand, model)
        others = [part for part in part_metadata(path, table) if part != own] if path.exists() else []
        kept = {part: list(rows_of(read_part(path, table, part))) for part in others}
        with parts_writer(path, table, Provenance()) as writer:
            for part, old in kept.items():
                writer.rows(part, old)
            if isinstance(rows, str):
                writer.failure(own, rows)
            else:
                writer.rows(own, rows)


def make_hand(folder: Path, hand: str, n_frames: int = 240, subject: str = "01") -> KnownHand:
    """Simulate a recording with skin, mobile palm and oblique axes, and make its tables."""
    return make_hands(folder, [hand], n_frames, subject)[0]


def make_hands(folder: Path, hands: Sequence[str], n_frames: int, subject: str = "01") -> list[KnownHand]:
    """The same of several hands of one subject."""
    made = [simulate(subject, hand, "opposition", 7, Realism.full(), n_frames) for hand in hands]
    rows = [f"{subject}\t{own.hand}\topposition\tboth\t{own.hand}.parquet\n" for own in made]
    (folder / "sheet.tsv").write_text("subject\thand\ttask\trole\tfile\n" + "".join(rows), "utf-8")
    study = folder / "study.yaml"
    study.write_text(
        f"study: made\nrecordings: sheet.tsv\nlayout: {LAYOUT}\nmodels: [{REPLAYED}, {FITTED}]\n", "utf-8"
    )
    content = StudyPlans(read_study(study), folder / "results").content(subject)
    plan_path = Path(content["folder"]) / "plan.json"
    plan_path.parent.mkdir(parents=True)
    plan_path.write_text(plan_text(content), "utf-8")
    known = [KnownHand(plan_path, own) for own in made]
    for one in known:
        write_poses(one.plan.poses(one.recording), one.made, one.made.hand, "opposition", one.made.subject)
        _write_replayed(one)
        _write_fitted(one)
    return known


def _write_replayed(known: KnownHand) -> None:
    known.write(REPLAYED, JOINT_CENTRES, _joint_rows(known))
    lengths, turns = [], []
    for digit in known.layout.digits.values():
        for index, segment in enumerate(digit.segments):
            metacarpal = index == 0
            vector = _metacarpal_mm(known, digit.name)[0] if metacarpal else _vector_mm(known, digit, index)
            row: dict[str, Any] = {
                "digit": digit.name,
                "bone": segment,
                "starts_at": digit.joints[index],
                "ends_at": "",
            }
            row |= {"length_mm": float(np.linalg.norm(vector))}
            along = {} if metacarpal else dict(zip(("x_mm", "y_mm", "z_mm"), vector, strict=True))
            lengths.append(
                row | along | {"driven_by": "" if metacarpal else segment, **BELIEVED, "message": ""}
            )
        dorsal = rotate(_bone(known, digit.segments[0])[1], np.array([0.0, 0.0, 1.0]))
        turn = from_matrix(bone_frame(_metacarpal_mm(known, digit.name), dorsal))
        turns += _framewise(known, {"digit": digit.name, "flags": ""}, POSE[3:], turn)
    known.write(REPLAYED, BONE_LENGTHS, lengths)
    known.write(REPLAYED, METACARPALS, turns)


def _joint_rows(known: KnownHand) -> Rows:
    return [
        {
            "joint": joint.name,
            "parent_segment": joint.parent_segment,
            "child_segment": joint.child_segment,
            "dof": joint.dof,
            "n_frames": len(known.made.frame),
            "source": "simulation",
            **BELIEVED,
            "status": "ok",
            "message": "",
            **_xyz("parent_{}_mm", joint.parent_mm if joint.parent_segment else None),
            **_xyz("child_{}_mm", joint.child_mm),
            **_xyz("axis_child_{}", joint.axis_child if joint.dof == 1 else None),
        }
        for joint in known.made.truth.joints.values()
    ]


def _xyz(name: str, vector: Array | None) -> dict[str, float | None]:
    values = [None] * 3 if vector is None else vector.tolist()
    return {name.format(axis): value for axis, value in zip("xyz", values, strict=True)}


def _vector_mm(known: KnownHand, digit: Any, index: int) -> Array:
    """A phalanx in its receiver's frame, from its joint to the next, a last one to the receiver."""
    joints = known.made.truth.joints
    end = np.zeros(3) if index + 1 == len(digit.joints) else joints[digit.joints[index + 1]].parent_mm
    return np.asarray(end - joints[digit.joints[index]].child_mm)


def _metacarpal_mm(known: KnownHand, digit: str) -> Array:
    """(T, 3) from the wrist, or the thumb's own joint, to the MCP joint, in the transmitter frame."""
    base = "thumb_metacarpal" if digit == "thumb" else "hand"
    return np.asarray(_bone(known, f"{digit}_proximal")[0] - _bone(known, base)[0])


def _bone(known: KnownHand, segment: str) -> tuple[Array, Array]:
    """True positions (T, 3) and rotations (T, 4) of a bone."""
    truth, index = known.made.truth, BONES.index(segment)
    return truth.bone_position_mm[:, index], truth.bone_quaternion[:, index]


def _framewise(known: KnownHand, keys: dict[str, str], columns: Sequence[str], values: Array) -> Rows:
    """A row a frame of values (T, C)."""
    keys = {"task": "opposition", "trial": "", **keys}
    return [
        {**keys, "frame": int(frame), **dict(zip(columns, row, strict=True))}
        for frame, row in zip(known.made.frame, values.tolist(), strict=True)
    ]


def _write_fitted(known: KnownHand) -> None:
    known.write(FITTED, JOINT_CENTRES, _joint_rows(known))
    ends = _ends_mm(known)
    lengths = [
        {"digit": digit.name, "bone": segment, "starts_at": joint, "ends_at": "", "length_mm": ends[segment]}
        | {"driven_by": "", **BELIEVED, "message": ""}
        for digit in known.layout.digits.values()
        for joint, segment in zip(digit.joints, digit.segments, strict=True)
    ]
    known.write(FITTED, BONE_LENGTHS, lengths)
    known.write(FITTED, METACARPALS, [])
    bones, tips = [], []
    for segment in BONES:
        pose = np.concatenate(_bone(known, segment), -1)
        bones += _framewise(known, {"segment": segment}, POSE, pose)
    for index, digit in enumerate(DIGITS):
        tip_mm, turn = known.made.truth.tip_mm[:, index], _bone(known, f"{digit}_distal")[1]
        skin_mm = tip_mm + rotate(turn, np.array([SKIN_MM, 0.0, 0.0]))
        tips += _framewise(known, {"digit": digit}, TIPS, np.concatenate([tip_mm, skin_mm], 1))
    known.write(FITTED, BONE_POSES, bones)
    known.write(FITTED, POSED_TIPS, tips)


def _ends_mm(known: KnownHand) -> dict[str, float]:
    """Length of every bone in the first frame, joint to joint, the last to its tip."""
    truth = known.made.truth
    found: dict[str, float] = {}
    for index, digit in enumerate(known.layout.digits.values()):
        places = [truth.bone_position_mm[0, BONES.index(segment)] for segment in digit.segments]
        places.append(truth.tip_mm[0, index])
        spans = np.linalg.norm(np.diff(places, axis=0), axis=1)
        found |= dict(zip(digit.segments, spans.tolist(), strict=True))
    return found
