"""The stages' command lines for one hand, chained as in the Snakefile; run here or as processes."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

LAYOUT = "liberty16"


@dataclass(frozen=True)
class Job:
    """One stage, e.g. solve_joints, with the words of its command line."""

    stage: str
    words: tuple[str, ...]


def capture(recording: Path, poses: Path, hand: str, task: str) -> Job:
    """Recording -> poses."""
    names = f"--layout={LAYOUT}", "--subject=01", f"--hand={hand}", f"--task={task}"
    return Job("capture", ("import", f"--in={recording}", f"--out={poses}", *names))


def joints(folder: Path, model: str, calibration: Path) -> list[Job]:
    """Poses -> the folder's joint_solutions and projected_joints."""
    solutions, projected = folder / "joint_solutions.parquet", folder / "projected_joints.parquet"
    named = "--layout", LAYOUT, "--model", model
    return [
        Job("solve_joints", (*named, "--poses", str(calibration), "--out", str(solutions))),
        Job("project_planes", (*named, "--joints", str(solutions), "--out", str(projected))),
    ]


def advice(poses: Path, folder: Path) -> Job:
    """Poses -> the folder's calibration_advice."""
    out = folder / "calibration_advice.parquet"
    return Job("check_calibration", ("--layout", LAYOUT, "--poses", str(poses), "--out", str(out)))


def whole_hand(projected: Path, folder: Path, poses: Path) -> Job:
    """Joints one by one -> the whole hand in the folder, and the poses posed with it."""
    from stages.fit_hand.__main__ import OUTPUTS

    outputs = [f"--{name.replace('_', '-')}={folder / table}.parquet" for name, (table, _) in OUTPUTS.items()]
    named = f"--layout={LAYOUT}", "--model=whole-hand", f"--joints={projected}"
    return Job("fit_hand", (*named, f"--poses={poses}", f"--replay={poses}", *outputs))


def scores(skeletons: Path, folder: Path, poses: Path) -> Job:
    """A hand's skeletons -> the folder's skeleton_scores and joint_errors."""
    named = f"--layout={LAYOUT}", f"--poses={poses}", f"--calibration={poses}", f"--skeletons={skeletons}"
    outputs = f"--out={folder / 'skeleton_scores.parquet'}", f"--out-joints={folder / 'joint_errors.parquet'}"
    return Job("evaluate_skeletons", (*named, *outputs))


def skeleton(
    projected: Path, folder: Path, model: str, calibration: Path, evaluated: Sequence[Path]
) -> list[Job]:
    """Joint centres without a wrist, or with a true one -> the folder's skeleton, tips and tip_errors."""
    paths = {
        name: str(folder / f"{name}.parquet")
        for name in ("joint_centres", "bone_lengths", "metacarpals", "tips", "tip_errors")
    }
    named = "--layout", LAYOUT, "--model", model
    poses = "--calibration", str(calibration), "--poses", *map(str, evaluated)
    made = "--out-joints", paths["joint_centres"], "--out-bones", paths["bone_lengths"]
    built = "--joints", paths["joint_centres"], "--bones", paths["bone_lengths"]
    posed = "--metacarpals", paths["metacarpals"]
    return [
        Job(
            "estimate_metacarpals",
            (*named, *poses, *made, "--joints", str(projected), "--out", paths["metacarpals"]),
        ),
        Job(
            "evaluate_tips",
            (*named, *poses, *built, *posed, "--out", paths["tips"], "--out-errors", paths["tip_errors"]),
        ),
    ]


def run_here(jobs: Iterable[Job]) -> None:
    """Run the jobs in this process; RuntimeError where one fails."""
    for job in jobs:
        status = importlib.import_module(f"stages.{job.stage}.__main__").main(list(job.words))
        if status:
            raise RuntimeError(f"stages.{job.stage} {' '.join(job.words)} ended with {status}")
