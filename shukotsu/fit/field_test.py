"""Test whether a hand fits better if the field is disturbed, so that receivers have errors that depend on
place.

Beside a steel plate the error of a receiver depends on its position alone, so that all receivers show the
same error at the same place. The error is modelled as growing towards a source beside the hand. Many
positions of the source are tried, and the six components of the error are tested to first order, like
displacements of receivers (`displacement_test`).

On paper: docs/whole-hand.md, section 11.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from shukotsu.fit.compiled_equations import residuals
from shukotsu.fit.displacement_test import Eliminated, most_within
from shukotsu.fit.normal_equations import Frames, Point, Problem
from shukotsu.hand.rotations import Array, unit

DISTANCES_MM = (60.0, 180.0)
"""Distances from the nearest receiver to the source: an object beside the hand, or a plate."""

POWER = 3.0
"""Exponent with which the field falls with the distance from its source."""

ROOM_REACH_MM, ROOM_SD = 200.0, (0.9, float(np.radians(1.8)))
"""Distance over which an ordinary room's field changes, and the sd of its errors, mm and rad per component:
1.5 times the 3 mm per metre and 0.3 deg per 50 mm of an ordinary laboratory."""

MOST_SITES = 30
"""Largest number of sites, half of that distance apart, at which the room's field may differ; a hand does not
move through more."""

USUAL = (1.0, float(np.radians(1.5)))
"""Error beside a source, mm and rad, below which a disturbance is ignored."""

DISTURBED_SD = (4.0, float(np.radians(4.0)))
"""Prior sd of the error beside steel, mm and rad per component."""

GROSS = (15.0, float(np.radians(15.0)))
"""Residual, mm and rad, that is too large to be due to metal, as the disturbed receivers also move the pose
to which it refers."""

LEAST_FIELD_GAIN = 12.0
"""Log likelihood that metal must explain beyond an ordinary room's field. In simulated hands without metal it
is 6 at most, and 11 with two or three times the usual skin artefact."""

_PRIOR = np.diag(np.repeat(DISTURBED_SD, 3) ** -2.0)


@dataclass(frozen=True)
class Disturbance:
    """An error of the tracker that grows towards a piece of metal.

    Parameters
    ----------
    source : array, shape (3,)
        Place of the metal, mm in the transmitter's frame.
    nearest : array, shape (3,)
        Place at which a receiver came nearest to it.
    error : array, shape (6,)
        Error there, mm and rad in the transmitter's axes.

    """

    source: Array
    nearest: Array
    error: Array

    def at(self, position_mm: Array) -> Array:
        """Return the error of receivers at some positions.

        Parameters
        ----------
        position_mm : array, shape (..., 3)
            Positions in the transmitter frame.

        Returns
        -------
        array, shape (..., 6)
            Error of position (mm) and rotation (rad).

        """
        return np.asarray(self.share(position_mm)[..., None] * self.error)

    def share(self, position_mm: Array) -> Array:
        """Return the share of `error` that receivers have at some positions; it falls with their distance.

        Parameters
        ----------
        position_mm : array, shape (..., 3)
            Positions in the transmitter frame.

        Returns
        -------
        array, shape (...)
            1 at the distance of the nearest receiver and below.

        """
        away = np.linalg.norm(position_mm - self.source, axis=-1)
        nearest = np.linalg.norm(self.nearest - self.source)
        return np.asarray((nearest / np.maximum(away, nearest)) ** POWER)


SAME = 1e-4
"""Largest scatter, in mm and in elements of the rotation matrix, of a pose that was computed to be constant;
measured poses scatter more."""


def fields(places: Array) -> list[Disturbance]:
    """List possible sources of a disturbance in all directions around the positions of the receivers.

    Parameters
    ----------
    places : array, shape (P, 3)
        Receivers in the transmitter frame, mm.

    Returns
    -------
    list of Disturbance
        Sources with an error of zero.

    """
    directions = unit(np.array([n for n in product((-1.0, 0.0, 1.0), repeat=3) if any(n)]))
    farthest = places[np.argmax(places @ directions.T, axis=0)]
    return [
        Disturbance(nearest + distance * outward, nearest, np.zeros(6))
        for outward, nearest in zip(directions, farthest, strict=True)
        for distance in DISTANCES_MM
    ]


def likeliest_field(problem: Problem, point: Point) -> tuple[Disturbance, float]:
    """Find the likeliest disturbance of the field (docs/whole-hand.md, section 11).

    Parameters
    ----------
    problem, point
        Problem as solved, and its solution.

    Returns
    -------
    disturbance : Disturbance
        Its source, and its error at the nearest receiver position.
    gain : float
        Log likelihood that it explains beyond an ordinary room's field; 0 if poses are relative to one of the
        receivers, so that positions in the room are unknown, or if no pose fits the hand even roughly.

    """
    none = Disturbance(np.zeros(3), np.zeros(3), np.zeros(6))
    if _is_relative(problem.frames):
        return none, 0.0
    valid = problem.frames.valid.copy()
    for s, r in problem.residuals_of(residuals(problem, point)):
        off = np.linalg.norm(r.reshape(-1, 2, 3), axis=-1) * problem.sd[s]
        valid[:, s] &= (off <= GROSS).all(1)  # larger residuals are hemisphere errors or spikes
    if not valid.any():  # such as centimetres read as millimetres
        return none, 0.0
    frames = replace(problem.frames, valid=valid)
    if (valid != problem.frames.valid).any():
        problem = replace(problem, frames=frames)
    tried = fields(frames.position_mm[frames.valid])
    share = np.stack([field.share(frames.position_mm) for field in tried], -1)
    slope, curvature = _by_amounts(problem, point, np.concatenate([share, _room(frames)], -1))
    n = len(tried)
    sources, room = slice(0, 6 * n), slice(6 * n, None)
    sd = np.tile(np.repeat(ROOM_SD, 3), (len(slope) - 6 * n) // 6)
    taken = np.linalg.solve(curvature[room, room] + np.diag(sd**-2.0), curvature[sources, room].T)
    slopes = (slope[sources] - taken.T @ slope[room]).reshape(n, 6)
    blocks = (curvature[sources, sources] - curvature[sources, room] @ taken).reshape(n, 6, n, 6)
    curvatures = blocks[np.arange(n), :, np.arange(n)]
    error = -np.linalg.solve(curvatures + _PRIOR, slopes[..., None])[..., 0]
    gain = -(slopes * error).sum(-1) / 2
    abnormal = gain - most_within(np.tile(np.repeat(USUAL, 3), (n, 1)), slopes, curvatures)
    best = int(np.argmax(abnormal))
    return replace(tried[best], error=error[best]), float(abnormal[best])


def _is_relative(frames: Frames) -> bool:
    """Return whether a receiver has an identical pose in all frames, which no tracker measures."""
    poses = np.concatenate([frames.position_mm[..., None], frames.rotation], -1)  # (F, S, 3, 4)
    spreads = [np.ptp(poses[seen, s], axis=0).max() for s, seen in enumerate(frames.valid.T) if seen.any()]
    return bool(min(spreads, default=np.inf) < SAME)


def _room(frames: Frames) -> Array:
    """Return B basis functions of an ordinary room's field at the receivers, (F, S, B), of unit variance."""
    places = frames.position_mm[frames.valid]
    sites = [places[np.argmax(((places - places.mean(0)) ** 2).sum(1))]]
    distance = ((places - sites[0]) ** 2).sum(1)
    while distance.max() > (ROOM_REACH_MM / 2) ** 2 and len(sites) < MOST_SITES:
        sites.append(places[np.argmax(distance)])
        distance = np.minimum(distance, ((places - sites[-1]) ** 2).sum(1))
    near = [
        np.exp(-((at[..., None, :] - np.array(sites)) ** 2).sum(-1) / (2 * ROOM_REACH_MM**2))
        for at in (frames.position_mm, np.array(sites))
    ]
    lower = np.linalg.cholesky(near[1] + 1e-3 * np.eye(len(sites)))
    return np.asarray(near[0] @ np.linalg.inv(lower).T)


