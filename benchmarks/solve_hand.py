"""The computing of solve_joints for one hand: every joint between two of its 16 receivers."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.interleaved import compare
from benchmarks.text_table import Cell, TextTable
from schemas.layout import Joint, Layout, read_layout
from schemas.model import read_model
from schemas.poses import Poses
from stages.simulate.realism import Realism
from stages.simulate.simulation import Simulated, simulate
from stages.solve_joints.closed import JointSolution, solve_closed
from stages.solve_joints.moments import JointMoments
from stages.solve_joints.solve import add_block
from stages.solve_joints.stacked import StackedSolution, solve_stacked

BUDGET_MS = 50.0
CLOSED, MOMENTS, STACKED = "closed form (ours)", "its pass over the data", "stacked SVD, joint by joint"


def run(n_frames: int = 3774, rounds: int = 21) -> Iterator[TextTable]:
    """Give the one table."""
    layout, model = read_layout("liberty16"), read_model("paper-fig4")
    poses = as_poses(simulate("01", "right", "opposition", 0, Realism.full(), n_frames))
    joints = solved_joints(layout, poses)
    rivals: dict[str, Callable[[], object]] = {
        CLOSED: lambda: closed(poses, joints, model.singular_values),
        MOMENTS: lambda: moments(poses, joints),
        STACKED: lambda: stacked(poses, joints, model.singular_values),
    }
    found = compare(rivals, CLOSED, rounds)
    rows: list[tuple[Cell, ...]] = [
        (name, 1e3 * timing.seconds, timing.ratio) for name, timing in found.items()
    ]
    kept = "keeps" if 1e3 * found[CLOSED].seconds < BUDGET_MS else "DOES NOT KEEP"
    yield TextTable(
        f"solve_hand: {len(joints)} joints of {len(poses.segments)} receivers, {n_frames} frames, "
        f"{rounds} rounds in turns",
        (("solver", ""), ("median ms", ".1f"), ("x closed form", ".2f")),
        rows,
        f"From arrays of poses to solved joints, files not counted; the closed form {kept} its budget of "
        f"{BUDGET_MS:.0f} ms. It also gives each joint's sd, range, gap and independent samples.",
    )


def as_poses(simulated: Simulated) -> Poses:
    """Give a simulated recording as the stages hold it."""
    valid = np.ones(simulated.position_mm.shape[:2], bool)
    return Poses(
        simulated.segments,
        simulated.frame,
        simulated.time_s,
        simulated.position_mm,
        simulated.quaternion,
        valid,
    )


def solved_joints(layout: Layout, poses: Poses) -> list[Joint]:
    """Joints between two receivers that were worn."""
    worn = set(poses.segments)
    return [joint for joint in layout.solvable if {joint.parent_receiver, joint.child} <= worn]


def moments(poses: Poses, joints: list[Joint]) -> JointMoments:
    """Take the one pass over the data, all joints at once."""
    made = JointMoments(len(joints))
    add_block(made, poses, joints)
    return made


def closed(poses: Poses, joints: list[Joint], n_singular_values: int) -> list[JointSolution]:
    """Solve every joint by the closed form."""
    made = moments(poses, joints)
    return [solve_closed(made, index, n_singular_values) for index in range(len(joints))]


def stacked(poses: Poses, joints: list[Joint], n_singular_values: int) -> list[StackedSolution]:
    """Solve every joint by its own stack."""
    found = []
    for joint in joints:
        a, b = poses.index(joint.parent_receiver), poses.index(joint.child)
        turns, places = poses.quaternion, poses.position_mm
        found.append(solve_stacked(turns[:, a], places[:, a], turns[:, b], places[:, b], n_singular_values))
    return found
