"""What a fitted hand says: joint centres, axes, bones and the wrist, each with its uncertainty.

Everything is read at one posture, the mean over the recording of every joint angle, with the receivers where
they sit when nothing is bent. A centre that is fixed in a receiver's frame is so at any posture; that of an
MCP joint seen across a palm that moves, or of the thumb's skew CMC axes, is thereby the mean one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinematics.rotations import Array
from schemas.layout import Joint, Layout
from stages.fit_hand import anatomy_priors as prior
from stages.fit_hand.building import KINDS, Amount, axis_frame, receiver
from stages.fit_hand.chain import HandModel
from stages.fit_hand.normal_equations import Point, Problem, Reduced, states_by_unknowns
from stages.fit_hand.operations import cross
from stages.fit_hand.recordings import Convention

WEAK_SD_MM = 2.0
WEAK_AXIS_SD_DEG = 5.0
WEAK_RANGE_DEG = 10.0
STRANGE_SD = 5.0
WEAK_GAP_MM = 10.0
"""No skin on a hand lets two receivers disagree so much about their joint; a wrong quaternion order does."""


@dataclass(frozen=True)
class FittedJoint:
    """One joint of a fitted hand.

    parent_mm, child_mm : (3,) centre in the parent's and the child's receiver frame (child NaN where the
    child carries no receiver). covariance_mm2 : (6, 6) of both. axis_parent, axis_child : (3,) unit
    flexion axis there; axis_sd_deg : its 1-sigma direction error. range_deg : of flexion over the frames
    fitted. gap_rms_mm : of the centre in the recording. status : ok or weak; message : why.
    """

    name: str
    parent_segment: str
    child_segment: str
    dof: int
    parent_mm: Array
    child_mm: Array
    covariance_mm2: Array
    axis_parent: Array
    axis_child: Array
    axis_sd_deg: float
    range_deg: float
    mean_deg: float
    gap_rms_mm: float
    status: str
    message: str

    @property
    def sd_mm(self) -> float:
        """1-sigma three-dimensional error of the centre: the worse half's."""
        variance = np.nan_to_num(np.diag(self.covariance_mm2))
        return float(np.sqrt(max(variance[:3].sum(), variance[3:].sum())))


@dataclass(frozen=True)
class FittedBone:
    """Length of a bone in mm, joint to joint; sd_mm 1-sigma."""

    length_mm: float
    sd_mm: float


@dataclass(frozen=True)
class FixedCentre:
    """Centre (3,) in mm of a joint that does not move, in the parent's receiver frame; covariance (3, 3)."""

    name: str
    parent_segment: str
    child_segment: str
    parent_mm: Array
    covariance_mm2: Array


@dataclass(frozen=True)
class Posterior:
    """Mean x (G,) and covariance (G, G) of the hand's unknowns; mean_states (S,) over the recording, rad,
    and how they move with the unknowns (S, G).
    """

    x: Array
    covariance: Array
    mean_states: Array
    states_by_x: Array

    @classmethod
    def of(cls, problem: Problem, point: Point, reduced: Reduced, share: Array) -> Posterior:
        """Laplace's approximation at a point; share : (F,) of the recording that each frame stands for."""
        return cls(
            point.x,
            np.asarray(np.linalg.inv(reduced.matrix), float),
            share @ point.y,
            states_by_unknowns(problem, reduced, share),
        )

    def of_amount(self, amount: Amount) -> tuple[float, float]:
        """Mean and sd of a linear combination of the unknowns."""
        row = np.zeros(len(self.x))
        for coefficient, unknown in amount.parts:
            row[unknown] += coefficient
        return amount.constant + float(row @ self.x), float(np.sqrt(row @ self.covariance @ row))


@dataclass(frozen=True)
class Evidence:
    """A solved fit, to be read: its posterior, the frames it was solved on (problem), their share (F,) of the
    recording and joint angles (F, S) in rad.
    """

    layout: Layout
    model: HandModel
    convention: Convention
    problem: Problem
    posterior: Posterior
    share: Array
    states: Array
    converged: bool


