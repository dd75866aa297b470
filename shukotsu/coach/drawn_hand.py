"""Draw the hand as it is known: its points, each carried by a receiver, its lines, and the postures of a
request.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.chain_builder import centre, receiver

if TYPE_CHECKING:
    from shukotsu.stages.fit_hand.fingertips import Fingertips
    from shukotsu.stages.fit_hand.fit import HandFit


def points_of(fit: HandFit) -> tuple[list[str], list[str], list[list[int]]]:
    """Give the skeleton's points, the segment that carries each, and its lines: pairs of points. A digit's
    end is `DIGIT_tip`.
    """
    layout = fit.evidence.layout
    points, carried, lines = [], [], []
    for digit in layout.digits.values():
        before = None
        for joint, segment in zip(digit.joints, digit.segments, strict=True):
            if joint not in fit.joints:
                continue
            points.append(joint)
            carried.append(layout.joints[joint].child)
            if before is not None:
                lines.append([before, len(points) - 1])
            before = len(points) - 1
            last = segment
        if before is not None and last in fit.bones:
            points.append(f"{digit.name}_tip")
            carried.append(last)
            lines.append([before, len(points) - 1])
    bases = [index for index, name in enumerate(points) if not any(line[1] == index for line in lines)]
    lines += [[a, b] for a, b in pairwise(bases)]
    if bases and "wrist" in fit.summary.fixed:
        points.append("wrist")
        carried.append(fit.evidence.model.receivers[0])
        lines += [[len(points) - 1, index] for index in (bases[0], bases[-1])]
    return points, carried, lines


def skeleton(tips: Fingertips) -> dict[str, Any]:
    """Give the hand's points, each in the frame of the receiver that carries it, mm, and the lines between
    them.
    """
    fit = tips.fit
    points, carried, lines = points_of(fit)
    at_mm = []
    for name in points:
        if name.endswith("_tip"):
            at = tips[name.removesuffix("_tip")].soft_tip_mm
        elif name in fit.joints:
            at = fit.joints[name].child_mm
        else:
            at = fit.summary.fixed[name].child_mm
        at_mm.append([round(float(value), 2) for value in at])
    joint_of = [name if name in fit.joints else "" for name in points]
    return {"points": points, "carried_by": carried, "at_mm": at_mm, "lines": lines, "joint_of": joint_of}


def drawn(tips: Fingertips, states: Array) -> list[list[list[float]]]:
    """Give the skeleton's points (frames, points, 3) in mm of postures (F, S), in the hand's own frame, a
    left hand's mirrored.
    """
    evidence = tips.fit.evidence
    problem, x = evidence.problem, evidence.posterior.x
    root, root_mm = np.tile(np.eye(3), (len(states), 1, 1)), np.zeros((len(states), 3))
    marks: dict[str, tuple[Array, Array]] = {}
    for branch in problem.branches:
        reached = branch.reach(x, states, root, root_mm)
        for mark, name in enumerate(branch.marks):
            marks[name] = (reached.rotation[mark], reached.position_mm[mark])
    at = skeleton(tips)
    frames = np.zeros((len(states), len(at["points"]), 3))
    for column, (name, segment, own_mm) in enumerate(
        zip(at["points"], at["carried_by"], at["at_mm"], strict=True)
    ):
        if centre(name) in marks:
            frames[:, column] = marks[centre(name)][1]
        elif receiver(segment) in marks:
            rotation, position = marks[receiver(segment)]
            own = evidence.convention.point_matrix(segment).T @ np.array(own_mm)
            frames[:, column] = position + rotation @ own
    if evidence.convention.left:
        frames *= [1.0, -1.0, 1.0]
    return [[[round(float(value), 1) for value in point] for point in frame] for frame in frames]
