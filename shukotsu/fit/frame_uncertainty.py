"""Errors of a posed hand in each frame, from the receivers valid in it and the uncertainty of the fit.

Given the hand's unknowns, a frame's joint angles and the pose of its base bone are normally distributed about
their posed values, with a covariance that follows from the receivers valid in that frame and the angles'
priors. They also vary with the unknowns, whose covariance the fit states. Both together are a linear map of
independent standard normal numbers, from which the error of any posed centre, angle or tip follows.

The map changes slowly with posture but abruptly with the set of valid receivers. It is therefore computed for
a few postures of every set, and the errors of each frame are interpolated between the two nearest.

On paper: docs/whole-hand.md, sections 8 and 11.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shukotsu.fit.chain_builder import KINDS, bone
from shukotsu.fit.compiled_equations import reach, reduce
from shukotsu.fit.fingertips import Fingertips
from shukotsu.fit.fitted_motion import PosedHand, joint_angles_of
from shukotsu.fit.normal_equations import Frames, Point
from shukotsu.fit.operations import Branch, Index
from shukotsu.fit.posterior_summary import unmodelled_mm2, unshown_mm2
from shukotsu.fit.receiver_frames import spread_frames
from shukotsu.fit.touches import SKIN_SD_MM
from shukotsu.hand.average_hand import PRIOR
from shukotsu.hand.joint_angles import joint_angles
from shukotsu.hand.known_digits import known_digits
from shukotsu.hand.rotations import Array, about_axis, cross, matrix, multiply
from shukotsu.hand.sampled_motion import MIRROR
from shukotsu.study.layout import Digit

POSTURES = 64
"""Number of postures in a block of frames for which the map is computed; each set of valid receivers has at
least one."""

_MOST_AT_ONCE = 32
"""Number of postures whose maps are in memory together; they take 15 MB."""

_NUDGE_RAD = 1e-5

_SAME_POSTURE = 1e-12
"""Sum of squared distances, rad^2, below which two postures are the same."""

NEUTRAL_SD_DEG = np.array([1.5, 1.5, 0.0])
"""Sd of the zero of flexion, abduction and rotation of a CMC or MCP joint, which is defined by the
orientation of metacarpals in the flat hand: published hands (CT, X-ray, Buchholz 1992, MyoHand) differ in it
by 1.6 and 1.5 deg (1 sigma). This error is the same in all frames and all people. The zero of other joints is
the straight digit, which the fit knows as well as it knows the bones; no joint has axial rotation at zero."""

PUT_ON = (
    *("mount", "mount across", "mount turn", "facing"),
    *("mount habit", "mount across habit", "mount turn habit"),
)
"""Groups of unknowns that change when the receivers are put on again."""

_NEW_SHARE = 0.5
"""Share of the uncertainty from residuals that is independent between sessions (our choice): noise and
drift of skin. The rest is how skin follows the posture, which is the same in each session."""


@dataclass(frozen=True)
class _Spread:
    """Errors of F posed frames as linear maps of N standard normal numbers, always for a right hand.

    Attributes
    ----------
    shift_mm, turn_rad : array, shape (F, B, 3, N)
        Errors of each bone's proximal joint, and of its rotation.
    states_rad : array, shape (F, S, N)
        Errors of the joint angles.
    unknowns : array, shape (G + 6 D, N)
        Errors of the hand's unknowns and the soft parts' offsets.

    """

    shift_mm: Array
    turn_rad: Array
    states_rad: Array
    unknowns: Array


@dataclass(frozen=True)
class PosedErrors:
    """1-sigma errors of posed frames; NaN for frames that were not posed.

    Attributes
    ----------
    centre_mm, turn_deg : array, shape (F, B)
        Error in 3-D of position and rotation of the bones of `PosedHand`.
    angles_deg : mapping of str to array, shape (F, 3)
        By joint: error of flexion, abduction and rotation; NaN for an axis that the joint lacks.
    tips_mm : array, shape (F, D, 2)
        Error in 3-D of the ends of bone and skin of digits with known anatomy.
    by_hand_deg : mapping of str to array, shape (F, 3, H)
        By joint: errors of angles due to the hand's unknowns, as maps of H standard normal numbers.
    changes_deg : mapping of str to array, shape (F, 3)
        By joint: error of an angle's change from the reference, without errors that are common to both.
    reference_deg : mapping of str to array, shape (3, H)
        By joint: errors of the reference angles due to the hand's unknowns, as maps.
    session_deg, session_changes_deg : mapping of str to array, shape (F, 3)
        By joint: the part of `by_hand_deg`, and of its change from the reference, that is independent between
        sessions, in which the same hand wears the receivers anew.

    """

    centre_mm: Array
    turn_deg: Array
    angles_deg: Mapping[str, Array]
    tips_mm: Array
    by_hand_deg: Mapping[str, Array] = field(default_factory=dict)
    changes_deg: Mapping[str, Array] = field(default_factory=dict)
    reference_deg: Mapping[str, Array] = field(default_factory=dict)
    session_deg: Mapping[str, Array] = field(default_factory=dict)
    session_changes_deg: Mapping[str, Array] = field(default_factory=dict)


def posed_errors(
    tips: Fingertips, posed: PosedHand, frames: Frames, reference_deg: Mapping[str, Array] | None = None
) -> PosedErrors:
    """Compute the 1-sigma errors of posed frames (docs/whole-hand.md, section 8).

    Parameters
    ----------
    tips : Fingertips
        The hand, with the covariance of its unknowns and soft parts.
    posed : PosedHand
        F frames as posed by `pose_hand`.
    frames : Frames
        The receivers' poses from which they were posed.
    reference_deg : mapping of str to array, shape (3, H), optional
        Maps of the angles to which changes refer (`PosedErrors`); by default those of the mean frame.

    Returns
    -------
    PosedErrors
        Errors in mm and degrees; `by_hand_deg` is left empty.

    """
    chosen, nearest, second_share = _postures(posed, frames.valid)
    blocks = np.split(chosen, range(_MOST_AT_ONCE, len(chosen), _MOST_AT_ONCE))
    few = _join_errors(
        [_errors(Postures.of(tips, posed_frames(posed, rows)), frames.take(rows)) for rows in blocks]
    )
    if not reference_deg:
        share = np.bincount(nearest[0, posed.posed], minlength=len(chosen)) / max(1, posed.posed.sum())
        reference_deg = {
            joint: np.tensordot(share, by_hand_deg, 1) for joint, by_hand_deg in few.by_hand_deg.items()
        }
    neutral_deg = _neutral_sd_deg(tips)
    fit = tips.fit
    root_t = tips.root[: len(fit.posterior.x)].T
    put_on = np.isin(fit.model.unknowns.groups, PUT_ON)
    due_to_prior = fit.problem.precision * np.where(put_on, 1.0 - _NEW_SHARE, -_NEW_SHARE)
    changes_deg, session_deg, session_changes_deg = (dict[str, Array]() for _ in range(3))
    for joint, by_hand in few.by_hand_deg.items():
        # a change has the frame's error, and the hand's as far as it differs from the reference's
        of_frame = few.angles_deg[joint] ** 2 - neutral_deg[joint] ** 2 - (by_hand**2).sum(-1)
        change, by_prior = by_hand - reference_deg[joint], _times(by_hand, root_t)
        changes_deg[joint] = np.asarray(np.sqrt(np.maximum(of_frame, 0.0) + (change**2).sum(-1)))
        session_deg[joint] = _session_sd(by_hand, by_prior, due_to_prior)
        by_prior -= reference_deg[joint] @ root_t
        session_changes_deg[joint] = _session_sd(change, by_prior, due_to_prior)

    def of_all(values: Array) -> Array:
        out = np.full((len(posed.posed), *values.shape[1:]), np.nan)
        if len(values):
            share = second_share.reshape(-1, *[1] * (values.ndim - 1))
            out = (1.0 - share) * values[nearest[0]] + share * values[nearest[1]]
            out[~posed.posed] = np.nan
        return out

    def by_joint(values: Mapping[str, Array]) -> dict[str, Array]:
        return {joint: of_all(by_hand_deg) for joint, by_hand_deg in values.items()}

    return PosedErrors(
        of_all(few.centre_mm),
        of_all(few.turn_deg),
        by_joint(few.angles_deg),
        of_all(few.tips_mm),
        changes_deg=by_joint(changes_deg),
        reference_deg=reference_deg,
        session_deg=by_joint(session_deg),
        session_changes_deg=by_joint(session_changes_deg),
    )


def _neutral_sd_deg(tips: Fingertips) -> dict[str, Array]:
    """Return the sd (3,) of each joint's zero, deg; 0 for joints without anatomy, whose zero is arbitrary."""
    beside = {joint for digit in known_digits(tips.fit.layout) for joint in digit.joints[:2]}
    joints = tips.fit.layout.joints
    return {joint: NEUTRAL_SD_DEG if joint in beside else np.zeros(3) for joint in joints}


