"""Value each joint's motion now and a full motion, and choose advice of a kind."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from shukotsu.schemas.advice import (
    ENOUGH,
    GAP,
    MOVE,
    ON_SKIN,
    OPEN_AXIS,
    UNCERTAIN,
    UNSEEN,
    Values,
    advice_text,
)
from shukotsu.schemas.layout import FINGER_MM, Joint, Layout
from shukotsu.schemas.verdict import WIDE_GAP_TIMES
from shukotsu.skeleton.rotations import Array, about_axis, from_matrix, matrix, multiply
from shukotsu.stages.solve_joints.anatomical import MAX_EFFECTIVE, WeighedHand, centre_sd_mm
from shukotsu.stages.solve_joints.evidence import JointEvidence, joint_evidence, weigh
from shukotsu.stages.solve_joints.hand_posterior import Information, hand_posterior
from shukotsu.stages.solve_joints.posture_sample import SpreadFrames

WANTED_DEG = {"thumb_mcp": 40.0, "cmc": 30.0, "mcp": 50.0, "pip": 60.0, "dip": 40.0, "ip": 40.0}
"""Range that a healthy joint has to spare (published: MCP 90, PIP 100, DIP 90, thumb IP 80 deg)."""

WANTED_ELSEWHERE_DEG = 40.0
SMALL_GAIN_MM = 0.15

JOINTWISE = 1.7
"""So many times its error in a fit of the whole hand is a centre's at most, joint by joint."""

_FRAMES = 120


@dataclass(frozen=True)
class Advice:
    """One joint; range_deg, sd_now_mm and sd_moved_mm are None where no frame shows it.

    kind, values : what to do, see `shukotsu.schemas.advice`.
    """

    joint: str
    range_deg: float | None
    sd_now_mm: float | None
    sd_moved_mm: float | None
    kind: str
    values: Values = field(default_factory=dict)

    @property
    def columns(self) -> dict[str, Any]:
        """The advice as a table's row has it."""
        return {
            **vars(self),
            "values": json.dumps(self.values, ensure_ascii=False) if self.values else "",
            "advice": advice_text(self.joint, self.kind, self.values),
        }


def advise(fit: WeighedHand | None, layout: Layout) -> list[Advice]:
    """Give an advice for every solvable joint of the layout, in its order."""
    rows = {} if fit is None else {index: row for row, index in enumerate(fit.joints)}
    advice = []
    for index, joint in enumerate(layout.solvable):
        if fit is not None and index in rows:
            advice.append(_advice(fit, rows[index], fit.joints[index], layout))
        elif not (layout.segments[joint.parent_receiver].optional or layout.segments[joint.child].optional):
            advice.append(Advice(joint.name, None, None, None, UNSEEN, _receivers(joint)))
    return advice


def _receivers(joint: Joint) -> dict[str, Any]:
    return {"parent": joint.parent_receiver, "child": joint.child}


def _advice(fit: WeighedHand, row: int, evidence: JointEvidence, layout: Layout) -> Advice:
    name = evidence.joint.name
    wanted_deg = WANTED_DEG.get(name) or WANTED_DEG.get(name.rsplit("_", 1)[-1], WANTED_ELSEWHERE_DEG)
    moved_deg, free = evidence.motion.range_deg, list(fit.free.values())[row]
    now_mm, moved_mm = centre_sd_mm(fit.covariance(row, fit.posterior)), None
    kind, values = _standing(fit, row, evidence, layout, 0.0 if free is None else free.gap_rms_free_mm)
    if moved_deg < wanted_deg and kind != GAP:
        information = list(fit.information)
        information[row] = _if_it_moved(fit, row, evidence, np.radians(wanted_deg), layout)
        moved_mm = min(now_mm, centre_sd_mm(fit.covariance(row, hand_posterior(fit.prior, information))))
        if now_mm - moved_mm >= SMALL_GAIN_MM:
            kind, values = MOVE, {"wanted_deg": wanted_deg}
    return Advice(name, moved_deg, now_mm, now_mm if moved_mm is None else moved_mm, kind, values)


def _standing(
    fit: WeighedHand, row: int, evidence: JointEvidence, layout: Layout, gap_mm: float
) -> tuple[str, Values]:
    """The advice on a joint where more motion gains nothing. gap_mm : rms, that no centre closes."""
    wanted_mm = layout.wanted_mm
    enough_mm = JOINTWISE * wanted_mm if layout.is_hand else wanted_mm
    receivers = _receivers(evidence.joint)
    if gap_mm > WIDE_GAP_TIMES * wanted_mm:
        return GAP, {"gap_mm": gap_mm, **receivers}
    covariance = fit.covariance(row, fit.posterior)
    now_mm, axis = centre_sd_mm(covariance), evidence.motion.axis_child
    if now_mm <= enough_mm:
        wide = gap_mm > WIDE_GAP_TIMES * FINGER_MM
        return (ON_SKIN, {"gap_mm": gap_mm}) if wide else (ENOUGH, {})
    across = np.eye(3) - np.outer(axis, axis)
    if evidence.dof == 1 and np.sqrt(np.trace(across @ covariance[3:, 3:] @ across)) <= enough_mm:
        return OPEN_AXIS, {"sd_mm": now_mm, "gap_mm": gap_mm}
    return UNCERTAIN, {"sd_mm": now_mm, "enough_mm": enough_mm, "gap_mm": gap_mm, **receivers}


def _if_it_moved(
    fit: WeighedHand, row: int, evidence: JointEvidence, range_rad: float, layout: Layout
) -> Information:
    """Information from the joint if it alone moved through the range, with the same skin."""
    centre_mm = fit.posterior.mean[6 * row : 6 * row + 6]
    frames = _imagined_frames(evidence, centre_mm, range_rad)
    lateral = np.array(layout.segments[evidence.joint.child].lateral)
    hinge = replace(evidence.joint, dof=1)  # which it is while it moves about one axis alone
    moved = joint_evidence(hinge, evidence.prior, frames, lateral)
    moved.scatter_mm = evidence.scatter_mm
    return weigh(moved, centre_mm, layout, fit.looseness, MAX_EFFECTIVE)


def _imagined_frames(evidence: JointEvidence, centre_mm: Array, range_rad: float) -> SpreadFrames:
    """Frames of a flexion about the joint's own axis, evenly through the range about its middle posture."""
    motion, expected = evidence.motion, evidence.prior.axis_child
    axis = motion.axis_child if expected is None else expected
    angle = np.linspace(-range_rad / 2, range_rad / 2, _FRAMES)
    quaternion = multiply(from_matrix(motion.mean), about_axis(axis, angle))
    position_mm = centre_mm[:3] - np.einsum("nij,j->ni", matrix(quaternion), centre_mm[3:])
    return SpreadFrames(quaternion, position_mm, np.zeros((_FRAMES, 0, 4)), np.zeros(_FRAMES, bool))
