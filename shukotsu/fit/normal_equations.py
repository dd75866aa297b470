"""Data of the least squares over a whole hand: problem, point, residuals and reduced normal equations.

Unknowns are those of the hand (x, prior precision `precision`), the states of every frame (y, weak priors)
and the frame's root pose. A frame's states affect only the receivers of their branch. They are therefore
eliminated first, branch by branch, then the root, which leaves one dense system in x (Schur complement).

The computations themselves are compiled (`compiled_equations`).

On paper: docs/whole-hand.md, sections 4 to 6.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Float
from shukotsu.fit.chain_builder import Unknowns
from shukotsu.fit.operations import Branch, Index, Reached
from shukotsu.hand.average_hand import PRIOR
from shukotsu.hand.rotations import Array, exp_rotation

_FAR, _TIMES_WITHOUT_FAR = 2.5, 4
"""Multiple of the median distance from the centre beyond which a position is an outlier (a flip or a spike),
and number of times that outliers are removed."""


@dataclass(frozen=True)
class FieldDistortion:
    """Smooth distortion of a room's field, which rotates measured orientations differently at each position.

    B(t) of docs/whole-hand.md, section 4.

    Parameters
    ----------
    unknowns : array, shape (12,)
        Indices into x of the rotation about three axes, then of its slope along x, y and z for each axis.
    centre_mm : array, shape (3,)
        Mean position of the receivers, where the slope adds nothing.
    reach_mm : float
        Distance from there beyond which the rotation no longer grows: that of the farthest receiver.

    """

    unknowns: Index
    centre_mm: Array
    reach_mm: float

    @classmethod
    def among(cls, unknowns: Unknowns, places_mm: Array) -> FieldDistortion:
        """Add the field's unknowns to a hand's.

        Parameters
        ----------
        unknowns : Unknowns
            Unknowns of the hand, to which twelve are added.
        places_mm : array, shape (N, 3)
            Receivers in the transmitter frame, all frames together.

        Returns
        -------
        FieldDistortion
            Distortion about the receivers' mean position without outliers.

        """
        turns = [unknowns.add("field turn", axis) for axis in "xyz"]
        slopes = [unknowns.add("field slope", f"{axis} by {along}") for axis in "xyz" for along in "xyz"]
        near = places_mm
        for _ in range(_TIMES_WITHOUT_FAR):
            off_mm = np.linalg.norm(places_mm - near.mean(0), axis=1)
            near = places_mm[off_mm <= _FAR * np.median(off_mm)]
        reach_mm = float(np.linalg.norm(near - near.mean(0), axis=1).max())
        return cls(np.array(turns + slopes), near.mean(0), reach_mm)

    def by_unknown(self, position_mm: Array) -> Array:
        """Compute the derivative of the field's rotation by its unknowns.

        Parameters
        ----------
        position_mm : array, shape (..., 3)
            Positions in the transmitter frame.

        Returns
        -------
        array, shape (..., 3, 12)
            Derivative of a rotation vector in the transmitter frame, rad.

        """
        out = np.zeros((*position_mm.shape[:-1], 3, len(self.unknowns)))
        slope = self._slope(position_mm)
        for axis in range(3):
            out[..., axis, axis] = PRIOR.FIELD_TURN_SD_RAD
            out[..., axis, 3 + 3 * axis : 6 + 3 * axis] = slope
        return out

    def _slope(self, position_mm: Array) -> Array:
        """Return the derivative (..., 3) of any component of the rotation by its three slopes."""
        off_mm = position_mm - self.centre_mm
        far = np.linalg.norm(off_mm, axis=-1, keepdims=True) / max(self.reach_mm, 1.0)
        return np.asarray(PRIOR.FIELD_SLOPE_SD_RAD_PER_MM * off_mm / np.maximum(far, 1.0))

    def turn(self, position_mm: Array, x: Array) -> Array:
        """Compute the rotations that the field adds to receivers: B(t) of section 4.

        Parameters
        ----------
        position_mm : array, shape (..., 3)
            Positions in the transmitter frame.
        x : array, shape (G,)
            The hand's unknowns.

        Returns
        -------
        array, shape (..., 3, 3)
            Rotation matrices in the transmitter frame.

        """
        turn, slopes = np.split(x[self.unknowns], [3])
        return exp_rotation(
            PRIOR.FIELD_TURN_SD_RAD * turn + self._slope(position_mm) @ slopes.reshape(3, 3).T
        )


FrameSelection = Index | npt.NDArray[np.bool_] | slice

HUBER = 3.55
"""Norm of a receiver's six residuals in units of their sd beyond which they are weighted down; 95 % of normal
residuals are below it."""


@dataclass(frozen=True)
class Frames:
    """Measured poses of S receivers: rotation (F, S, 3, 3), position_mm (F, S, 3), valid (F, S)."""

    rotation: Array
    position_mm: Array
    valid: npt.NDArray[np.bool_]

    def take(self, rows: FrameSelection) -> Frames:
        """Select some of the frames."""
        return Frames(self.rotation[rows], self.position_mm[rows], self.valid[rows])


@dataclass(frozen=True, eq=False)
class Point:
    """Values of all unknowns: x (G,), y (F, S), root (F, 3, 3), root_mm (F, 3)."""

    x: Array
    y: Array
    root: Array
    root_mm: Array

    def take(self, rows: FrameSelection) -> Point:
        """Select some of the frames."""
        return Point(self.x, self.y[rows], self.root[rows], self.root_mm[rows])


@dataclass(frozen=True)
class Observations:
    """K measured linear combinations of x: rows (K, G) @ x = values (K,), in units of their sd."""

    rows: Array
    values: Array

    @classmethod
    def of(cls, rows: Sequence[Array], values: Sequence[float], n_unknowns: int) -> Observations:
        """Combine observations of one row each.

        Parameters
        ----------
        rows : sequence of array, shape (G,)
            Linear combinations of x, divided by their sd.
        values : sequence of float
            Measured values, divided by their sd.
        n_unknowns : int
            Number of unknowns G.

        Returns
        -------
        Observations
            The combined observations.

        """
        return cls(np.array(rows).reshape(-1, n_unknowns), np.array(values))

    def plus(self, other: Observations) -> Observations:
        """Concatenate two sets of observations."""
        return Observations(
            np.concatenate([self.rows, other.rows]), np.concatenate([self.values, other.values])
        )


@dataclass(frozen=True, eq=False)
class Problem:
    """The least-squares problem: chains, measured frames and priors.

    Attributes
    ----------
    branches : tuple of Branch
        Chains from the root.
    receivers : tuple
        For each branch, pairs (mark in the branch, receiver in frames).
    frames : Frames
        Measured poses of S receivers.
    sd : array, shape (S, 2)
        Sd of a receiver's position, mm, and rotation, rad, per component.
    temper : float
        Independent samples per frame.
    state_mean, state_sd : array
        Prior of the joint angles, rad.
    precision : array, shape (G,)
        Precision of the prior of x.
    observations : Observations
        Measurements of x.
    state_link : array, optional
        Matrix from states less their means to independent components with `state_sd`, as some states follow
        others of their branch.
    field : FieldDistortion, optional
        Distortion of the room's field, if it is fitted.

    """

    branches: tuple[Branch, ...]
    receivers: tuple[tuple[tuple[int, int], ...], ...]
    frames: Frames
    sd: Array
    temper: float
    state_mean: Array
    state_sd: Array
    precision: Array
    observations: Observations
    state_link: Array | None = None
    field: FieldDistortion | None = None

    def unknowns_of(self, index: int) -> Index:
        """List the unknowns on which the residuals of a branch depend, those of the field included.

        Parameters
        ----------
        index : int
            Index of the branch.

        Returns
        -------
        array of int, shape (g,)
            Indices into x; those of the field come last.

        """
        of_branch = self.branches[index].unknowns
        return of_branch if self.field is None else np.concatenate([of_branch, self.field.unknowns])

    def rotation(self, x: Array) -> Array:
        """Compute the receivers' rotations without the field's contribution.

        Parameters
        ----------
        x : array, shape (G,)
            The hand's unknowns.

        Returns
        -------
        array, shape (F, S, 3, 3)
            Receiver to transmitter frame.

        """
        if self.field is None:
            return self.frames.rotation
        return np.asarray(self.field.turn(self.frames.position_mm, -x) @ self.frames.rotation)

    def residuals_of(self, current: Residuals) -> Iterator[tuple[int, Array]]:
        """Yield the index of each receiver that is fitted, and its residuals (F, 6)."""
        for receivers, branch in zip(self.receivers, current.branches, strict=True):
            yield from ((s, r) for (_, s), r in zip(receivers, branch.r, strict=True))

    def state_prior(self, states: Index | slice = slice(None)) -> Array:
        """Compute a square root of the precision of the states' prior.

        Parameters
        ----------
        states : array of int or slice
            Indices of s states; all of them if omitted.

        Returns
        -------
        array, shape (s, s)
            R, 1/rad, such that R^T R is the precision.

        """
        link = np.eye(len(self.state_sd)) if self.state_link is None else self.state_link
        return np.asarray((link / self.state_sd[:, None])[states][:, states])


class BranchResiduals(NamedTuple):
    """One branch's residuals r (receivers, F, 6) in units of their sd, position before rotation and zero for
    receivers that are not valid; their robust weights (receivers, F); and the poses that the chain reached.
    """

    r: Array
    weight: Array
    reached: Reached


@dataclass(frozen=True)
class Residuals:
    """Residuals at a point by branch, the cost, and each frame's part (F,) of it.

    Residuals are in the frame of the measured receiver, so that they do not depend on the transmitter's pose.
    """

    branches: tuple[BranchResiduals, ...]
    cost: float
    frame_cost: Array


def axial_vector(rotation: Float[Array, "*n 3 3"]) -> Float[Array, "*n 3"]:
    """Compute 2 sin(angle) times the axis of rotations, from the antisymmetric part of the matrix.

    Parameters
    ----------
    rotation : array, shape (..., 3, 3)
        Rotation matrices.

    Returns
    -------
    array, shape (..., 3)
        Vectors, which vanish for half a turn as well as for none.

    """
    twice = rotation - rotation.swapaxes(-1, -2)
    return np.stack([twice[..., 2, 1], twice[..., 0, 2], twice[..., 1, 0]], -1)


def log_rotation(rotation: Float[Array, "*n 3 3"]) -> Float[Array, "*n 3"]:
    """Compute the rotation vectors of rotations, accurate for small angles and up to nearly pi.

    Parameters
    ----------
    rotation : array, shape (..., 3, 3)
        Rotation matrices.

    Returns
    -------
    array, shape (..., 3)
        Axis times angle, rad.

    """
    v = axial_vector(rotation) / 2
    sine = np.linalg.norm(v, axis=-1)
    cosine = (np.trace(rotation, axis1=-2, axis2=-1) - 1) / 2
    angle = np.arctan2(sine, cosine)
    factor = np.where(sine > 1e-9, angle / np.where(sine > 1e-9, sine, 1.0), 1.0)
    return np.asarray(v * factor[..., None])


@dataclass(frozen=True)
class Elimination:
    """Elimination of a branch's states: dy = -inverse^T (rhs + by_rest @ (d_root, dx)).

    inverse : (F, s, s) inverse Cholesky factor L^-1; by_rest : (F, s, 6 + g) L^-1 B; rhs : (F, s) L^-1 b;
    unknowns : (g,) indices into x.
    """

    inverse: Array
    by_rest: Array
    rhs: Array
    unknowns: Index


@dataclass(frozen=True)
class Reduced:
    """Normal equations with all states and roots eliminated.

    matrix : (G, G), gradient : (G,) of x. root_inverse : (F, 6, 6), root_by_x : (F, 6, G), root_rhs : (F, 6)
    for back substitution of the root, as in `Elimination`.
    """

    matrix: Array
    gradient: Array
    root_inverse: Array
    root_by_x: Array
    root_rhs: Array
    eliminated: tuple[Elimination, ...]


def states_by_unknowns(problem: Problem, reduced: Reduced, weights: Array) -> Array:
    """Compute how the mean posture moves with the hand's unknowns, by back substitution (section 7).

    Parameters
    ----------
    problem : Problem
        Problem as solved.
    reduced : Reduced
        Normal equations at the solution, undamped.
    weights : array, shape (F,)
        Share of each frame in the mean.

    Returns
    -------
    array, shape (S, G)
        Derivative of the mean joint angles, rad per unit of an unknown.

    """
    G = reduced.matrix.shape[0]
    d_root = -(reduced.root_inverse.swapaxes(-1, -2) @ reduced.root_by_x)
    out = np.zeros((len(problem.state_mean), G))
    for branch, part in zip(problem.branches, reduced.eliminated, strict=True):
        back = part.inverse.swapaxes(-1, -2) * weights[:, None, None]
        by_root = part.by_rest[..., :6]
        out[branch.states] -= np.einsum("fst,ftg->sg", back @ by_root, d_root, optimize=True)
        out[np.ix_(branch.states, part.unknowns)] -= (back @ part.by_rest[..., 6:]).sum(0)
    return out