@dataclass(frozen=True)
class Reading:
    """What is read: joints between two receivers, moving joints whose child carries none, joints that do not
    move, bones' lengths by segment, and the wrist centre (3,) with its covariance (3, 3) in the base
    receiver's frame, NaN where the layout's anatomy is not known.
    """

    joints: dict[str, FittedJoint]
    palm: dict[str, FittedJoint]
    fixed: dict[str, FixedCentre]
    bones: dict[str, FittedBone]
    wrist_mm: Array
    wrist_covariance_mm2: Array


@dataclass(frozen=True)
class Place:
    """A marked frame seen from the base bone, and how it moves and turns with the unknowns: (3, G) each."""

    R: Array
    t: Array
    moved: Array
    turned: Array

    def sees(self, other: Place) -> tuple[Array, Array]:
        """The other's origin in this frame and its derivative (3, G)."""
        arm = other.t - self.t
        moved = other.moved - self.moved + cross(arm, self.turned.T).T
        return self.R.T @ arm, self.R.T @ moved

    def carrying(self, point_mm: Array, by_x: Array) -> Place:
        """A point that rides on this frame, where `point_mm` (3,) puts it; by_x (3, G) : its derivative."""
        arm = self.R @ point_mm
        moved = self.moved + cross(self.turned.T, arm).T + self.R @ by_x
        return Place(self.R, self.t + arm, moved, self.turned)

    def sees_axis(self, axis: Array, turned: Array) -> tuple[Array, Array]:
        """An axis in this frame and its derivative (3, G); turned : how the axis turns."""
        return self.R.T @ axis, self.R.T @ cross((turned - self.turned).T, axis).T


def read(evidence: Evidence) -> Reading:
    """Read joints, bones and wrist off a solved fit."""
    places = places_of(evidence.model, evidence.posterior)
    joints: dict[str, FittedJoint] = {}
    palm: dict[str, FittedJoint] = {}
    fixed: dict[str, FixedCentre] = {}
    for joint in evidence.layout.joints.values():
        if receiver(joint.parent_receiver) not in places:
            continue
        if axis_frame(joint.name) in places:
            found = joints if receiver(joint.child) in places else palm
            found[joint.name] = _joint(joint, places, evidence)
        elif evidence.model.centres.get(joint.name) in places:
            fixed[joint.name] = _fixed(joint, places, evidence)
    bones = {
        segment: FittedBone(*evidence.posterior.of_amount(length))
        for segment, length in evidence.model.length.items()
    }
    return Reading(joints, palm, fixed, bones, *_wrist(places, evidence))


def places_of(model: HandModel, posterior: Posterior) -> dict[str, Place]:
    """Every marked frame at the mean posture."""
    y = posterior.mean_states[None]
    places = {}
    for branch in model.branches:
        reached = branch.reach(posterior.x, y, np.eye(3)[None], np.zeros((1, 3)), skin=False)
        raw = branch.by_operation(reached, range(len(branch.marks)))
        by_x = branch.by_unknown(raw, y, skin=False)[:, 0]
        by_y = (raw @ branch.per_state(posterior.x, skin=False))[:, 0]
        for mark, name in enumerate(branch.marks):
            full = by_y[mark] @ posterior.states_by_x[branch.states]
            full[:, branch.unknowns] += by_x[mark]
            R, t = reached.rotation[mark, 0], reached.position_mm[mark, 0]
            places[name] = Place(R, t, full[:3], full[3:])
    return places


