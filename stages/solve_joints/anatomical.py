"""The solver `anatomical`: joint centres from a hand's frames and an anatomical prior.

Each joint's frames are a sample spread over its postures; dwelling gains nothing and no posture is
trimmed. Skin that moves with the joints is among the unknowns. All joints of a hand share one prior, since a
receiver's place on its bone concerns both of the bone's joints, and the hand's size all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.schemas.layout import Joint, Layout
from shukotsu.schemas.verdict import BY_ANATOMY, LITTLE_RANGE_DEG, Values
from shukotsu.skeleton.rotations import Array, matrix
from shukotsu.skeleton.thumb_facing import faces_nail
from shukotsu.stages.solve_joints.closed import JointSolution, is_solvable, normal_equations, solve_closed
from shukotsu.stages.solve_joints.evidence import (
    JointEvidence,
    Neighbour,
    joint_evidence,
    looseness_of,
    turn_of,
    weigh,
)
from shukotsu.stages.solve_joints.hand_posterior import HandPosterior, HandPrior, Information, hand_posterior
from shukotsu.stages.solve_joints.hand_prior import hand_prior
from shukotsu.stages.solve_joints.joint_prior import average_bones, joint_prior
from shukotsu.stages.solve_joints.moments import JointMoments, RelativePoses
from shukotsu.stages.solve_joints.posture_sample import SpreadFrames, SpreadSample

ROUNDS = 3
"""Robust re-weightings; the weights hardly change after the second."""

MAX_EFFECTIVE = 8.0
"""Independent samples that any recording is taken for: skin repeats its errors with every repetition."""

TYPICAL_SCATTER_MM = 0.45
"""Per component, about a fit with skin, on a hand of typical looseness."""

LOOSENESS = (0.6, 3.0)
"""Least and largest looseness that a hand's scatter is believed to show."""

ENOUGH_FRAMES = 200
"""With as many others, frames whose posture was met only once are left out."""

MOSTLY = 0.5
"""Share of the prior's variance across the axis from which a centre is called the prior's."""

UNKNOWN_MM2 = 100.0**2
"""Prior variance above which anatomy expects nothing of a centre, and the last fit stands in for it."""


class HandSample:
    """Frames of every joint of a hand, spread over the postures; of fixed size however long the recording."""

    def __init__(self, joints: Sequence[Joint]) -> None:
        self.joints = tuple(joints)
        parents = [joint.parent_receiver for joint in joints]
        children = [joint.child for joint in joints]
        self.before = tuple(_only(parent, children) for parent in parents)
        self.after = tuple(_only(child, parents) for child in children)
        self._samples = [SpreadSample(len(self.others(i))) for i in range(len(joints))]

    def others(self, joint: int) -> tuple[int, ...]:
        """Give the joints that move the same skin: before the parent's bone and after the child's."""
        return tuple(i for i in (self.before[joint], self.after[joint]) if i is not None)

    def add(self, poses: RelativePoses) -> None:
        """Add a block of frames, in the order of time."""
        for joint, sample in enumerate(self._samples):
            sample.add(poses, joint, self.others(joint))

    def frames(self, joint: int) -> SpreadFrames:
        """Give a joint's frames, without lone ones where there are enough others."""
        frames = self._samples[joint].frames()
        kept = ~frames.lone
        return frames if kept.sum() < ENOUGH_FRAMES else frames.take(kept)


def _only(segment: str, among: list[str]) -> int | None:
    """Find the segment among others, if it is there once: the joints of a palm do not move its skin."""
    return among.index(segment) if among.count(segment) == 1 else None


@dataclass(frozen=True)
class WeighedHand:
    """A hand's joints weighed against anatomy, by their place in the sample; only joints that have a frame.

    information : from each joint's frames; posterior : the centres, six rows a joint, in the same order.
    free : the fit of all six values to all frames without a prior; None of a joint that did not move.
    """

    joints: dict[int, JointEvidence]
    prior: HandPrior
    information: list[Information]
    posterior: HandPosterior
    looseness: float
    free: dict[int, JointSolution | None]

    def covariance(self, row: int, posterior: HandPosterior) -> Array:
        """Covariance (6, 6) of one joint's (p, q), with what skin adds that no frame shows."""
        remainder = list(self.joints.values())[row].remainder_mm2
        assert remainder is not None
        return np.asarray(posterior.covariance[6 * row : 6 * row + 6, 6 * row : 6 * row + 6] + remainder)


def weigh_hand(
    sample: HandSample, moments: JointMoments, layout: Layout, hand: str, hand_length_mm: float | None
) -> WeighedHand | None:
    """Weigh a hand's frames against anatomy; None where no joint has a frame.

    hand : right or left, whose anatomy to expect. hand_length_mm : wrist crease to the middle finger's tip,
    or None where nobody measured it.
    """
    joints = _evidence(sample, layout, hand)
    if not joints:
        return None
    free = {
        index: solve_closed(moments, index, 6) if is_solvable(moments, index) else None for index in joints
    }
    prior = hand_prior(
        [evidence.joint for evidence in joints.values()],
        [evidence.prior for evidence in joints.values()],
        [evidence.measured_axis() for evidence in joints.values()],
        layout,
        hand_length_mm,
    )
    own = [prior.block(row) for row in range(len(joints))]
    centres = [mean for mean, _ in own]
    looseness = 1.0
    for _ in range(ROUNDS):
        information = [
            weigh(joint, centre, layout, looseness, min(_n_effective(free[index]), MAX_EFFECTIVE))
            for (index, joint), centre in zip(joints.items(), centres, strict=True)
        ]
        posterior = hand_posterior(prior, information)
        looseness = looseness_of(joints, TYPICAL_SCATTER_MM, LOOSENESS)
        centres = [
            np.where(np.diag(covariance) < UNKNOWN_MM2, mean, posterior.mean[6 * row : 6 * row + 6])
            for row, (mean, covariance) in enumerate(own)
        ]
    return WeighedHand(joints, prior, information, posterior, looseness, free)


