"""The posterior of a fitted hand, and every bone and receiver at the mean posture with its derivatives.

The mean posture is the mean of every joint angle over the recording. A joint centre is stated at this
posture, in the receiver's frame as skin had moved the receiver there. Where the receiver would be on a
straight digit is an extrapolation that no recording shows.

On paper: docs/whole-hand.md, sections 7 and 8.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shukotsu.fit.chain import HandModel
from shukotsu.fit.chain_builder import Amount, receiver
from shukotsu.fit.compiled_equations import reach
from shukotsu.fit.normal_equations import Point, Problem, Reduced, states_by_unknowns
from shukotsu.fit.receiver_frames import Convention
from shukotsu.hand.rotations import Array, cross
from shukotsu.study.layout import Joint, Layout


@dataclass(frozen=True)
class Posterior:
    """Normal posterior of a hand (Laplace; docs/whole-hand.md, section 7).

    Parameters
    ----------
    x : array, shape (G,)
        Mean of the unknowns, in units of their published sd.
    covariance : array, shape (G, G)
        Their covariance.
    mean_states : array, shape (S,)
        Joint angles of the mean posture, rad.
    states_by_x : array, shape (S, G)
        Their derivatives by the unknowns.

    """

    x: Array
    covariance: Array
    mean_states: Array
    states_by_x: Array

    @classmethod
    def of(cls, problem: Problem, point: Point, reduced: Reduced, share: Array) -> Posterior:
        """Compute Laplace's approximation at a solution (docs/whole-hand.md, section 7).

        Parameters
        ----------
        problem : Problem
            Problem as solved.
        point : Point
            Solution.
        reduced : Reduced
            Normal equations at the solution, undamped.
        share : array, shape (F,)
            Share of the recording that each frame represents.

        Returns
        -------
        Posterior
            Normal distribution of the unknowns, and the mean posture.

        """
        covariance = np.asarray(np.linalg.inv(reduced.matrix), float)
        return cls(point.x, covariance, share @ point.y, states_by_unknowns(problem, reduced, share))

    def moved_to(self, x: Array, covariance: Array) -> Posterior:
        """Replace mean and covariance, and update the mean joint angles to first order.

        Parameters
        ----------
        x : array, shape (G,)
            Mean.
        covariance : array, shape (G, G)
            Covariance.

        Returns
        -------
        Posterior
            Posterior with that mean and covariance.

        """
        states = self.mean_states + self.states_by_x @ (x - self.x)
        return Posterior(x, covariance, states, self.states_by_x)

    def of_amount(self, amount: Amount) -> tuple[float, float]:
        """Return mean and sd of a linear combination of the unknowns."""
        row = amount.row(len(self.x))
        return amount.constant + float(row @ self.x), float(np.sqrt(row @ self.covariance @ row))


@dataclass(frozen=True)
class SolvedFit:
    """A solved fit of a hand.

    Parameters
    ----------
    layout, model, convention, problem
        Definition of the fit to F frames; residual sd and prior precision are those of the last round.
    posterior : Posterior
        Posterior of the hand's unknowns, conditioned on the other hand and on touches if there are any.
    alone : Posterior
        Posterior before it was conditioned on them.
    share : array, shape (F,)
        Share of the recording that each frame represents.
    states : array, shape (F, S)
        Joint angles of the frames, rad.
    converged : bool
        Whether the last round converged.

    """

    layout: Layout
    model: HandModel
    convention: Convention
    problem: Problem
    posterior: Posterior
    alone: Posterior
    share: Array
    states: Array
    converged: bool


@dataclass(frozen=True)
class Place:
    """Pose R, t of a marked frame in the base bone's frame, and its derivatives by the unknowns.

    moved, turned : (3, G) of its origin, mm, and of its rotation vector, rad.
    """

    R: Array
    t: Array
    moved: Array
    turned: Array

    def sees(self, other: Place) -> tuple[Array, Array]:
        """Compute another frame's origin in this frame.

        Parameters
        ----------
        other : Place
            The other frame.

        Returns
        -------
        origin_mm : array, shape (3,)
            Origin of the other frame.
        by_x : array, shape (3, G)
            Derivative by the unknowns.

        """
        arm = other.t - self.t
        moved = other.moved - self.moved + cross(arm, self.turned.T).T
        return self.R.T @ arm, self.R.T @ moved

    def carrying(self, point_mm: Array, by_x: Array) -> Place:
        """Compute the pose of a point that this frame carries.

        Parameters
        ----------
        point_mm : array, shape (3,)
            The point in this frame.
        by_x : array, shape (3, G)
            Its derivative by the unknowns.

        Returns
        -------
        Place
            A frame at the point, parallel to this one.

        """
        arm = self.R @ point_mm
        moved = self.moved + cross(self.turned.T, arm).T + self.R @ by_x
        return Place(self.R, self.t + arm, moved, self.turned)

    def sees_axis(self, axis: Array, turned: Array) -> tuple[Array, Array]:
        """Compute an axis in this frame.

        Parameters
        ----------
        axis : array, shape (3,)
            Unit axis in the base bone's frame.
        turned : array, shape (3, G)
            Derivative of its rotation by the unknowns, rad.

        Returns
        -------
        axis : array, shape (3,)
            The axis in this frame.
        by_x : array, shape (3, G)
            Derivative by the unknowns.

        """
        return self.R.T @ axis, self.R.T @ cross((turned - self.turned).T, axis).T


def places_of(model: HandModel, posterior: Posterior) -> dict[str, Place]:
    """Locate every marked frame at the mean posture.

    Parameters
    ----------
    model : HandModel
        Chains and names of marks (`bone`, `receiver`, `axis_frame`, `straight`, `centre`).
    posterior : Posterior
        Unknowns and mean joint angles.

    Returns
    -------
    dict of str to Place
        By mark: pose in the hand's frame, mm, and its derivatives by the unknowns.

    """
    y = posterior.mean_states[None]
    places = {}
    for branch in model.branches:
        reached = reach(branch, posterior.x, y, np.eye(3)[None], np.zeros((1, 3)))
        raw = branch.by_operation(reached, range(len(branch.marks)))
        by_x = branch.by_unknown(raw, y)[:, 0]
        by_y = (raw @ branch.per_state(posterior.x))[:, 0]
        for mark, name in enumerate(branch.marks):
            full = by_y[mark] @ posterior.states_by_x[branch.states]
            full[:, branch.unknowns] += by_x[mark]
            R, t = reached.rotation[mark, 0], reached.position_mm[mark, 0]
            places[name] = Place(R, t, full[:3], full[3:])
    return places


def centre_by_unknowns(
    joint: Joint, places: Mapping[str, Place], fit: SolvedFit
) -> tuple[dict[str, Array], Array]:
    """Compute a joint's centre in both receivers and its derivative by the unknowns.

    Parameters
    ----------
    joint : Joint
        Joint of the layout.
    places : mapping of str to Place
        Every marked frame at the mean posture (`places_of`).
    fit : SolvedFit
        The hand.

    Returns
    -------
    points : dict of str to array, shape (3,)
        Centre by segment of the receiver, mm in the receiver's frame of the fit; NaN without a receiver.
    by_x : array, shape (6, G)
        Derivatives of both centres in the receivers' original frames, the parent's first.

    """
    centre = places[fit.model.centres[joint.name]]
    points, by_x = {}, np.full((6, len(fit.posterior.x)), np.nan)
    for side, segment in enumerate((joint.parent_receiver, joint.child)):
        points[segment] = np.full(3, np.nan)
        if receiver(segment) in places:
            points[segment], moved = places[receiver(segment)].sees(centre)
            by_x[3 * side : 3 * side + 3] = fit.convention.point_matrix(segment) @ moved
    return points, by_x