def _by_amounts(problem: Problem, point: Point, share: Array) -> tuple[Array, Array]:
    """Return the slope (6 K,) and curvature (6 K, 6 K) of the cost by the size of K errors.

    Errors are in mm and rad in the transmitter's axes; share : (F, S, K) of each that a receiver has in a
    frame.
    """
    left, frames = Eliminated.of(problem, point), problem.frames
    n_frames, n_errors = len(share), share.shape[-1]
    slope, curvature = np.zeros((n_errors, 6)), np.zeros((n_errors, 6, n_errors, 6))
    by_root, by_x = np.zeros((n_frames, 6, n_errors, 6)), np.zeros((n_errors, 6, len(point.x)))
    over_poses = ((0, 1), (0, 1))
    for branch in left.branches:
        receivers = list(branch.receivers)
        of_each = share[:, receivers]  # (F, n, K)

        def turned(values: Array, receivers: list[int] = receivers) -> Array:
            """Convert derivatives by displacements (F, 6 n, ...) to the transmitter's axes (F, n, 6, ...)."""
            halves = values.reshape(n_frames, len(receivers), 2, 3, -1)
            there = frames.rotation[:, receivers, None] @ halves
            return np.asarray(there.reshape(n_frames, len(receivers), 6, *values.shape[2:]))

        root = turned(branch.root)
        by_root += np.einsum("fsar,fsk->frka", root, of_each, optimize=True)
        stiff = turned(branch.curvature + branch.root @ branch.root.swapaxes(-1, -2))
        stiff = turned(np.moveaxis(stiff, 3, 1).reshape(n_frames, -1, len(receivers) * 6))
        stiff = stiff.reshape(n_frames, len(receivers), 6, len(receivers), 6)
        one_side = np.einsum("fsbta,ftk->fskab", stiff, of_each, optimize=True)
        curvature += np.tensordot(one_side, of_each, over_poses).transpose(0, 1, 3, 2)
        by_x += np.tensordot(of_each, turned(branch.by_x), over_poses)
        slope += np.tensordot(of_each, turned(branch.slope), over_poses)
    n_amounts = 6 * n_errors
    flat_root, absorbed = by_root.reshape(-1, n_amounts), left.whitened(by_x)
    curved = curvature.reshape(n_amounts, n_amounts) - flat_root.T @ flat_root - absorbed.T @ absorbed
    return slope.ravel() - absorbed.T @ left.gradient, curved
