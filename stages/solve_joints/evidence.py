"""One joint's frames as evidence: its motion, that of the skin about it, and what they say of its centre."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from shukotsu.anatomy import average_hand
from shukotsu.anatomy.skin import slide_covariance
from shukotsu.schemas.layout import Joint, Layout
from shukotsu.skeleton.angle_range import flattening
from shukotsu.skeleton.rotations import Array, matrix
from shukotsu.stages.solve_joints import skin_drift
from shukotsu.stages.solve_joints.degrees_of_freedom import (
    JointMotion,
    degrees_of_freedom,
    joint_motion,
    turns_from,
)
from shukotsu.stages.solve_joints.frame_weights import robust_scale, tukey
from shukotsu.stages.solve_joints.hand_posterior import Information, information
from shukotsu.stages.solve_joints.hand_prior import MeasuredAxis
from shukotsu.stages.solve_joints.joint_prior import JointPrior
from shukotsu.stages.solve_joints.posture_sample import SpreadFrames
from shukotsu.stages.solve_joints.skin_drift import Drift, drift

SMALLEST_SCATTER_MM = 0.3
FIRST_SCATTER_MM = 1.0
TOO_TURNED_RAD = 0.5
"""An axis less sure than this tells nothing about how a receiver is turned."""


@dataclass(frozen=True)
class Neighbour:
    """A joint that moves the same skin: its rotation vectors (N, 3) and its angle (N,) about its own axis."""

    turn_rad: Array
    angle_rad: Array


@dataclass
class JointEvidence:
    """One joint while its hand is being solved; N frames, angles in rad.

    weights : (N,) of mean 1; doubt : (N,) Tukey's factors on them. neighbours : the joints that move the
    parent's skin ("before") and the child's ("after") besides this one, as far as they were seen.
    scatter_mm : per component, about the last fit. remainder_mm2 : (6, 6) what the skin adds beyond that fit.
    """

    joint: Joint
    prior: JointPrior
    frames: SpreadFrames
    weights: Array
    motion: JointMotion
    dof: int
    doubt: Array
    neighbours: dict[str, Neighbour] = field(default_factory=dict)
    scatter_mm: float = FIRST_SCATTER_MM
    remainder_mm2: Array | None = None

    @cached_property
    def rotation(self) -> Array:
        """The frames' rotations (N, 3, 3), child to parent frame."""
        return matrix(self.frames.quaternion)

    @property
    def compound(self) -> bool:
        """Say whether a bone between the two receivers carries none and moves."""
        return bool(self.prior.sweep_mm.any())

    def measured_axis(self) -> MeasuredAxis | None:
        """The axis with its error from what the rotation off it and the neighbours' skin can do to it."""
        first, second, _ = self.motion.spread_rad
        neighbours = [float(joint.angle_rad.std()) for joint in self.neighbours.values()]
        if first < np.radians(1.0):
            return None
        wander = second / first / np.sqrt(10.0)  # independent samples of a recording, about
        tilt = average_hand.JOINTWISE_TILT_SD * np.array([max([0.0, *neighbours]) / first, 1.0])
        sd = float(np.sqrt(wander**2 + tilt @ tilt))
        if sd >= TOO_TURNED_RAD:
            return None
        return MeasuredAxis(self.motion.axis_parent, self.motion.axis_child, sd)


def joint_evidence(joint: Joint, prior: JointPrior, frames: SpreadFrames, lateral: Array) -> JointEvidence:
    """Start with a joint's frames, at least one; lateral : (3,) the child's, which orients the axis."""
    hint = lateral if prior.axis_child is None else prior.axis_child
    n_frames = len(frames.quaternion)
    first = joint_motion(frames.quaternion, np.ones(n_frames), hint)
    weights = flattening(first.angle_rad)
    motion = joint_motion(frames.quaternion, weights, hint)
    dof = degrees_of_freedom(motion.spread_rad, joint.dof)
    return JointEvidence(joint, prior, frames, weights, motion, dof, np.ones(n_frames))


def turn_of(other: JointEvidence, quaternion: Array) -> Array:
    """Return another joint's rotations, (N, 3) vectors as in JointMotion; none where it was not seen."""
    return np.nan_to_num(turns_from(other.motion.mean, quaternion))


