"""Joints that are believed: how far off they are on hands without a fault, and whether the sd says so."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.benchmark_table import TextTable
from benchmarks.solvers import moments, solved_joints
from schemas.layout import Layout, read_layout
from schemas.model import read_model
from schemas.poses import Poses
from schemas.tables import vector_of
from schemas.verdict import BELIEVE, RADIUS_SD, judged_joint
from stages.fit_hand.fit import fit_hand
from stages.fit_hand.hand_tables import joint_rows
from stages.project_planes.place import place_joint
from stages.simulate.simulation import LAYOUT
from stages.solve_joints.anatomical import HandSample, solve_hand
from stages.solve_joints.closed import is_solvable, solve_closed
from stages.solve_joints.moments import JointMoments
from stages.solve_joints.solution_rows import solution_row
from stages.solve_joints.solve import add_block

FAR_MM = 5.0
RECOMMENDED = "whole-hand"
PAPER, ANATOMICAL, WHOLE = "paper-fig4", "anatomical", "whole-hand"

Believed = tuple[str, str, float, bool]
"""Hand, model, error in mm of the worse half of a believed joint, whether it is within the 95 % radius."""


def believed_joints(
    name: str, poses: Poses, hand: str, truth: Mapping[str, np.ndarray]
) -> Iterator[Believed]:
    """Give the joints of one recorded hand that are believed under each model.

    truth : by joint its centre (2, 3) in the parent's and the child's receiver, NaN where none is worn.
    """
    layout = read_layout(LAYOUT)
    for model, rows in (
        (PAPER, _paper(layout, poses)),
        (ANATOMICAL, _anatomical(layout, poses, hand)),
        (WHOLE, joint_rows(fit_hand([poses], layout, hand))),
    ):
        for row in rows:
            if judged_joint(row, layout.wanted_mm)["verdict"] == BELIEVE and row["joint"] in truth:
                halves_mm = np.array([vector_of(row, side, "_mm") for side in ("parent_", "child_")])
                error_mm = float(np.nanmax(np.linalg.norm(halves_mm - truth[row["joint"]], axis=-1)))
                yield name, model, error_mm, error_mm <= RADIUS_SD * row["sd_mm"]


def _paper(layout: Layout, poses: Poses) -> Iterator[Mapping[str, Any]]:
    joints, model = solved_joints(layout, poses), read_model(PAPER)
    total = moments(poses, joints)
    for index, joint in enumerate(joints):
        if is_solvable(total, index):
            row = solution_row(joint, solve_closed(total, index, 5))
            yield place_joint(joint, layout, row, model, None)


def _anatomical(layout: Layout, poses: Poses, hand: str) -> Iterator[Mapping[str, Any]]:
    joints, model = solved_joints(layout, poses), read_model(ANATOMICAL)
    total, sample = JointMoments(len(joints)), HandSample(joints)
    sample.add(add_block(total, poses, joints))
    for name, solution in solve_hand(sample, total, layout, hand, None).items():
        joint = layout.joints[name]
        yield place_joint(joint, layout, solution_row(joint, solution), model, None)


def believed_table(joints: Sequence[Believed]) -> TextTable:
    """Give how far believed joints are off, by model; by hand too of the recommended one."""
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
        "model", "hand", "joints believed:d", "median mm:.1f", "worst mm:.1f", f"> {FAR_MM:.0f} mm:d",
        "within 95 % radius %:.1f",
    )  # fmt: skip
    meaning = (
        "Hands without a fault, as above; a hand with a finding has no joint that is believed. The worse of "
        "a centre's two halves. Simulated by this project, around the anatomy that anatomical and whole-hand "
        "weigh in."
    )
    return TextTable("Joints believed", columns, rows, meaning)