def _wander_deg(postures: Postures, joint: str) -> Array:
    """Compute the errors (F, 3), deg, of a palm joint that the fit models with a single constant axis.

    In fact its axis varies by some degrees as it turns, so that a share of the flexion away from the mean
    posture is abduction and rotation.
    """
    names, fit = postures.posed.angle_names, postures.tips.fit
    out = np.zeros((len(postures.posed.posed), 3))
    if (joint, KINDS[0]) in names and (joint, KINDS[1]) not in names:
        state = names.index((joint, KINDS[0]))
        change = postures.posed.angles_rad[:, state] - fit.posterior.mean_states[state]
        out[:, 1:] = np.abs(np.degrees(change) * np.sin(PRIOR.AXIS_SD_RAD))[:, None]
    return out


def _session_sd(maps: Array, by_prior: Array, due_to_prior: Array) -> Array:
    """Compute the sd of the part of errors that is independent between two sessions of one hand.

    The covariance C = R R^T of the unknowns has two parts: C L C, due to priors with precisions L, and the
    rest, due to residuals. Independent between sessions are the first part for unknowns that describe how
    receivers were put on, and a share of the second part. An error with the map b has the variance b b^T, of
    which b R^T L R b^T is due to priors.

    Parameters
    ----------
    maps : array, shape (..., H)
        Maps b of the errors, in the coordinates of the columns of R.
    by_prior : array, shape (..., G)
        The same maps times R^T.
    due_to_prior : array, shape (G,)
        Precisions L, weighted such that their part and the share of all variance add up to the result.

    Returns
    -------
    array, shape (...)
        Standard deviations, in the unit of the errors.

    """
    variance = _NEW_SHARE * (maps**2).sum(-1) + by_prior**2 @ due_to_prior
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _norms(maps: Array) -> Array:
    """Return the 1-sigma errors (...) of scalars whose maps are (..., N)."""
    return np.asarray(np.sqrt(np.einsum("...n,...n->...", maps, maps)))


