"""Summarise a fitted hand: joint centres, axes, bones and the wrist, each with its uncertainty.

On paper: docs/whole-hand.md, section 8.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from shukotsu.fit.chain_builder import KINDS, axis_frame, bone, receiver, straight
from shukotsu.fit.posterior import Place, SolvedFit, centre_by_unknowns, places_of
from shukotsu.hand.average_hand import COMPOUND_DIGITS, PRIOR
from shukotsu.hand.joint_angles import mirror_rotations
from shukotsu.hand.known_digits import known_digits
from shukotsu.hand.rotations import Array, about_axis, cross_matrix, from_matrix
from shukotsu.hand.series import angle_range, flattening
from shukotsu.study.layout import Digit, Joint
from shukotsu.study.verdict import BY_ANATOMY, FAR, NO_POSE, ONE_RECEIVER, UNSETTLED, Doubts, Values
from shukotsu.translation import listed

STRANGE_SD = 5.0
"""Deviation of an unknown from the average hand, in sd, that indicates wrong units, or a receiver that is
swapped or off its bone."""


@dataclass(frozen=True)
class FittedJoint:
    """One joint of a fitted hand.

    Parameters
    ----------
    name : str
        Name in the layout.
    parent_segment, child_segment : str
        Segments of the receivers on both sides; empty if a receiver could be worn there but is not.
    parent_mm, child_mm : array, shape (3,)
        Centre in each receiver's frame; NaN without a receiver. A joint that does not move has no axis and no
        range, and its centre is stated only in the parent's frame, or in the child's if there is no parent.
    covariance_mm2 : array, shape (6, 6)
        Joint covariance of parent_mm and child_mm.
    doubts : mapping
        Reasons to doubt the centre that its numbers do not show, by kind.
    dof : int
        Degrees of freedom.
    axis_parent, axis_child : array, shape (3,)
        Unit flexion axis in each receiver's frame.
    axis_sd_deg : float
        1-sigma error of its direction.
    range_deg : float
        Range of flexion over the frames fitted.
    gap_rms_mm : float
        Root mean square distance in the recording between the centres that the two receivers carry.
    message : str
        Why no receiver carries the centre; otherwise empty.

    """

    name: str
    parent_segment: str
    child_segment: str
    parent_mm: Array
    child_mm: Array
    covariance_mm2: Array
    doubts: Doubts
    dof: int = 0
    axis_parent: Array = field(default_factory=lambda: np.full(3, np.nan))
    axis_child: Array = field(default_factory=lambda: np.full(3, np.nan))
    axis_sd_deg: float = np.nan
    range_deg: float = np.nan
    gap_rms_mm: float = np.nan
    message: str = ""

    @property
    def sd_mm(self) -> float:
        """1-sigma error in 3-D of the centre, the larger one of both receivers; NaN without a receiver."""
        variance = np.diag(self.covariance_mm2).reshape(2, 3).sum(1)
        return float(np.sqrt(np.fmax(*variance)))


@dataclass(frozen=True)
class FittedBone:
    """Length of a bone in mm, joint to joint; sd_mm 1-sigma."""

    length_mm: float
    sd_mm: float


@dataclass(frozen=True)
class AngleAxes:
    """Zero and axes of a joint's angles, for a right hand, in the frames of its bones.

    Parameters
    ----------
    parent, child : str
        Bones of the joint.
    rest : array, shape (4,)
        Rotation from child to parent at zero, (w, x, y, z): the straight digit in the flat hand.
    rest_by_x : array, shape (3, G)
        Derivative of that rotation by the unknowns, rad in the parent's frame.
    turn_rad : float
        Rotation of the axes about the child bone relative to its frame, which brings the first of them to the
        fitted flexion axis.
    turn_by_x : array, shape (G,)
        Derivative of turn_rad by the unknowns.
    turn_sd_deg : float
        1-sigma error of turn_rad.

    """

    parent: str
    child: str
    rest: Array
    rest_by_x: Array
    turn_rad: float
    turn_by_x: Array
    turn_sd_deg: float

    def of_hand(self, hand: str, more_rad: float = 0.0) -> tuple[Array, Array]:
        """Return rest and turn in the bone frames of a right or a left hand.

        Parameters
        ----------
        hand : str
            right or left.
        more_rad : float
            Angle by which to turn the axes in addition, about the child bone.

        Returns
        -------
        rest : array, shape (4,)
            Unit quaternion (w, x, y, z), child to parent bone at zero.
        turn : array, shape (4,)
            Rotation of the axes about the child bone, in its frame.

        """
        both = self.rest, about_axis(np.array([1.0, 0.0, 0.0]), np.array(self.turn_rad + more_rad))
        return (mirror_rotations(both[0]), mirror_rotations(both[1])) if hand == "left" else both


@dataclass(frozen=True)
class HandSummary:
    """Joints, centres and axes of a fitted hand, each with its error.

    Parameters
    ----------
    joints : dict of str to FittedJoint
        Joints between two receivers.
    lone : dict of str to FittedJoint
        Joints beside which a receiver could be worn but is not.
    palm : dict of str to FittedJoint
        Joints whose child segment never carries a receiver.
    fixed : dict of str to FittedJoint
        Centres of joints that do not move, and the wrist's if no receiver is on the forearm.
    angle_axes : dict of str to AngleAxes
        Zero and axes of the angles, by joint.

    """

    joints: dict[str, FittedJoint]
    lone: dict[str, FittedJoint]
    palm: dict[str, FittedJoint]
    fixed: dict[str, FittedJoint]
    angle_axes: dict[str, AngleAxes]


def summarise(fit: SolvedFit) -> HandSummary:
    """Summarise a solved fit: centres at the mean posture, axes and bones (docs/whole-hand.md, section 8).

    Parameters
    ----------
    fit : SolvedFit
        The hand.

    Returns
    -------
    HandSummary
        Lengths in mm, angles in degrees, errors 1-sigma.

    """
    places = places_of(fit.model, fit.posterior)
    joints, lone, palm, fixed = (dict[str, FittedJoint]() for _ in range(4))
    for joint in fit.layout.joints.values():
        if receiver(joint.parent_receiver) not in places:
            continue
        if axis_frame(joint.name) in places:
            worn = {joint.parent_receiver, joint.child} <= set(fit.model.receivers)
            unworn = lone if fit.layout.segments[joint.child].measured else palm
            (joints if worn else unworn)[joint.name] = _joint(joint, places, fit)
        elif fit.model.centres.get(joint.name) in places:
            seen = places[receiver(joint.parent_receiver)].sees(places[fit.model.centres[joint.name]])
            ends = joint.parent_receiver, joint.child
            fixed[joint.name] = _anatomical_joint(joint.name, ends, joint.parent_receiver, seen, fit)
    wrist, base = fit.layout.wrist, fit.model.receivers[0]
    if wrist is not None and wrist.joint not in joints and fit.model.length:
        still = np.zeros((3, len(fit.posterior.x)))
        seen = places[receiver(base)].sees(Place(np.eye(3), np.zeros(3), still, still))
        fixed[wrist.joint] = _anatomical_joint(wrist.joint, ("", wrist.segment), base, seen, fit)
    return HandSummary(joints, lone, palm, fixed, angle_axes(fit, places))


def unmodelled_mm2(joint: str, fit: SolvedFit) -> float:
    """Return the variance of a joint's centre due to model errors, U^2 of docs/whole-hand.md, section 8.

    Parameters
    ----------
    joint : str
        Name in the layout.
    fit : SolvedFit
        The hand.

    Returns
    -------
    float
        Variance per direction, mm^2, in addition to that of the fit; 0 without known anatomy.

    """
    for digit in known_digits(fit.layout):
        if joint in digit.joints:
            if fit.layout.joints[joint].dof == 1 and joint != digit.joints[0]:
                return PRIOR.UNMODELLED_MM["hinge"] ** 2
            compound = joint == digit.joints[0] or digit.name in COMPOUND_DIGITS
            return PRIOR.UNMODELLED_MM["compound" if compound else "mcp"] ** 2
    return 0.0


def unshown_mm2(segment: str, point_mm: Array, fit: SolvedFit) -> Array:
    """Compute the covariance of a point due to skin motion that leaves no residual: W of section 8.

    A receiver that slides by c mm per rad moves centres by c mm and leaves no gap. The fit has unknowns for
    the linear slides of a digit's receivers. Of nonlinear slides, and of skin on the back of the hand, only
    the typical size is known.

    Parameters
    ----------
    segment : str
        Segment that carries the receiver.
    point_mm : array, shape (3,)
        Point in the receiver's original frame.
    fit : SolvedFit
        The hand.

    Returns
    -------
    array, shape (3, 3)
        Covariance, mm^2, in the receiver's original frame.

    """
    turn = fit.convention.point_matrix(segment)
    if segment == fit.model.receivers[0] and segment in fit.model.mount:
        tilt = PRIOR.PALM_TILT_SD * cross_matrix(point_mm)
        return np.asarray(PRIOR.PALM_SLIDE_SD_MM**2 * np.eye(3) + tilt @ tilt.T)
    slides = [i for i, group in enumerate(fit.model.unknowns.groups) if group == "slide x"]
    of_segment = [i for i in slides if fit.model.unknowns.names[i].startswith(f"{segment} ")]
    if not of_segment:
        return np.zeros((3, 3))
    loose = fit.problem.precision[of_segment[0]] ** -0.5 * PRIOR.looseness(segment)
    bent = PRIOR.SKIN_BENT * loose * len(of_segment) ** 0.5 * np.array(PRIOR.SLIDE_SD_MM)
    return np.asarray(turn @ np.diag(bent**2) @ turn.T)


def _joint(joint: Joint, places: Mapping[str, Place], fit: SolvedFit) -> FittedJoint:
    model, convention, posterior = fit.model, fit.convention, fit.posterior
    points, by_x = centre_by_unknowns(joint, places, fit)
    axis_at = places[axis_frame(joint.name)]
    axis = axis_at.R @ model.axes[joint.name]
    axes = dict.fromkeys(points, np.full(3, np.nan))
    for segment in points.keys() & set(model.receivers):
        axes[segment] = places[receiver(segment)].sees_axis(axis, axis_at.turned)[0]
    axis_by_x = places[receiver(joint.parent_receiver)].sees_axis(axis, axis_at.turned)[1]
    covariance = by_x @ posterior.covariance @ by_x.T
    for half, segment in ((slice(0, 3), joint.parent_receiver), (slice(3, 6), joint.child)):
        if segment in model.receivers:
            own_mm = convention.point_matrix(segment) @ points[segment]
            covariance[half, half] += unshown_mm2(segment, own_mm, fit)
    covariance += np.kron(np.eye(2), unmodelled_mm2(joint.name, fit) * np.eye(3))
    axis_sd = float(np.degrees(np.sqrt(np.trace(axis_by_x @ posterior.covariance @ axis_by_x.T))))
    flexion = fit.states[:, model.states.names.index((joint.name, KINDS[0]))]
    range_deg = angle_range(np.degrees(flexion), flattening(flexion))
    doubts, sides = _doubts(joint, fit), (joint.parent_receiver, joint.child)
    unworn = doubts.get(ONE_RECEIVER, {}).get("segments", [])
    nowhere = (
        f"no receiver on {listed(unworn)}: no worn receiver carries the centre; its estimate is in "
        "bone_lengths and bone_poses"
    )
    return FittedJoint(
        name=joint.name,
        parent_segment="" if sides[0] in unworn else sides[0],
        child_segment="" if sides[1] in unworn else sides[1],
        dof=joint.dof,
        parent_mm=convention.point(joint.parent_receiver, points[joint.parent_receiver]),
        child_mm=convention.point(joint.child, points[joint.child]),
        covariance_mm2=covariance,
        axis_parent=convention.axis(joint.parent_receiver, axes[joint.parent_receiver]),
        axis_child=convention.axis(joint.child, axes[joint.child]),
        axis_sd_deg=axis_sd,
        range_deg=range_deg,
        gap_rms_mm=_gap_rms_mm(joint, fit, points),
        doubts=doubts,
        message=nowhere if len(unworn) == len(sides) else "",
    )


def _anatomical_joint(
    joint: str, ends: tuple[str, str], segment: str, seen: tuple[Array, Array], fit: SolvedFit
) -> FittedJoint:
    """Build a joint whose centre follows from anatomy.

    ends : parent and child segment. seen : the centre in the frame of the receiver on `segment`, and its
    derivative by the unknowns (`Place.sees`).
    """
    by_x = fit.convention.point_matrix(segment) @ seen[1]
    side = 0 if ends[0] else 1
    half = slice(3 * side, 3 * side + 3)
    covariance, centres = np.zeros((6, 6)), np.full((2, 3), np.nan)
    covariance[half, half] = by_x @ fit.posterior.covariance @ by_x.T
    covariance[half, half] += unmodelled_mm2(joint, fit) * np.eye(3)
    centres[side] = fit.convention.point(segment, seen[0])
    return FittedJoint(joint, *ends, centres[0], centres[1], covariance, doubts={BY_ANATOMY: {}})


def _gap_rms_mm(joint: Joint, fit: SolvedFit, points: Mapping[str, Array]) -> float:
    """Return the rms distance between the centres that both receivers carry; NaN if never valid together."""
    receivers, frames = fit.model.receivers, fit.problem.frames
    if not {joint.parent_receiver, joint.child} <= set(receivers):
        return float("nan")
    a, b = receivers.index(joint.parent_receiver), receivers.index(joint.child)
    weight = fit.share * (frames.valid[:, a] & frames.valid[:, b])
    if not weight.any():
        return float("nan")
    rotation = fit.problem.rotation(fit.posterior.x)
    apart = rotation[:, a] @ points[joint.parent_receiver] + frames.position_mm[:, a]
    apart -= rotation[:, b] @ points[joint.child] + frames.position_mm[:, b]
    return float(np.sqrt((weight * (apart**2).sum(-1)).sum() / weight.sum()))


def _doubts(joint: Joint, fit: SolvedFit) -> dict[str, Values]:
    """List reasons to doubt a joint's centre that its numbers do not show, by kind; the hand's first."""
    off = np.abs(fit.posterior.x) * np.sqrt(fit.problem.precision)
    strangest, receivers = int(np.argmax(off)), fit.model.receivers
    sides = (joint.parent_receiver, joint.child)
    valid = fit.problem.frames.valid
    dead = [s for s in sides if s in receivers and not valid[:, receivers.index(s)].any()]
    unworn = [s for s in sides if s not in receivers and fit.layout.segments[s].measured]
    doubts: dict[str, Values] = {}
    if not fit.converged:
        doubts[UNSETTLED] = {}
    if off[strangest] > STRANGE_SD:
        doubts[FAR] = {"what": fit.model.unknowns.names[strangest], "sd": float(off[strangest])}
    if dead:
        doubts[NO_POSE] = {"segments": dead}
    if unworn:
        doubts[ONE_RECEIVER] = {"segments": unworn}
    return doubts


def angle_axes(fit: SolvedFit, places: Mapping[str, Place]) -> dict[str, AngleAxes]:
    """Compute zero and axes of the angles of all joints with known anatomy that move (section 8).

    The axes of a thumb's CMC joint are oriented by the axis of its MCP joint, which shows where the nail
    faces.

    Parameters
    ----------
    fit : SolvedFit
        The hand.
    places : mapping of str to Place
        Marked frames of the mean posture, as `places_of` returns them.

    Returns
    -------
    dict
        Joint -> its zero and axes, of a right hand.

    """
    covariance = fit.posterior.covariance
    axes = {}
    for digit in known_digits(fit.layout):
        for k, (parent, seen, turned) in enumerate(_rests(fit, places, digit)):
            joint, child = digit.joints[k], digit.segments[k]
            if not fit.layout.joints[joint].dof:
                continue
            by_nail = k == 0 and fit.model.anatomy[digit.name].second_axis is not None
            by_nail = by_nail and axis_frame(digit.joints[1]) in places
            by = digit.joints[1] if by_nail else joint
            at, seer = places[axis_frame(by)], places[bone(child)] if by_nail else seen
            (_, y, z), moved = seer.sees_axis(at.R @ fit.model.axes[by], at.turned)
            by_x = (y * moved[2] - z * moved[1]) / (y * y + z * z)
            sd_deg = float(np.degrees(np.sqrt(by_x @ covariance @ by_x)))
            rest = from_matrix(parent.R.T @ seen.R)
            above = digit.segments[k - 1] if k else digit.base
            axes[joint] = AngleAxes(above, child, rest, turned, float(np.arctan2(z, y)), by_x, sd_deg)
    return axes


def _rests(fit: SolvedFit, places: Mapping[str, Place], digit: Digit) -> Iterator[tuple[Place, Place, Array]]:
    """Yield each joint's parent bone, child bone at zero, and derivative of its rotation in the parent."""
    still = np.zeros((3, len(fit.posterior.x)))
    above = np.eye(3)
    for k, frame in enumerate(fit.model.anatomy[digit.name].frames()):
        if k:
            parent = flat = places[bone(digit.segments[k - 1])]
            turned = still
        else:
            parent, flat = Place(np.eye(3), np.zeros(3), still, still), places[straight(digit.name)]
            turned = flat.turned
        yield parent, Place(flat.R @ above.T @ frame, flat.t, flat.moved, flat.turned), turned
        above = frame
