"""What each joint's motion is worth now, what a full motion would be worth, and advice in words."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from schemas.layout import Joint, Layout
from skeleton.rotations import Array, about_axis, from_matrix, matrix, multiply
from stages.solve_joints.anatomical import MAX_EFFECTIVE, HandFit, centre_sd_mm
from stages.solve_joints.evidence import JointEvidence, joint_evidence, weigh
from stages.solve_joints.hand_posterior import Information, hand_posterior
from stages.solve_joints.posture_sample import SpreadFrames

WANTED_DEG = {"thumb_mcp": 40.0, "cmc": 30.0, "mcp": 50.0, "pip": 60.0, "dip": 40.0, "ip": 40.0}
"""Range that a healthy joint has to spare (published: MCP 90, PIP 100, DIP 90, thumb IP 80 deg)."""

WANTED_ELSEWHERE_DEG = 40.0
JOINT_NAMES = {
    "mcp": "knuckle",
    "pip": "middle joint",
    "dip": "fingertip joint",
    "ip": "tip joint",
    "cmc": "base",
}
SMALL_GAIN_MM = 0.15
_FRAMES = 120


@dataclass(frozen=True)
class Advice:
    """One joint; range_deg, sd_now_mm and sd_moved_mm are None where no frame shows it."""

    joint: str
    range_deg: float | None
    sd_now_mm: float | None
    sd_moved_mm: float | None
    advice: str


def advise(fit: HandFit | None, layout: Layout) -> list[Advice]:
    """Give an advice for every solvable joint of the layout, in its order."""
    rows = {} if fit is None else {index: row for row, index in enumerate(fit.joints)}
    advice = []
    for index, joint in enumerate(layout.solvable):
        if fit is not None and index in rows:
            advice.append(_advice(fit, rows[index], fit.joints[index], layout))
        elif not (layout.segments[joint.parent_receiver].optional or layout.segments[joint.child].optional):
            advice.append(Advice(joint.name, None, None, None, _unseen(joint)))
    return advice


def _advice(fit: HandFit, row: int, evidence: JointEvidence, layout: Layout) -> Advice:
    name = evidence.joint.name
    wanted_deg = WANTED_DEG.get(name) or WANTED_DEG.get(name.rsplit("_", 1)[-1], WANTED_ELSEWHERE_DEG)
    moved_deg = evidence.motion.range_deg
    now_mm = centre_sd_mm(fit.covariance(row, fit.posterior))
    if moved_deg >= wanted_deg:
        return Advice(name, moved_deg, now_mm, now_mm, "enough")
    information = list(fit.information)
    information[row] = _if_it_moved(fit, row, evidence, np.radians(wanted_deg), layout)
    moved_mm = min(now_mm, centre_sd_mm(fit.covariance(row, hand_posterior(fit.prior, information))))
    if now_mm - moved_mm < SMALL_GAIN_MM:
        return Advice(name, moved_deg, now_mm, moved_mm, "enough: more motion would gain little")
    return Advice(name, moved_deg, now_mm, moved_mm, _sentence(name, moved_deg, wanted_deg))


def _if_it_moved(
    fit: HandFit, row: int, evidence: JointEvidence, range_rad: float, layout: Layout
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


def _sentence(joint: str, moved_deg: float, wanted_deg: float) -> str:
    digit, _, kind = joint.rpartition("_")
    if kind not in JOINT_NAMES:
        return f"{joint} moved {moved_deg:.0f} deg; move it alone through {wanted_deg:.0f} deg"
    owner = "thumb's" if digit == "thumb" else f"{digit} finger's"
    return (
        f"{digit} {kind.upper()} moved {moved_deg:.0f} deg; "
        f"move the {owner} {JOINT_NAMES[kind]} alone through {wanted_deg:.0f} deg"
    )


def _unseen(joint: Joint) -> str:
    return (
        f"no frame in which {joint.parent_receiver} and {joint.child} are both valid; check these receivers"
    )