def _join_errors(parts: Sequence[PosedErrors]) -> PosedErrors:
    """Concatenate the errors of several blocks of frames."""
    return PosedErrors(
        np.concatenate([part.centre_mm for part in parts]),
        np.concatenate([part.turn_deg for part in parts]),
        {joint: np.concatenate([part.angles_deg[joint] for part in parts]) for joint in parts[0].angles_deg},
        np.concatenate([part.tips_mm for part in parts]),
        {joint: np.concatenate([part.by_hand_deg[joint] for part in parts]) for joint in parts[0].angles_deg},
    )


def _postures(posed: PosedHand, valid: npt.NDArray[np.bool_]) -> tuple[Index, Index, Array]:
    """Choose representative postures of T frames.

    Returns
    -------
    rows : array of int, shape (n,)
        Indices of the chosen frames, spread over the postures of each set of valid receivers.
    nearest : array of int, shape (2, T)
        For each frame, the indices into `rows` of its two nearest postures with the same valid receivers, the
        nearer one first; twice the same index if there is only one.
    second_share : array, shape (T,)
        Weight of the second one; weights are inverse to the squared distance of the joint angles.

    """
    usable = np.flatnonzero(posed.posed)
    nearest: Index = np.zeros((2, len(posed.posed)), int)
    second_share = np.zeros(len(posed.posed))
    if not len(usable):
        return usable, nearest, second_share
    chosen: list[int] = []
    _, group = np.unique(valid[usable], axis=0, return_inverse=True)
    for number in range(group.max() + 1):
        rows = usable[group.reshape(-1) == number]
        states = posed.angles_rad[rows]
        few = rows[spread_frames(states, max(1, round(POSTURES * len(rows) / len(usable))))[0]]
        nearest[:, rows] = len(chosen)
        if len(few) > 1:
            chosen_states = posed.angles_rad[few]
            apart = (states**2).sum(1)[:, None] + (chosen_states**2).sum(1) - 2 * states @ chosen_states.T
            two = np.argpartition(apart, 1, axis=1)[:, :2]
            squares = np.maximum(np.take_along_axis(apart, two, 1), 0.0)
            nearest[:, rows] = len(chosen) + two.T
            second_share[rows] = squares[:, 0] / np.maximum(squares.sum(1), _SAME_POSTURE)
        chosen += few.tolist()
    return np.array(chosen, int), nearest, second_share


