"""A simulated hand as a study with its tables: one skeleton from the pipeline, one from the truth.

`paper-fig4` is what the stages make of the recording. The tables of `whole-hand` are written from the
simulation's own bones, so that its bones' rotations and places are known.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pipeline import import_recording, run_hand

from schemas.catalogue import BONE_LENGTHS, BONE_POSES, JOINT_CENTRES, METACARPALS, POSED_TIPS
from schemas.layout import Layout, read_layout
from schemas.model import read_model
from schemas.poses import Poses, read_poses
from schemas.results import Results
from schemas.study import Recording, read_study
from schemas.tables import Provenance, Table, columns_from_rows, read_table, rows_of, write_table
from stages.export.motion import SkeletonMotion
from stages.export.reading import read_motion
from stages.simulate.anatomy import BONES, DIGITS
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import Simulated, simulate

REPLAYED, FITTED = "paper-fig4", "whole-hand"
LAYOUT = "liberty16"


@dataclass(frozen=True)
class KnownHand:
    """One hand's study file, results, recording and truth."""

    study: Path
    paths: Results
    recording: Recording
    made: Simulated

    @property
    def layout(self) -> Layout:
        """The layout."""
        return read_layout(LAYOUT)

    def motion(self, model: str) -> SkeletonMotion:
        """The recording's motion under that model."""
        return read_motion(self.paths, self.recording, self.layout, read_model(model))

    def poses(self) -> Poses:
        """The recording's poses."""
        return read_poses(self.paths.poses(self.recording), self.layout.measured)

    def rows(self, model: str, table: Table) -> list[dict[str, Any]]:
        """Rows of a table of the hand."""
        return list(rows_of(read_table(self.paths.hand_table(model, self.recording.hand, table.name), table)))

    def write(self, model: str, table: Table, rows: list[dict[str, Any]]) -> None:
        """Put other rows in the place of a table's."""
        path = self.paths.hand_table(model, self.recording.hand, table.name)
        write_table(path, table, columns_from_rows(table, rows), Provenance())


def make_hand(folder: Path, hand: str, n_frames: int = 240, subject: str = "01") -> KnownHand:
    """Simulate a recording with skin, mobile palm and oblique axes, and make its tables."""
    made = simulate(subject, hand, "opposition", 7, Realism.full(), n_frames)
    write_recording(folder / "recording.parquet", made)
    (folder / "sheet.tsv").write_text(
        f"subject\thand\ttask\trole\tfile\n{subject}\t{hand}\topposition\tboth\trecording.parquet\n", "utf-8"
    )
    study = folder / "study.yaml"
    study.write_text(
        f"study: made\nrecordings: sheet.tsv\nlayout: {LAYOUT}\nmodels: [{REPLAYED}, {FITTED}]\n", "utf-8"
    )
    paths, recording = Results(folder / "results"), read_study(study).recordings[0]
    words = {"subject": subject, "hand": hand, "task": "opposition"}
    poses = import_recording(folder / "recording.parquet", paths.poses(recording), **words)
    run_hand(poses, poses, REPLAYED, paths.skeleton(REPLAYED, recording.hand))
    known = KnownHand(study, paths, recording, made)
    _write_fitted(known)
    return known


def _write_fitted(known: KnownHand) -> None:
    made, hand = known.made, known.recording.hand
    key = {"subject": hand.subject, "hand": hand.hand, "model": FITTED}
    posed = key | {"task": "opposition", "trial": ""}
    joints = [row | key for row in known.rows(REPLAYED, JOINT_CENTRES)]
    known.write(FITTED, JOINT_CENTRES, joints)
    ends = _ends_mm(known)
    lengths = [
        {**key, "digit": d.name, "bone": s, "driven_by": "", "message": ""}
        | {"length_mm": ends[s], "bone_mm": ends[s]}
        for d in known.layout.digits.values()
        for s in d.segments
    ]
    known.write(FITTED, BONE_LENGTHS, lengths)
    known.write(FITTED, METACARPALS, [])
    rows = []
    for bone, segment in enumerate(BONES):
        place, turn = made.truth.bone_position_mm[:, bone], made.truth.bone_quaternion[:, bone]
        rows += [
            {**posed, "segment": segment, "frame": int(frame)}
            | dict(zip(("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"), (*place[i], *turn[i]), strict=True))
            for i, frame in enumerate(made.frame)
        ]
    known.write(FITTED, BONE_POSES, rows)
    tips = []
    for d, digit in enumerate(DIGITS):
        tips += [
            {**posed, "digit": digit, "frame": int(frame)}
            | dict(zip(("tip_x_mm", "tip_y_mm", "tip_z_mm"), made.truth.tip_mm[i, d], strict=True))
            for i, frame in enumerate(made.frame)
        ]
    known.write(FITTED, POSED_TIPS, tips)


def _ends_mm(known: KnownHand) -> dict[str, float]:
    """Length of every bone in the first frame, joint to joint, the last to its tip."""
    truth, found = known.made.truth, {}
    for d, digit in enumerate(known.layout.digits.values()):
        places = [truth.bone_position_mm[0, BONES.index(segment)] for segment in digit.segments]
        places.append(truth.tip_mm[0, d])
        spans = np.linalg.norm(np.diff(places, axis=0), axis=1)
        found |= dict(zip(digit.segments, spans.tolist(), strict=True))
    return found
