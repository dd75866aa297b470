"""Any recording posed with a fitted hand: joint angles, every bone, every fingertip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array, from_matrix
from schemas.poses import Poses
from stages.fit_hand.building import bone, receiver
from stages.fit_hand.fit import HandFit
from stages.fit_hand.normal_equations import Frames, Point, Problem, residuals
from stages.fit_hand.posing import first_guess, pose

CHUNK_FRAMES = 512
LEAST_RECEIVERS = 2
_UNSEEN = 1e9
"""Sd in units of a receiver's own, of what is to count for nothing."""


@dataclass(frozen=True)
class PosedHand:
    """A recording as the fitted hand did it, T frames; NaN in frames that could not be posed.

    angle_names : (joint, kind) of the columns of angles_rad (T, A). bones : B names; bone_position_mm
    (T, B, 3) proximal joint's centre, bone_quaternion (T, B, 4) bone (x distal, z dorsal) to transmitter.
    receivers : S names; receiver_mm (T, S, 3) where the hand says that each receiver's origin is, which for
    a distal one is the fingertip. posed : (T,) bool. residual_mm : (T,) rms over the receivers.
    """

    angle_names: tuple[tuple[str, str], ...]
    angles_rad: Array
    bones: tuple[str, ...]
    bone_position_mm: Array
    bone_quaternion: Array
    receivers: tuple[str, ...]
    receiver_mm: Array
    residual_mm: Array
    posed: npt.NDArray[np.bool_]


def pose_hand(
    fit: HandFit, poses: Poses, weights: Mapping[str, tuple[float, float]] | None = None
) -> PosedHand:
    """Fit the joint angles of every frame over all receivers that are valid in it.

    weights : of a receiver's position and rotation, 1 where not given, 0 to leave one out: a tip predicted
    without the distal receiver's position has (0, 1) for it.
    """
    frames = fit.evidence.convention.frames(poses)
    problem = replace(fit.evidence.problem, sd=_weighted(fit, weights or {}))
    parts = [
        _pose_chunk(fit, problem, frames.take(slice(start, start + CHUNK_FRAMES)))
        for start in range(0, max(len(frames.valid), 1), CHUNK_FRAMES)
    ]
    angles, position, quaternion, origins, rms = (
        np.concatenate(arrays) for arrays in zip(*parts, strict=True)
    )
    posed = frames.valid.sum(1) >= LEAST_RECEIVERS
    for array in (angles, position, quaternion, origins, rms):
        array[~posed] = np.nan
    return PosedHand(
        tuple(fit.evidence.model.states.names),
        angles,
        _bones(fit),
        position,
        quaternion,
        fit.evidence.model.receivers,
        origins,
        rms,
        posed,
    )


def _bones(fit: HandFit) -> tuple[str, ...]:
    return tuple(fit.evidence.model.length)


def _weighted(fit: HandFit, weights: Mapping[str, tuple[float, float]]) -> Array:
    sd = fit.evidence.problem.sd.copy()
    for name, both in weights.items():
        for kind, weight in enumerate(both):
            sd[fit.evidence.model.receivers.index(name), kind] *= weight**-0.5 if weight > 0 else _UNSEEN
    return sd


def _pose_chunk(fit: HandFit, problem: Problem, frames: Frames) -> tuple[Array, Array, Array, Array, Array]:
    """Angles, bones' positions and quaternions, receivers' origins, and rms residual, of some frames."""
    problem = replace(problem, frames=frames)
    point = pose(problem, first_guess(problem, fit.evidence.model, fit.evidence.posterior.x))
    found = residuals(problem, point)
    marks = {
        name: (reached.rotation[mark], reached.position_mm[mark])
        for branch, (_, _, reached) in zip(problem.branches, found.branches, strict=True)
        for mark, name in enumerate(branch.marks)
    }
    n_frames = len(frames.valid)
    bones = [fit.evidence.convention.world(*marks[bone(name)]) for name in _bones(fit)]
    rotation = np.stack([R for R, _ in bones], 1) if bones else np.empty((n_frames, 0, 3, 3))
    position = np.stack([t for _, t in bones], 1) if bones else np.empty((n_frames, 0, 3))
    origins = np.stack(
        [fit.evidence.convention.world(*marks[receiver(name)])[1] for name in fit.evidence.model.receivers], 1
    )
    return point.y, position, from_matrix(rotation), origins, _rms_mm(problem, point)


def _rms_mm(problem: Problem, point: Point) -> Array:
    """Root mean square distance, (F,), of predicted to measured receivers that are valid."""
    total, count = np.zeros(len(point.y)), np.zeros(len(point.y))
    for receivers, (r, _, _) in zip(problem.receivers, residuals(problem, point).branches, strict=True):
        for i, (_, s) in enumerate(receivers):
            if problem.sd[s, 0] < _UNSEEN / 1e3:
                total += (r[i, :, :3] ** 2).sum(-1) * problem.sd[s, 0] ** 2
                count += problem.frames.valid[:, s]
    return np.asarray(np.sqrt(total / np.maximum(count, 1)))
