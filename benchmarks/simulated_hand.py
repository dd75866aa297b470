"""One simulated hand through the pipeline: every joint's error against the truth, every tip error."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import stage_chain
from kinematics.rotations import Array
from schemas.catalogue import JOINT_CENTRES, TIP_ERRORS
from schemas.tables import Provenance, read_table, rows_of
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import Simulated, simulate
from stages.simulate.truth import TrueJoint, write_truth

TASKS = ("opposition", "rom")
MODEL = "paper-fig4"
ESTIMATED, TRUE = "estimated", "true"


@dataclass(frozen=True)
class JointError:
    """One joint solved from the recording of the task `calibration`, against the truth; mm.

    child_mm : of the half in the child's receiver frame, where the truth is one point; along_mm and
    across_mm its parts along the true axis and perpendicular to it. worse_mm : of the worse half, whose
    sd the table states as sd_mm. All NaN where the joint failed.
    """

    calibration: str
    joint: str
    status: str
    child_mm: float
    along_mm: float
    across_mm: float
    worse_mm: float
    sd_mm: float


@dataclass(frozen=True)
class TipError:
    """Mean tip error in mm of one digit replayed in one recording, with an estimated or the true skeleton."""

    calibration: str
    skeleton: str
    binding: str
    held_out: bool
    mean_mm: float


@dataclass(frozen=True)
class HandErrors:
    """All errors of one hand."""

    joints: list[JointError]
    tips: list[TipError]


def hand_errors(seed: int, hand: str, n_frames: int | None = None) -> HandErrors:
    """Simulate a hand doing every task, solve it from each, replay all of them with each."""
    made = {task: simulate("01", hand, task, seed, Realism.full(), n_frames) for task in TASKS}
    joints: list[JointError] = []
    tips: list[TipError] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        poses = {task: _captured(folder / task, simulated) for task, simulated in made.items()}
        for task in TASKS:
            estimated, true = folder / f"{task}-estimated", folder / f"{task}-true"
            stage_chain.run_here(stage_chain.joints(estimated, MODEL, poses[task]))
            write_truth(true / "truth", made[task].truth, made[task].written(), Provenance())
            sources = {
                ESTIMATED: (estimated, estimated / "projected_joints.parquet"),
                TRUE: (true, true / "truth" / "joint_centres.parquet"),
            }
            for skeleton, (place, centres) in sources.items():
                stage_chain.run_here(
                    stage_chain.skeleton(centres, place, MODEL, poses[task], list(poses.values()))
                )
                tips += _tip_errors(task, skeleton, place / "tip_errors.parquet")
            rows = rows_of(read_table(estimated / "projected_joints.parquet", JOINT_CENTRES))
            joints += [_joint_error(task, row, made[task].truth.joints) for row in rows]
    return HandErrors(joints, tips)


def _captured(folder: Path, simulated: Simulated) -> Path:
    """Write a recording and capture it; give its poses."""
    recording, poses = folder / "recording.parquet", folder / "poses.parquet"
    write_recording(recording, simulated)
    stage_chain.run_here([stage_chain.capture(recording, poses, simulated.hand, simulated.task)])
    return poses


def _joint_error(calibration: str, row: Mapping[str, Any], truth: Mapping[str, TrueJoint]) -> JointError:
    true = truth[row["joint"]]
    if row["status"] == "failed":
        nothing = float("nan")
        return JointError(calibration, row["joint"], "failed", *[nothing] * 5)
    child = _point(row, "child") - true.child_mm
    parent = _point(row, "parent") - true.parent_mm
    along = float(child @ true.axis_child)
    return JointError(
        calibration,
        row["joint"],
        row["status"],
        child_mm=float(np.linalg.norm(child)),
        along_mm=abs(along),
        across_mm=float(np.linalg.norm(child - along * true.axis_child)),
        worse_mm=float(max(np.linalg.norm(child), np.linalg.norm(parent))),
        sd_mm=row["sd_mm"],
    )


def _point(row: Mapping[str, Any], side: str) -> Array:
    return np.array([row[f"{side}_{axis}_mm"] for axis in "xyz"], float)


def _tip_errors(calibration: str, skeleton: str, path: Path) -> list[TipError]:
    return [
        TipError(calibration, skeleton, row["binding"], row["held_out"], row["mean_mm"])
        for row in rows_of(read_table(path, TIP_ERRORS))
        if row["mean_mm"] is not None
    ]