def posed_frames(posed: PosedHand, rows: Index) -> PosedHand:
    """Select some of the posed frames.

    Parameters
    ----------
    posed : PosedHand
        T frames.
    rows : array of int, shape (F,)
        Indices of the frames to select.

    Returns
    -------
    PosedHand
        The F selected frames.

    """
    names = ("angles_rad", "bone_position_mm", "bone_quaternion", "receiver_mm", "residual_mm", "posed")
    return replace(posed, **{name: getattr(posed, name)[rows] for name in names})


def _errors(postures: Postures, frames: Frames) -> PosedErrors:
    """Compute the errors of every frame from the frame's own linear map."""
    spread, n_hand = _spread_of(postures, frames), postures.tips.root.shape[1]
    angles_deg = dict(_angle_errors_deg(postures, spread))
    neutral_deg = _neutral_sd_deg(postures.tips)
    joint_of = {joint.child: joint.name for joint in postures.tips.fit.layout.joints.values()}
    more_mm2 = [
        3.0 * unmodelled_mm2(joint_of.get(name, ""), postures.tips.fit) for name in postures.posed.bones
    ]
    return PosedErrors(
        np.sqrt(_norm(spread.shift_mm) ** 2 + more_mm2),
        np.degrees(_norm(spread.turn_rad)),
        {
            joint: np.sqrt(_norms(maps) ** 2 + neutral_deg[joint] ** 2 + _wander_deg(postures, joint) ** 2)
            for joint, maps in angles_deg.items()
        },
        _tip_errors_mm(postures, spread, frames),
        {joint: maps[..., :n_hand].copy() for joint, maps in angles_deg.items()},
    )


def _norm(maps: Array) -> Array:
    """Return the 1-sigma errors in 3-D (...) of vectors whose maps are (..., 3, N)."""
    return np.asarray(np.sqrt(np.einsum("...in,...in->...", maps, maps)))


@dataclass(frozen=True)
class _BranchBones:
    """Derivatives of the positions and rotations of a branch's n bones.

    columns : indices of these among all bones. by_unknowns : (n, F, 6, g). by_own : (n, F, 6, s + 6), by the
    branch's states and the root.
    """

    columns: tuple[int, ...]
    by_unknowns: Array
    by_own: Array


class _ByTurn(NamedTuple):
    """Derivatives of a joint's angles, deg.

    by_turn : (F, 3, 3) by a rotation of the second bone relative to the first, both indices among all bones.
    by_axes : (F, 3, 4) by rotations of the joint's axes and of its zero. axes_by_x : (4, G) of those
    rotations by the unknowns.
    """

    first: int
    second: int
    by_turn: Array
    by_axes: Array
    axes_by_x: Array


@dataclass(frozen=True)
class Postures:
    """Posed frames, and the derivatives for their errors that do not depend on which receivers are valid.

    point : the frames as solved, as a right hand. by_turn : derivatives of the angles, by joint.
    """

    tips: Fingertips
    posed: PosedHand
    point: Point
    bones: tuple[_BranchBones, ...]
    by_turn: Mapping[str, _ByTurn]

    @classmethod
    def of(cls, tips: Fingertips, posed: PosedHand) -> Postures:
        """Compute the derivatives at posed frames."""
        fit, turn = tips.fit, matrix(posed.bone_quaternion[:, 0])
        root = fit.convention.world(turn, posed.bone_position_mm[:, 0])
        point = Point(fit.posterior.x, posed.angles_rad, *root)
        bones = tuple(_branch_bones(branch, point, posed.bones) for branch in fit.model.branches)
        return cls(tips, posed, point, bones, dict(_by_turns(tips, posed, point)))