def centre_by_unknowns(
    joint: Joint, places: Mapping[str, Place], evidence: Evidence
) -> tuple[dict[str, Array], Array]:
    """A joint's centre in the fitted frames of the parent's and the child's receiver, NaN where there is
    none, and its derivative (6, G) in the receivers' own frames.
    """
    centre = places[evidence.model.centres[joint.name]]
    points, by_x = {}, np.full((6, len(evidence.posterior.x)), np.nan)
    for side, segment in enumerate((joint.parent_receiver, joint.child)):
        points[segment] = np.full(3, np.nan)
        if receiver(segment) in places:
            points[segment], moved = places[receiver(segment)].sees(centre)
            by_x[3 * side : 3 * side + 3] = evidence.convention.point_matrix(segment) @ moved
    return points, by_x


def _joint(joint: Joint, places: Mapping[str, Place], evidence: Evidence) -> FittedJoint:
    model, convention, posterior = evidence.model, evidence.convention, evidence.posterior
    points, by_x = centre_by_unknowns(joint, places, evidence)
    axis_at = places[axis_frame(joint.name)]
    axis = axis_at.R @ model.axes[joint.name]
    axes = {
        segment: places[receiver(segment)].sees_axis(axis, axis_at.turned)[0]
        if receiver(segment) in places
        else np.full(3, np.nan)
        for segment in points
    }
    seen = places[receiver(joint.parent_receiver)].sees_axis(axis, axis_at.turned)[1]
    covariance = by_x @ posterior.covariance @ by_x.T
    for half, segment in ((slice(0, 3), joint.parent_receiver), (slice(3, 6), joint.child)):
        covariance[half, half] += bent_skin_mm2(segment, evidence)
    axis_sd = float(np.degrees(np.sqrt(np.trace(seen @ posterior.covariance @ seen.T))))
    flexion = evidence.states[:, model.states.names.index((joint.name, KINDS[0]))]
    range_deg = float(np.degrees(np.ptp(flexion)))
    gap = _gap_rms_mm(joint, evidence, points)
    reasons = _doubts(joint, evidence, covariance, axis_sd, range_deg, gap)
    return FittedJoint(
        name=joint.name,
        parent_segment=joint.parent_receiver,
        child_segment=joint.child,
        dof=joint.dof,
        parent_mm=convention.point(joint.parent_receiver, points[joint.parent_receiver]),
        child_mm=convention.point(joint.child, points[joint.child]),
        covariance_mm2=covariance,
        axis_parent=convention.axis(joint.parent_receiver, axes[joint.parent_receiver]),
        axis_child=convention.axis(joint.child, axes[joint.child]),
        axis_sd_deg=axis_sd,
        range_deg=range_deg,
        mean_deg=float(np.degrees(evidence.share @ flexion)),
        gap_rms_mm=gap,
        status="weak" if reasons else "ok",
        message="; ".join(reasons),
    )


def bent_skin_mm2(segment: str, evidence: Evidence) -> Array:
    """Covariance (3, 3) that a centre gains in a receiver's own frame as skin is not linear in the angles.

    A receiver that slides by c mm per rad moves the centres in its frame by c mm and leaves no gap. The fit
    has the linear slides of both adjacent joints; of the rest, which nothing shows, it knows only the size.
    """
    slides = [i for i, group in enumerate(evidence.model.unknowns.groups) if group == "slide x"]
    own = [i for i in slides if evidence.model.unknowns.names[i].startswith(f"{segment} ")]
    if not own:
        return np.zeros((3, 3))
    scale = evidence.problem.precision[own[0]] ** -0.5
    bent = prior.SKIN_BENT * scale * len(own) ** 0.5 * np.array(prior.SLIDE_SD_MM)
    turn = evidence.convention.point_matrix(segment)
    return np.asarray(turn @ np.diag(bent**2) @ turn.T)


def _fixed(joint: Joint, places: Mapping[str, Place], evidence: Evidence) -> FixedCentre:
    seat = places[receiver(joint.parent_receiver)]
    point, moved = seat.sees(places[evidence.model.centres[joint.name]])
    by_x = evidence.convention.point_matrix(joint.parent_receiver) @ moved
    return FixedCentre(
        joint.name,
        joint.parent_receiver,
        joint.child,
        evidence.convention.point(joint.parent_receiver, point),
        by_x @ evidence.posterior.covariance @ by_x.T,
    )