def _n_effective(free: JointSolution | None) -> float:
    return 1.0 if free is None else free.n_effective


def solve_hand(
    sample: HandSample, moments: JointMoments, layout: Layout, hand: str, hand_length_mm: float | None
) -> dict[str, JointSolution]:
    """Solve all joints that have a frame, as `weigh_hand`; the others are left out."""
    return solutions(weigh_hand(sample, moments, layout, hand, hand_length_mm), moments)


def solutions(fit: WeighedHand | None, moments: JointMoments) -> dict[str, JointSolution]:
    """Give a fitted hand's joints in the terms of the closed form."""
    if fit is None:
        return {}
    return {
        evidence.joint.name: _solution(fit, row, moments) for row, evidence in enumerate(fit.joints.values())
    }


def _evidence(sample: HandSample, layout: Layout, hand: str) -> dict[int, JointEvidence]:
    """Joints that have a frame, by their place in the sample."""
    bones = average_bones(hand, thumb_faces_nail=_thumb_faces_nail(sample, layout, hand))
    joints = {}
    for index, joint in enumerate(sample.joints):
        frames = sample.frames(index)
        if len(frames.quaternion):
            lateral = np.array(layout.segments[joint.child].lateral)
            joints[index] = joint_evidence(joint, joint_prior(joint, layout, bones), frames, lateral)
    for index, evidence in joints.items():
        others = sample.others(index)
        for name, other in (("before", sample.before[index]), ("after", sample.after[index])):
            if other is not None and other in joints:
                turn = turn_of(joints[other], evidence.frames.other[:, others.index(other)])
                evidence.neighbours[name] = Neighbour(turn, turn @ joints[other].motion.axis_child)
    return joints


def _thumb_faces_nail(sample: HandSample, layout: Layout, hand: str) -> bool:
    """Say whether the receiver over the thumb's metacarpal faces its nail; no where none shows it."""
    ends = "thumb_metacarpal", "thumb_proximal"
    for index, joint in enumerate(sample.joints):
        if (joint.parent_receiver, joint.child) == ends:
            above, below = (layout.segments[segment].axes for segment in ends)
            relative = above.T @ matrix(sample.frames(index).quaternion) @ below
            either = [average_bones(hand, thumb_faces_nail=nail) for nail in (True, False)]
            return faces_nail(relative, *(bones[ends[0]].frame.T @ bones[ends[1]].frame for bones in either))
    return False


def _solution(fit: WeighedHand, row: int, moments: JointMoments) -> JointSolution:
    """The joint in the terms of the closed form; what only its best fit can say is that of the free fit."""
    index, evidence = list(fit.joints.items())[row]
    free, motion, normal = fit.free[index], evidence.motion, normal_equations(moments, index)
    p_mm, q_mm = fit.posterior.mean[6 * row : 6 * row + 6].reshape(2, 3)
    gap = normal.gap_rms_mm(normal.R0.T @ p_mm, q_mm)
    mean_rotation = normal.R0 @ normal.M
    s = np.clip(np.linalg.svd(mean_rotation, compute_uv=False), 0.0, 1.0)
    covariance = fit.covariance(row, fit.posterior)
    return JointSolution(
        p_mm=p_mm,
        q_mm=q_mm,
        null_parent=motion.axis_parent,
        null_child=motion.axis_child,
        mean_rotation=mean_rotation,
        singular_values=np.sqrt(np.concatenate([1.0 + s, 1.0 - s[::-1]])),
        covariance_mm2=covariance,
        gap_rms_mm=gap,
        gap_rms_free_mm=gap if free is None else free.gap_rms_mm,
        slide_to_free_mm=0.0,
        range_deg=motion.range_deg,
        spread_deg=float(np.degrees(np.sqrt(np.average(motion.angle_rad**2, weights=evidence.weights)))),
        axis_sd_deg=90.0 if free is None else free.axis_sd_deg,
        n_frames=int(moments.count[index]),
        n_effective=_n_effective(free),
        doubts=_doubts(evidence, _prior_share(fit, row)),
    )


def _prior_share(fit: WeighedHand, row: int) -> float:
    """Share of the prior's variance across a joint's axis that the data leave."""
    axis = list(fit.joints.values())[row].motion.axis_child
    rows, across = slice(6 * row, 6 * row + 6), np.eye(3) - np.outer(axis, axis)
    after, before = (
        np.trace(across @ covariance[3:, 3:] @ across)
        for covariance in (fit.posterior.covariance[rows, rows], fit.prior.block(row)[1])
    )
    return float(after / before)


def _doubts(evidence: JointEvidence, prior_share: float) -> dict[str, Values]:
    """Say that anatomy says more about a centre than its frames, where that is so."""
    known = evidence.prior.knows_parent and evidence.prior.knows_child
    moved_deg = evidence.motion.range_deg
    if known and (moved_deg < LITTLE_RANGE_DEG or prior_share > MOSTLY):
        return {BY_ANATOMY: {"range_deg": moved_deg, "share_percent": 100.0 * min(prior_share, 1.0)}}
    return {}


def centre_sd_mm(covariance_mm2: Array) -> float:
    """1-sigma, three-dimensional error of a centre from the covariance (6, 6) of (p, q): the worse half's."""
    variance = np.diag(covariance_mm2)
    return float(np.sqrt(max(variance[:3].sum(), variance[3:].sum())))
