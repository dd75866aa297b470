"""Pose a fitted hand in the frames of any recording: joint angles, bones and receivers.

On paper: docs/whole-hand.md, section 11.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Integers
from shukotsu.fit.chain_builder import bone, receiver
from shukotsu.fit.compiled_equations import pose, residuals
from shukotsu.fit.fit import HandFit
from shukotsu.fit.gauss_newton import first_guess
from shukotsu.fit.normal_equations import Frames, Point, Problem
from shukotsu.fit.operations import Index
from shukotsu.hand.joint_angles import joint_angles
from shukotsu.hand.known_digits import root_of
from shukotsu.hand.rotations import Array, continuous, from_matrix, matrix, unit
from shukotsu.tables.poses import Poses

CHUNK_FRAMES = 768
KEY_STEP, KEY_STEPS = 6, 2
"""Distance of the frames that are posed from the receivers' rotations, and their steps; others start between
them."""
LEAST_RECEIVERS = 2
"""Least number of valid receivers for a frame to be posed."""
_UNSEEN = 1e9
"""Factor on a receiver's sd that removes its measurement from the fit."""


@dataclass(frozen=True)
class PosedHand:
    """A recording of T frames posed with the fitted hand; NaN in frames that could not be posed.

    Attributes
    ----------
    angle_names : tuple of (joint, kind)
        Columns of `angles_rad`.
    angles_rad : array, shape (T, A)
        Joint angles.
    bones : tuple of str
        B bones, the base bone (the hand, with its origin at the wrist centre) first.
    bone_position_mm : array, shape (T, B, 3)
        Proximal joint centres in the transmitter frame.
    bone_quaternion : array, shape (T, B, 4)
        Bone to transmitter frame; bones have x distal and z dorsal.
    receivers : tuple of str
        S receivers.
    receiver_mm : array, shape (T, S, 3)
        Receiver origins as the posed hand predicts them, transmitter frame.
    residual_mm : array, shape (T,)
        Root mean square position residual over the receivers.
    posed : array of bool, shape (T,)
        Whether a frame could be posed.

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


def joint_angles_of(fit: HandFit, posed: PosedHand, more_rad: float = 0.0) -> dict[str, Array]:
    """Compute the joint angles of a posed hand about the fitted axes.

    Parameters
    ----------
    fit : HandFit
        The hand.
    posed : PosedHand
        Its bones over T frames.
    more_rad : float
        Angle by which the joints' axes are turned further about their bones.

    Returns
    -------
    dict of str to array, shape (T, 3)
        By joint of known anatomy: flexion, deviation and axial rotation, degrees (`hand.joint_angles`).

    """
    bone_of = dict(zip(posed.bones, np.moveaxis(posed.bone_quaternion, 1, 0), strict=True))
    return {
        joint: joint_angles(
            bone_of[axes.parent], bone_of[axes.child], fit.side, *axes.of_hand(fit.side, more_rad)
        )
        for joint, axes in fit.summary.angle_axes.items()
    }


def pose_hand(fit: HandFit, poses: Poses, blind: Sequence[str] = ()) -> PosedHand:
    """Pose a fitted hand in every frame of a recording, using all valid receivers of the frame together.

    Parameters
    ----------
    fit : HandFit
        The hand, which is kept fixed.
    poses : Poses
        T frames of the receivers, transmitter frame.
    blind : sequence of str
        Receivers whose positions are not used, so that they are predicted from all other data.

    Returns
    -------
    PosedHand
        Joint angles, bones and receivers' origins in every frame; NaN in frames with too few receivers.

    """
    frames = fit.convention.frames(poses)
    sd = fit.problem.sd.copy()
    sd[[fit.model.receivers.index(name) for name in blind], 0] *= _UNSEEN
    problem = replace(fit.problem, sd=sd, state_sd=np.array(fit.model.states.sd))
    chunks = [
        slice(start, start + CHUNK_FRAMES) for start in range(0, max(len(frames.valid), 1), CHUNK_FRAMES)
    ]
    parts = [_pose_chunk(fit, problem, frames.take(chunk), poses.frame[chunk]) for chunk in chunks]
    angles, position, quaternion, origins, rms = (
        np.concatenate(arrays) for arrays in zip(*parts, strict=True)
    )
    posed = frames.valid.sum(1) >= LEAST_RECEIVERS
    for array in (angles, position, quaternion, origins, rms):
        array[~posed] = np.nan
    return PosedHand(
        tuple(fit.model.states.names),
        angles,
        (root_of(fit.layout), *fit.model.length),
        position,
        quaternion,
        fit.model.receivers,
        origins,
        rms,
        posed,
    )


def _key_frames(valid: npt.NDArray[np.bool_], number: Integers) -> Index:
    """Return the frames that are posed before the others: every KEY_STEP-th one, and all between two of these
    if frames are missing or the set of valid receivers changes there.

    valid, number : (T, S) and (T,), validity of receivers and numbers of the frames.
    """
    at = np.arange(len(number))
    changes = np.flatnonzero((valid[1:] != valid[:-1]).any(1) | (np.diff(number) != 1))
    own = (at % KEY_STEP == 0) | (at == len(at) - 1) | np.isin(at // KEY_STEP, changes // KEY_STEP)
    return np.flatnonzero(own)


def _between(keys: Point, rows: Index, n_frames: int) -> Point:
    """Interpolate states and roots of all frames linearly between those of some rows (K,)."""
    at = np.arange(n_frames)
    before = np.clip(np.searchsorted(rows, at, "right") - 1, 0, max(0, len(rows) - 2))
    after = np.minimum(before + 1, len(rows) - 1)
    share = ((at - rows[before]) / np.maximum(rows[after] - rows[before], 1))[:, None]
    turns = continuous(from_matrix(keys.root)[:, None])[:, 0]
    y, root, root_mm = (
        (1.0 - share) * values[before] + share * values[after] for values in (keys.y, turns, keys.root_mm)
    )
    return Point(keys.x, y, matrix(unit(root)), root_mm)


def _pose_chunk(
    fit: HandFit, problem: Problem, frames: Frames, number: Integers
) -> tuple[Array, Array, Array, Array, Array]:
    """Return angles, bones' positions and quaternions, receivers' origins and rms residual of some frames."""
    rows, x = _key_frames(frames.valid, number), fit.posterior.x
    guess = first_guess(replace(problem, frames=frames.take(rows)), fit.model, x)
    # the field's turn does not change while poses are fitted, so that it is undone once
    problem = replace(problem, frames=frames)
    problem = replace(problem, frames=replace(frames, rotation=problem.rotation(x)), field=None)
    keys = pose(replace(problem, frames=problem.frames.take(rows)), guess, KEY_STEPS)
    point = pose(problem, _between(keys, rows, len(number)))
    current = residuals(problem, point)
    marks = {
        name: (reached.rotation[mark], reached.position_mm[mark])
        for branch, (_, _, reached) in zip(problem.branches, current.branches, strict=True)
        for mark, name in enumerate(branch.marks)
    }
    places = [(point.root, point.root_mm), *(marks[bone(name)] for name in fit.model.length)]
    bones = [fit.convention.world(*pose_there) for pose_there in places]
    rotation, position = (np.stack(parts, 1) for parts in zip(*bones, strict=True))
    origins = np.stack([fit.convention.world(*marks[receiver(name)])[1] for name in fit.model.receivers], 1)
    total, count = np.zeros(len(current.frame_cost)), np.zeros(len(current.frame_cost))
    for s, r in problem.residuals_of(current):
        if problem.sd[s, 0] < _UNSEEN / 1e3:
            total += (r[:, :3] ** 2).sum(-1) * problem.sd[s, 0] ** 2
            count += problem.frames.valid[:, s]
    rms_mm = np.sqrt(total / np.maximum(count, 1))
    return point.y, position, from_matrix(rotation), origins, rms_mm
