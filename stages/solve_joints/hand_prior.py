"""Model where receivers sit on bones, and what that makes of the centres of a whole hand before it moved.

A receiver is stuck somewhere near mid-bone and a little turned. Both of its bone's joints share that error,
so it is an unknown of the receiver; the axes that were measured in its frame tell part of how it is turned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.anatomy import average_hand
from shukotsu.schemas.layout import Joint, Layout
from shukotsu.skeleton.rotations import Array, cross_matrix
from shukotsu.stages.solve_joints.hand_posterior import HandPrior
from shukotsu.stages.solve_joints.joint_prior import JointPrior

UNKNOWN_SD_MM = 500.0
"""Of a centre in a receiver's frame where anatomy says nothing of it."""


@dataclass(frozen=True)
class MeasuredAxis:
    """A joint's axis as the data have it: (3,) unit in either frame, and its error in rad."""

    parent: Array
    child: Array
    sd_rad: float


def hand_prior(
    joints: Sequence[Joint],
    priors: Sequence[JointPrior],
    axes: Sequence[MeasuredAxis | None],
    layout: Layout,
    hand_length_mm: float | None,
) -> HandPrior:
    """Give the prior of all the joints' centres; axes : as measured, None where the motion is too small."""
    fixed = np.concatenate([np.concatenate([prior.p_fixed_mm, prior.q_fixed_mm]) for prior in priors])
    growing = np.concatenate([np.concatenate([prior.p_mm, prior.q_mm]) for prior in priors])
    loadings = []
    for segment in dict.fromkeys(name for joint in joints for name in (joint.parent_receiver, joint.child)):
        rows = _halves(segment, joints, priors)
        turn, covariance = _mount_rotation(segment, joints, priors, axes)
        place = fixed + growing
        spread = np.linalg.cholesky(covariance)
        loads = np.zeros((len(fixed), 7))
        for own in rows:
            loads[own, :3] = cross_matrix(place[own]) @ spread
            fixed[own] -= np.cross(turn, place[own])
            loads[own, 3:6] = layout.segments[segment].axes * _place_sd_mm(segment, layout)
            if not _is_hand(segment, layout):
                loads[own, 6] = average_hand.JOINTWISE_LENGTH_SD * _along(place[own], layout, segment)
        loadings.append(loads)
    loadings += [_own_loadings(joints, priors, layout)]
    scale = 1.0 if hand_length_mm is None else hand_length_mm / average_hand.AVERAGE_LENGTH_MM
    scale_sd = average_hand.SCALE_SD if hand_length_mm is None else average_hand.SCALE_SD_BY_LENGTH * scale
    return HandPrior(fixed, growing, np.concatenate(loadings, 1), scale, scale_sd)


def _halves(segment: str, joints: Sequence[Joint], priors: Sequence[JointPrior]) -> list[slice]:
    """Rows of the halves of centres that anatomy knows in the segment's frame."""
    rows = []
    for i, (joint, prior) in enumerate(zip(joints, priors, strict=True)):
        if joint.parent_receiver == segment and prior.knows_parent:
            rows.append(slice(6 * i, 6 * i + 3))
        if joint.child == segment and prior.knows_child:
            rows.append(slice(6 * i + 3, 6 * i + 6))
    return rows


def _mount_rotation(
    segment: str,
    joints: Sequence[Joint],
    priors: Sequence[JointPrior],
    axes: Sequence[MeasuredAxis | None],
) -> tuple[Array, Array]:
    """Estimate the receiver's rotation on its bone, (3,) rad in its own frame, and the covariance (3, 3).

    A receiver turned by r sees a direction v of the bone as v - r x v, also the bone's own axes.
    """
    normal, vector = np.eye(3) / average_hand.MOUNT_TURN_SD_RAD**2, np.zeros(3)
    for joint, prior, axis in zip(joints, priors, axes, strict=True):
        if axis is None:
            continue
        seen, expected = (
            (axis.child, prior.axis_child) if joint.child == segment else (axis.parent, prior.axis_parent)
        )
        if segment in (joint.child, joint.parent_receiver) and expected is not None:
            design = cross_matrix(expected)
            variance = average_hand.AXIS_SD_RAD**2 + axis.sd_rad**2
            normal += design.T @ design / variance
            vector += design.T @ (seen - expected) / variance
    covariance = np.linalg.inv(normal)
    return np.asarray(covariance @ vector), np.asarray(covariance, float)


def _is_hand(segment: str, layout: Layout) -> bool:
    return layout.wrist is not None and segment == layout.wrist.segment


def _place_sd_mm(segment: str, layout: Layout) -> Array:
    return np.array(average_hand.HAND_MOUNT_SD_MM if _is_hand(segment, layout) else average_hand.MOUNT_SD_MM)


def _along(place_mm: Array, layout: Layout, segment: str) -> Array:
    """The part (3,) of a place in the receiver's frame that lies along the bone."""
    distal = np.array(layout.segments[segment].distal)
    return np.asarray((place_mm @ distal) * distal)


def _own_loadings(joints: Sequence[Joint], priors: Sequence[JointPrior], layout: Layout) -> Array:
    """Return each half of a centre's own loadings: its place on the hand, or that nothing is known."""
    sd = np.zeros(6 * len(joints))
    for i, (joint, prior) in enumerate(zip(joints, priors, strict=True)):
        if not prior.knows_parent:
            sd[6 * i : 6 * i + 3] = UNKNOWN_SD_MM
        elif _is_hand(joint.parent_receiver, layout):
            sd[6 * i : 6 * i + 3] = average_hand.JOINTWISE_BASE_SD_MM
        if not prior.knows_child:
            sd[6 * i + 3 : 6 * i + 6] = UNKNOWN_SD_MM
    return np.diag(sd)