def _branch_bones(branch: Branch, point: Point, bones: Sequence[str]) -> _BranchBones:
    columns = [index for index, name in enumerate(bones) if bone(name) in branch.marks]
    marks = [branch.marks.index(bone(bones[index])) for index in columns]
    reached = reach(branch, point.x, point.y, point.root, point.root_mm)
    raw = branch.by_operation(reached, marks)
    arms = reached.position_mm[marks] - point.root_mm
    by_root = np.array([_by_root(point, arm) for arm in arms]).reshape(*raw.shape[:-1], 6)
    by_states = raw @ branch.per_state(point.x)
    return _BranchBones(
        tuple(columns), branch.by_unknown(raw, point.y), np.concatenate([by_states, by_root], -1)
    )


def _spread_of(postures: Postures, frames: Frames) -> _Spread:
    """Compute the error maps of posed frames from the receivers that are valid in `frames`.

    The standard normal numbers are those of the hand, then six of the root, then one of each state.
    """
    fit, point, root = postures.tips.fit, postures.point, postures.tips.root
    problem = replace(fit.problem, frames=frames, temper=1.0, state_sd=np.array(fit.model.states.sd))
    reduced = reduce(problem, point).frames_first()
    (n_frames, n_states), n_hand = point.y.shape, root.shape[1]
    n_numbers, by_hand, of_root = n_hand + 6 + n_states, slice(0, n_hand), slice(n_hand, n_hand + 6)
    dx = root[: len(point.x)]
    back = reduced.root_inverse.swapaxes(-1, -2)
    d_root = np.zeros((n_frames, 6, n_numbers))
    d_root[:, :, by_hand] = -back @ _times(reduced.root_by_x, dx)
    d_root[:, :, of_root] = back
    states = np.zeros((n_frames, n_states, n_numbers))
    moved = np.zeros((n_frames, len(postures.posed.bones), 6, n_numbers))
    moved[:, 0] = _by_root(point, np.zeros_like(point.root_mm)) @ d_root
    for branch, part, of_branch in zip(problem.branches, reduced.eliminated, postures.bones, strict=True):
        inner, of_x = part.inverse.swapaxes(-1, -2), dx[branch.unknowns]
        dy = part.by_rest[..., :6] @ d_root
        dy[:, :, by_hand] += _times(part.by_rest[..., 6:], dx[part.unknowns])
        dy = -inner @ dy
        dy[:, :, n_hand + 6 + branch.states] += inner
        states[:, branch.states] = dy
        both = np.concatenate([dy, d_root], 1)
        for by_unknowns, by_own, column in zip(
            of_branch.by_unknowns, of_branch.by_own, of_branch.columns, strict=True
        ):
            np.matmul(by_own, both, out=moved[:, column])
            moved[:, column, :, by_hand] += _times(by_unknowns, of_x)
    unknowns = np.zeros((len(root), n_numbers))
    unknowns[:, by_hand] = root
    return _Spread(moved[:, :, :3], moved[:, :, 3:], states, unknowns)


def _times(values: Array, matrix: Array) -> Array:
    """Multiply matrices (F, n, g) by a single one (g, N), as one matrix product."""
    return (values.reshape(-1, values.shape[-1]) @ matrix).reshape(*values.shape[:-1], matrix.shape[-1])


