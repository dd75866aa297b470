"""Joints that are believed: how far off they are on hands without a fault, and whether the sd says so."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.benchmark_table import TextTable, add_people, of_each_person
from benchmarks.faultless_hands import other_hand, own_hand
from benchmarks.solvers import moments, solved_joints
from shukotsu.schemas.layout import Layout, read_layout
from shukotsu.schemas.model import read_model
from shukotsu.schemas.poses import Poses
from shukotsu.schemas.tables import vector_of
from shukotsu.schemas.verdict import BELIEVE, RADIUS_SD, judged_joint
from shukotsu.stages.fit_hand.fit import fit_hand
from shukotsu.stages.fit_hand.hand_tables import joint_rows
from shukotsu.stages.project_planes.place import place_joint
from shukotsu.stages.simulate.simulation import LAYOUT
from shukotsu.stages.solve_joints.anatomical import HandSample, solve_hand
from shukotsu.stages.solve_joints.closed import is_solvable, solve_closed
from shukotsu.stages.solve_joints.moments import JointMoments
from shukotsu.stages.solve_joints.solution_rows import solution_row
from shukotsu.stages.solve_joints.solve import add_block

FAR_MM = 5.0
PAPER, ANATOMICAL, WHOLE = "paper-fig4", "anatomical", "whole-hand"

WRITTEN_TO = "mistakes-benchmark.md", "believed"
FIRST_SEED = 9000
MEANING = (
    "Hands without a fault, each calibrated once. The worse of a centre's two halves. Own: simulated by this "
    "project. Of both drawings the truth is where the centre was, on average, as the receiver rode."
)

Believed = tuple[str, str, float, bool]
"""Drawing, model, error in mm of a believed joint's worse half, whether it is within the 95 % radius."""


def add_options(parser: argparse.ArgumentParser) -> None:
    add_people(parser, 100, FIRST_SEED)


def run(n_hands: int = 100, seed: int = FIRST_SEED) -> Iterator[TextTable]:
    """Give the table over that many hands of each drawing."""
    people = of_each_person(one_person, n_hands, seed)
    yield believed_table([row for person in people for row in person])


def one_person(seed: int) -> list[Believed]:
    """List the believed joints of a person's calibration, drawn twice."""
    hand = ("right", "left")[seed % 2]
    recorded = {"own": own_hand(seed, hand, "rom"), "other": other_hand(seed, hand, "rom", duration_s=25.0)}
    return [
        row
        for drawing, own in recorded.items()
        for row in believed_joints(drawing, own.poses, hand, own.truth)
    ]


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
    """Tabulate the errors of believed joints, by drawing and model."""
    groups: dict[tuple[str, str], list[Believed]] = {}
    for row in joints:
        groups.setdefault(row[:2], []).append(row)
    rows = [
        (
            *key,
            len(own),
            float(np.median([row[2] for row in own])),
            max(row[2] for row in own),
            100 * float(np.mean([row[2] > FAR_MM for row in own])),
            100 * float(np.mean([row[3] for row in own])),
        )
        for key, own in sorted(groups.items())
    ]
    columns = (
        "drawing", "model", "joints believed:d", "median mm:.1f", "worst mm:.1f", f"> {FAR_MM:.0f} mm %:.1f",
        "within 95 % radius %:.1f",
    )  # fmt: skip
    return TextTable("Joints believed", columns, rows, MEANING)
