"""Test whether a hand fits better if the field is disturbed: an error that all receivers share at a place.

Beside a steel plate the error of a receiver depends on its position alone, so that all receivers must show
the same error at the same place. The error grows towards a source beside the hand, whose
place is looked for; its six amounts are tested to first order as displacements of receivers are
(`displacement_test`).

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
"""Any room's own field changes over so much, and by so many mm and rad per component: half as much again as
the 3 mm a metre and 0.3 deg for 50 mm of an ordinary laboratory."""

MOST_SITES = 30
"""Half of that reach apart, at which it may differ: more are no place where a hand moves."""

USUAL = (1.0, float(np.radians(1.5)))
"""mm and rad beside a source below which a disturbance is ignored."""

DISTURBED_SD = (4.0, float(np.radians(4.0)))
"""The same per component beside steel."""

GROSS = (15.0, float(np.radians(15.0)))
"""mm and rad beyond which a residual cannot be due to metal, as the hand is posed to receivers that are off
too."""

LEAST_FIELD_GAIN = 12.0
"""Log likelihood that metal must explain beyond what any room has: on simulated hands 6 is the most without
metal, 11 with two or three times the usual skin artefact."""

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
        """Error of receivers at some places.

        Parameters
        ----------
        position_mm : array, shape (..., 3)
            In the transmitter frame.

        Returns
        -------
        array, shape (..., 6)
            Error of position (mm) and rotation (rad).

        """
        return np.asarray(self.share(position_mm)[..., None] * self.error)

    def share(self, position_mm: Array) -> Array:
        """Share of `error` that receivers have at some places; it falls with the distance from the metal.

        Parameters
        ----------
        position_mm : array, shape (..., 3)
            In the transmitter frame.

        Returns
        -------
        array, shape (...)
            1 at the nearest receiver and nearer.

        """
        away = np.linalg.norm(position_mm - self.source, axis=-1)
        nearest = np.linalg.norm(self.nearest - self.source)
        return np.asarray((nearest / np.maximum(away, nearest)) ** POWER)


SAME = 1e-4
"""mm, and elements of a rotation, by which a pose that is computed scatters at most, and no measured one."""


def fields(places: Array) -> list[Disturbance]:
    """List sources that may disturb the field, all round the places where receivers were.

    Parameters
    ----------
    places : array, shape (P, 3)
        Receivers in the transmitter frame, mm.

    Returns
    -------
    list of Disturbance
        Each with an error of zero.

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
        What was solved, and where.

    Returns
    -------
    disturbance : Disturbance
        Its source, and its error where a receiver came nearest.
    gain : float
        Log likelihood that it explains beyond an ordinary room's field; 0 for poses relative to one of the
        receivers, which hold no position in the room.

    """
    if _is_relative(problem.frames):
        return Disturbance(np.zeros(3), np.zeros(3), np.zeros(6)), 0.0
    valid = problem.frames.valid.copy()
    for s, r in problem.residuals_of(residuals(problem, point)):
        off = np.linalg.norm(r.reshape(-1, 2, 3), axis=-1) * problem.sd[s]
        valid[:, s] &= (off <= GROSS).all(1)  # otherwise a hemisphere error, or a spike
    frames = replace(problem.frames, valid=valid)
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
    """Whether a receiver has an identical pose in all frames, which no tracker measures."""
    poses = np.concatenate([frames.position_mm[..., None], frames.rotation], -1)  # (F, S, 3, 4)
    spreads = [np.ptp(poses[seen, s], axis=0).max() for s, seen in enumerate(frames.valid.T) if seen.any()]
    return bool(min(spreads, default=np.inf) < SAME)


def _room(frames: Frames) -> Array:
    """Basis functions (F, S, B) of an ordinary room's field at the receivers, each with unit variance."""
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
    """Slope (6 K,) and curvature (6 K, 6 K) of the cost by the amounts, mm and rad in the transmitter's axes,
    of K errors of which each receiver has its share (F, S, K) in each frame.
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
            """What is by displacements (F, 6 n, ...) by the transmitter's axes, (F, n, 6, ...)."""
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
    flat_root, flat_x = by_root.reshape(-1, n_amounts), by_x.reshape(n_amounts, -1)
    pulled = flat_x @ left.covariance
    curved = curvature.reshape(n_amounts, n_amounts) - flat_root.T @ flat_root - pulled @ flat_x.T
    return slope.ravel() - pulled @ left.gradient, curved