def weigh(
    own: JointEvidence, centre_mm: Array, layout: Layout, looseness: float, n_effective: float
) -> Information:
    """Information on (p, q) from a joint's frames, re-weighted once against what fits none of them.

    centre_mm : (6,) (p, q) as expected, for the levers of the skin and as the point on a hinge's axis.
    looseness : of the hand's skin, 1 for a typical one. n_effective : what all the frames together count.
    """
    moving = skin_drift.stacked(_drifts(own, own.rotation, centre_mm, layout, looseness))
    centre = np.concatenate([np.broadcast_to(np.eye(3), own.rotation.shape), -own.rotation], -1)
    right = own.frames.position_mm
    if own.dof == 1:  # a hinge says nothing about where on its axis the centre is
        along = np.concatenate([own.motion.axis_parent, own.motion.axis_child]) / np.sqrt(2)
        open_part = np.outer(along, along)
        right = right - centre @ (open_part @ centre_mm)
        centre = centre @ (np.eye(6) - open_part)
    whiten = _whitening(own)
    unknowns = np.concatenate([centre, moving.columns], -1)
    design = np.tensordot(whiten, unknowns, (1, 1)).swapaxes(0, 1)
    tempered = own.weights * own.doubt * n_effective / own.weights.sum()
    likelihood = information(design, right @ whiten.T, tempered, moving.mean, moving.covariance)
    spread = robust_scale(likelihood.residual)
    own.doubt = tukey(likelihood.residual, spread)
    own.scatter_mm = max(SMALLEST_SCATTER_MM, own.scatter_mm * spread)
    return likelihood


def _whitening(own: JointEvidence) -> Array:
    """(3, 3) that makes a gap's components independent, of sd 1: scatter, and a palm that moves between."""
    covariance = own.scatter_mm**2 * np.eye(3) + np.outer(own.prior.sweep_mm, own.prior.sweep_mm) / 16
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))


def _drifts(
    own: JointEvidence, rotation: Array, centre_mm: Array, layout: Layout, looseness: float
) -> list[Drift]:
    """Everything that moves the joint's centre as its receivers see it; q moves in the child's frame."""
    parent = slide_covariance(own.joint.parent_receiver, layout, centre_mm[:3], looseness)
    child = slide_covariance(own.joint.child, layout, centre_mm[3:], looseness)
    own.remainder_mm2 = np.zeros((6, 6))
    own.remainder_mm2[:3, :3] = average_hand.SKIN_BENT**2 * parent
    own.remainder_mm2[3:, 3:] = average_hand.SKIN_BENT**2 * child
    angle = own.motion.angle_rad[:, None, None]
    in_parent, in_child = np.broadcast_to(np.eye(3), rotation.shape), -rotation
    sweep = np.outer(own.prior.sweep_mm, own.prior.sweep_mm) / np.pi**2  # half of it by 90 deg of the MCP
    drifts = [
        drift(angle * in_parent, parent + sweep),
        drift(angle * in_child, child, _under_reading(own, centre_mm[3:])),
    ]
    if own.joint.child == "thumb_metacarpal":
        skew = skin_drift.SKEW_SD_MM**2 * np.eye(3)
        drifts[0] = drift(angle * in_parent, parent + skew)
        drifts.append(drift(own.motion.second_angle_rad[:, None, None] * in_parent, skew))
    before, after = own.neighbours.get("before"), own.neighbours.get("after")
    if before is not None:
        drifts.append(drift(before.angle_rad[:, None, None] * in_parent, parent))
        if own.joint.parent_receiver == "thumb_metacarpal":
            axes = layout.segments["thumb_metacarpal"].axes
            drifts.append(_pivot(before.turn_rad, own.prior.p_mm, axes))
    if after is not None:
        drifts.append(drift(after.angle_rad[:, None, None] * in_child, child))
    return drifts


def _under_reading(own: JointEvidence, q_mm: Array) -> Array:
    """Mean slide (3,) per rad of a distal receiver that follows only part of its joint's flexion."""
    if not own.joint.child.endswith("_distal") or own.prior.axis_child is None:
        return np.zeros(3)
    return np.asarray(average_hand.DISTAL_TILT * np.cross(own.motion.axis_child, q_mm))


def _pivot(turn: Array, p_mm: Array, axes: Array) -> Drift:
    """The thumb's MCP joint, seen from a receiver that turns less than its metacarpal about the CMC joint."""
    distal = axes[:, 0]
    lever = 2.0 * (p_mm @ distal) * distal  # the receiver sits at mid-bone
    return Drift(
        np.cross(turn, lever)[:, :, None],
        np.array([-average_hand.UNDER_READING]),
        np.array([[average_hand.UNDER_READING_SD**2]]),
    )


def looseness_of(hand: Mapping[int, JointEvidence], typical_mm: float, limits: tuple[float, float]) -> float:
    """Estimate how loose a hand's skin is, from the scatter of its joints but those with a palm between."""
    scatter = [joint.scatter_mm for joint in hand.values() if not joint.compound]
    return float(np.clip(np.median(scatter) / typical_mm, *limits)) if scatter else 1.0