def _gap_rms_mm(joint: Joint, evidence: Evidence, points: Mapping[str, Array]) -> float:
    """Root mean square distance of the two halves of a centre in the recording; NaN where there is none."""
    receivers, frames = evidence.model.receivers, evidence.problem.frames
    if joint.child not in receivers:
        return float("nan")
    a, b = receivers.index(joint.parent_receiver), receivers.index(joint.child)
    weight = evidence.share * (frames.valid[:, a] & frames.valid[:, b])
    if not weight.any():
        return float("nan")
    apart = frames.rotation[:, a] @ points[joint.parent_receiver] + frames.position_mm[:, a]
    apart -= frames.rotation[:, b] @ points[joint.child] + frames.position_mm[:, b]
    return float(np.sqrt((weight * (apart**2).sum(-1)).sum() / weight.sum()))


def _doubts(
    joint: Joint,
    evidence: Evidence,
    covariance_mm2: Array,
    axis_sd_deg: float,
    range_deg: float,
    gap_rms_mm: float,
) -> list[str]:
    """Say in words what makes a joint weak; nothing where nothing does."""
    reasons = _doubts_of_the_hand(evidence)
    receivers = evidence.model.receivers
    reasons += [
        f"no valid pose of {segment}: anatomy and the other receivers stand in for it"
        for segment in (joint.parent_receiver, joint.child)
        if segment in receivers and not evidence.problem.frames.valid[:, receivers.index(segment)].any()
    ]
    if gap_rms_mm > WEAK_GAP_MM:
        reasons.append(
            f"its receivers disagree by {gap_rms_mm:.0f} mm: a loose receiver, a wrong quaternion order or "
            "angle convention, or more skin than on a hand"
        )
    if range_deg < WEAK_RANGE_DEG:
        reasons.append(f"moved only {range_deg:.1f} deg: anatomy says more about it than the recording")
    halves = (covariance_mm2[:3, :3], covariance_mm2[3:, 3:])
    seen = [np.linalg.eigvalsh(half)[-1] for half in halves if np.isfinite(half).all()]
    worst_mm = float(np.sqrt(max(*seen, 0.0)))
    if worst_mm > WEAK_SD_MM:
        reasons.append(f"centre uncertain by {worst_mm:.1f} mm in its worst direction")
    if joint.dof == 1 and axis_sd_deg > WEAK_AXIS_SD_DEG:
        reasons.append(f"axis uncertain by {axis_sd_deg:.0f} deg")
    return reasons


def _doubts_of_the_hand(evidence: Evidence) -> list[str]:
    """What makes every joint of a hand weak."""
    reasons = [] if evidence.converged else ["the fit of the hand did not converge"]
    off = np.abs(evidence.posterior.x) * np.sqrt(evidence.problem.precision)
    worst = int(np.argmax(off))
    if off[worst] > STRANGE_SD:
        reasons.append(
            f"the hand that fits is strange ({evidence.model.unknowns.names[worst]} is {off[worst]:.0f} sd "
            "from the usual): wrong units, swapped receivers, or a receiver far from the middle of its bone"
        )
    return reasons


def _wrist(places: Mapping[str, Place], evidence: Evidence) -> tuple[Array, Array]:
    """The wrist centre, which is where the hand's frame has its origin, and its covariance."""
    if not evidence.model.length:
        return np.full(3, np.nan), np.full((3, 3), np.nan)
    base, posterior = evidence.model.receivers[0], evidence.posterior
    still = np.zeros((3, len(posterior.x)))
    point, moved = places[receiver(base)].sees(Place(np.eye(3), np.zeros(3), still, still))
    by_x = evidence.convention.point_matrix(base) @ moved
    return evidence.convention.point(base, point), by_x @ posterior.covariance @ by_x.T