def _by_root(point: Point, arm_mm: Array) -> Array:
    """Return the derivative (F, 6, 6) of a pose by the root's pose; arm_mm : (F, 3) from the root to it."""
    out = np.zeros((len(arm_mm), 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = point.root
    out[:, :3, 3:] = cross(point.root.swapaxes(-1, -2), arm_mm[:, None]).swapaxes(-1, -2)
    return out


def _by_turns(tips: Fingertips, posed: PosedHand, point: Point) -> Iterator[tuple[str, _ByTurn]]:
    """Yield the derivatives of the angles of every moving joint of known anatomy."""
    fit, quaternion = tips.fit, posed.bone_quaternion
    ahead, behind = (joint_angles_of(fit, posed, sign * _NUDGE_RAD) for sign in (1, -1))
    for joint, axes in fit.summary.angle_axes.items():
        a, b = posed.bones.index(axes.parent), posed.bones.index(axes.child)
        by_turn = _by_turn(quaternion[:, a], quaternion[:, b], fit.side, *axes.of_hand(fit.side))
        if fit.side == "left":
            by_turn = by_turn * -MIRROR  # rotations are pseudo-vectors
        by_axes = _differences(ahead[joint], behind[joint])[..., None]
        by_axes = np.concatenate([by_axes, -by_turn @ point.root], -1)
        yield joint, _ByTurn(a, b, by_turn, by_axes, np.vstack([axes.turn_by_x, axes.rest_by_x]))


def _angle_errors_deg(postures: Postures, spread: _Spread) -> Iterator[tuple[str, Array]]:
    """Yield the error maps (F, 3, N) of the angles of each moving joint; NaN for an axis that it lacks."""
    for joint, (a, b, by_turn, by_axes, axes_by_x) in postures.by_turn.items():
        turned = by_turn @ (spread.turn_rad[:, b] - spread.turn_rad[:, a])
        yield joint, turned + by_axes @ (axes_by_x @ spread.unknowns[: axes_by_x.shape[1]])
    by_anatomy = {name for digit in known_digits(postures.tips.fit.layout) for name in digit.joints}
    others = [name for name, _ in postures.posed.angle_names]
    for joint in dict.fromkeys(others):
        if joint not in by_anatomy:
            columns = [index for index, name in enumerate(others) if name == joint]
            errors = np.full((len(spread.states_rad), 3, spread.states_rad.shape[-1]), np.nan)
            errors[:, : len(columns)] = np.degrees(spread.states_rad[:, columns])
            yield joint, errors


def _differences(ahead: Array, behind: Array) -> Array:
    """Return central differences of angles, deg, per rad of the nudge."""
    return np.asarray(((ahead - behind + 180.0) % 360.0 - 180.0) / (2 * _NUDGE_RAD))


def _by_turn(parent: Array, child: Array, hand: str, rest: Array, axes: Array) -> Array:
    """Return the derivative (F, 3, 3) of joint angles, deg, by the child's turn in the transmitter frame."""
    nudges = np.stack([about_axis(np.eye(3), np.full(3, sign * _NUDGE_RAD)) for sign in (1, -1)])
    ahead, behind = joint_angles(parent, multiply(nudges[:, :, None], child), hand, rest, axes)
    return np.moveaxis(_differences(ahead, behind), 0, -1)


def _tip_errors_mm(postures: Postures, spread: _Spread, frames: Frames) -> Array:
    """Return errors (F, D, 2) in 3-D of bone's and skin's ends, carried by a valid receiver or the bone."""
    tips, posed = postures.tips, postures.posed
    model = tips.fit.model
    out = np.empty((len(posed.posed), len(tips.digits), 2))
    for index, (digit, tip) in enumerate(tips.digits.items()):
        skin = 3 * SKIN_SD_MM**2 + np.trace(unshown_mm2(tip.receiver, tip.point_mm, tips.fit))
        seen = frames.valid[:, model.receivers.index(tip.receiver)]
        for part, covariance_mm2 in enumerate((tip.covariance_mm2, tip.soft_tip_covariance_mm2)):
            carried = np.sqrt(np.trace(covariance_mm2) + skin)
            chain = tips.fit.layout.digits[digit]
            by_bone = _norm(_end(tips, posed, spread, chain, part))
            by_bone = np.sqrt(by_bone**2 + 3.0 * unmodelled_mm2(chain.joints[-1], tips.fit))
            out[:, index, part] = np.where(seen, carried, by_bone)
    return out


def _end(tips: Fingertips, posed: PosedHand, spread: _Spread, digit: Digit, part: int) -> Array:
    """Return the error map (F, 3, N) of the end of a digit's last bone (part 0) or of its skin (part 1)."""
    last = posed.bones.index(digit.tip)
    n_x = len(tips.fit.posterior.x)
    end = np.array([tips.fit.bones[digit.tip].length_mm, 0.0, 0.0])
    moved = np.zeros((3, len(spread.unknowns)))
    moved[0, :n_x] = tips.fit.model.length[digit.tip].row(n_x)
    if part:
        number = list(tips.digits).index(digit.name)
        end = end + tips.offsets_mm[number, 0]
        first = n_x + 3 * 2 * number
        moved[:, first : first + 3] += np.eye(3)
    quaternion = posed.bone_quaternion[:, last]
    turn = tips.fit.convention.world(matrix(quaternion), posed.bone_position_mm[:, last])[0]
    arm = turn @ end
    turned = cross(spread.turn_rad[:, last].swapaxes(-1, -2), arm[:, None]).swapaxes(-1, -2)
    return spread.shift_mm[:, last] + turned + turn @ (moved @ spread.unknowns)
