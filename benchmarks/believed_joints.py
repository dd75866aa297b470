"""Joints that are called ok: how far off they are on hands without a fault, and whether the sd says so."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.benchmark_table import TextTable
from benchmarks.solvers import moments, solved_joints
from schemas.layout import Layout, read_layout
from schemas.model import read_model
from schemas.poses import Poses
from stages.evaluate_skeletons.truth_errors import RADIUS_SD
from stages.fit_hand.fit import fit_hand
from stages.project_planes.place import place_joint
from stages.project_planes.plane import centre_sd_mm
from stages.simulate.simulation import LAYOUT
from stages.solve_joints.anatomical import HandSample, solve_hand
from stages.solve_joints.closed import is_solvable, solve_closed
from stages.solve_joints.moments import JointMoments
from stages.solve_joints.solution_rows import solution_row
from stages.solve_joints.solve import add_block

FAR_MM = 5.0
RECOMMENDED = "whole-hand"
PAPER, ANATOMICAL, WHOLE = "paper-fig4", "anatomical", "whole-hand"
AXES = ("parent_x_mm", "parent_y_mm", "parent_z_mm", "child_x_mm", "child_y_mm", "child_z_mm")

Believed = tuple[str, str, float, bool]
"""Hand, model, error in mm of the worse half of a joint called ok, whether it is within the 95 % radius."""


def believed_joints(
    name: str, poses: Poses, hand: str, truth: Mapping[str, np.ndarray]
) -> Iterator[Believed]:
    """Give the joints of one recorded hand that each model calls ok."""
    layout = read_layout(LAYOUT)
    for model, rows in (
        (PAPER, _paper(layout, poses)),
        (ANATOMICAL, _anatomical(layout, poses, hand)),
        (WHOLE, _whole(layout, poses, hand)),
    ):
        for joint, status, halves_mm, sd_mm in rows:
            error_mm = float(np.linalg.norm(halves_mm - truth[joint], axis=-1).max())
            if status == "ok":
                yield name, model, error_mm, error_mm <= RADIUS_SD * sd_mm


_Row = tuple[str, str, np.ndarray, float]
"""Joint, status, centre (2, 3) in the parent's and the child's receiver, and sd_mm."""


def _paper(layout: Layout, poses: Poses) -> Iterator[_Row]:
    joints, model = solved_joints(layout, poses), read_model(PAPER)
    total = moments(poses, joints)
    for index, joint in enumerate(joints):
        if is_solvable(total, index):
            row = solution_row(joint, solve_closed(total, index, 5))
            yield from _placed(place_joint(joint, layout, row, model, None))


def _anatomical(layout: Layout, poses: Poses, hand: str) -> Iterator[_Row]:
    joints, model = solved_joints(layout, poses), read_model(ANATOMICAL)
    total, sample = JointMoments(len(joints)), HandSample(joints)
    sample.add(add_block(total, poses, joints))
    for name, solution in solve_hand(sample, total, layout, hand, None).items():
        joint = layout.joints[name]
        yield from _placed(place_joint(joint, layout, solution_row(joint, solution), model, None))


def _placed(row: Mapping[str, Any]) -> Iterator[_Row]:
    if row["status"] != "failed":
        yield row["joint"], row["status"], np.reshape([row[axis] for axis in AXES], (2, 3)), row["sd_mm"]


def _whole(layout: Layout, poses: Poses, hand: str) -> Iterator[_Row]:
    for joint in fit_hand([poses], layout, hand).joints.values():
        halves_mm = np.array([joint.parent_mm, joint.child_mm])
        if np.isfinite(halves_mm).all():
            yield joint.name, joint.status, halves_mm, centre_sd_mm(joint.covariance_mm2)


def believed_table(joints: Sequence[Believed]) -> TextTable:
    """Give how far joints called ok are off, by model; by hand too of the recommended one."""
    groups: dict[tuple[str, str], list[Believed]] = {}
    for row in joints:
        if row[1] == RECOMMENDED:
            groups.setdefault((row[1], row[0]), []).append(row)
        groups.setdefault((row[1], "all"), []).append(row)
    rows = [
        (
            model,
            name,
            len(own),
            float(np.median([row[2] for row in own])),
            max(row[2] for row in own),
            sum(row[2] > FAR_MM for row in own),
            100 * float(np.mean([row[3] for row in own])),
        )
        for (model, name), own in sorted(groups.items())
    ]
    columns = (
        "model", "hand", "joints called ok:d", "median mm:.1f", "worst mm:.1f", f"> {FAR_MM:.0f} mm:d",
        "within 95 % radius %:.1f",
    )  # fmt: skip
    meaning = (
        "Hands without a fault, as above; a hand with a finding has no joint that is called ok. The worse of "
        "a centre's two halves. Simulated by this project, around the anatomy that anatomical and whole-hand "
        "weigh in."
    )
    return TextTable("Joints called ok", columns, rows, meaning)
