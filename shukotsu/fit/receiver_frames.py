"""Convert poses to the frames of the fit, with common receiver axes and always for a right hand; choose
frames.

On paper: docs/whole-hand.md, sections 1 and 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.arrays import Float, Int, Integers
from shukotsu.fit.normal_equations import Frames
from shukotsu.fit.operations import Index
from shukotsu.hand.rotations import Array, matrix
from shukotsu.hand.sampled_motion import MIRROR, receiver_axes
from shukotsu.study.layout import Layout
from shukotsu.tables.poses import Poses

FINGER_MM = 80.0
"""Change of a distance that is equivalent to a rotation by one radian (our choice)."""

MOST_CANDIDATES = 1500
"""Largest number of candidate frames; more would only be neighbouring frames of the same postures."""


@dataclass(frozen=True)
class Convention:
    """Conversion between receivers' original frames and those of the fit: x distal, z dorsal, a right hand.

    Left hands are fitted as mirror images.

    Attributes
    ----------
    receivers : tuple of str
        Segments of S receivers.
    axes : array, shape (S, 3, 3)
        Columns are the distal, lateral (z x x) and dorsal axis in the receiver's original frame.
    left : bool
        Whether the hand is a left one.

    """

    receivers: tuple[str, ...]
    axes: Array
    left: bool

    @classmethod
    def of(cls, layout: Layout, receivers: Sequence[str], hand: str) -> Convention:
        """Return the convention of a layout's receivers."""
        return cls(tuple(receivers), receiver_axes(layout, tuple(receivers)), hand == "left")

    def frames(self, poses: Poses) -> Frames:
        """Convert poses to frames of the fit; invalid poses are replaced by finite placeholders.

        Parameters
        ----------
        poses : Poses
            F frames.

        Returns
        -------
        Frames
            Frames of S receivers with axes along their bones, as a right hand.

        """
        index = [poses.index(name) if name in poses.segments else -1 for name in self.receivers]
        worn = np.array(index) >= 0
        quaternion, position = poses.quaternion[:, index], poses.position_mm[:, index]
        valid = poses.valid[:, index] & worn
        valid &= np.isfinite(quaternion).all(-1) & np.isfinite(position).all(-1)
        quaternion = np.where(valid[..., None], quaternion, [1.0, 0.0, 0.0, 0.0])
        position = np.where(valid[..., None], position, 0.0)
        return Frames(*self.world(matrix(quaternion) @ self.axes, position), valid)

    def point(self, receiver: str, points_mm: Array) -> Array:
        """Convert points from the fit's frame of a receiver to its original frame.

        Parameters
        ----------
        receiver : str
            Segment that carries it.
        points_mm : array, shape (..., 3)
            Points in the fit's frame.

        Returns
        -------
        array, shape (..., 3)
            Points in the receiver's original frame, mm.

        """
        return np.asarray(points_mm @ self.point_matrix(receiver).T)

    def axis(self, receiver: str, axes: Array) -> Array:
        """Convert axes of rotation, which mirror as pseudo-vectors, to a receiver's original frame.

        Parameters
        ----------
        receiver : str
            Segment that carries it.
        axes : array, shape (..., 3)
            Axes in the fit's frame.

        Returns
        -------
        array, shape (..., 3)
            Axes in the receiver's original frame.

        """
        return np.asarray((-axes if self.left else axes) @ self.point_matrix(receiver).T)

    def point_matrix(self, receiver: str) -> Array:
        """Return the matrix (3, 3) by which `point` multiplies; NaN for a segment without a receiver."""
        if receiver not in self.receivers:
            return np.full((3, 3), np.nan)
        axes_of_receiver = self.axes[self.receivers.index(receiver)]
        return np.asarray(axes_of_receiver * MIRROR if self.left else axes_of_receiver)

    def world(self, rotation: Array, position_mm: Array) -> tuple[Array, Array]:
        """Convert bone poses back to the transmitter's frame; bones keep x distal and z dorsal.

        Parameters
        ----------
        rotation : array, shape (..., 3, 3)
            Rotations from bones to the world frame of the fit (mirrored for a left hand).
        position_mm : array, shape (..., 3)
            Positions in that frame.

        Returns
        -------
        tuple of array
            The same poses in the transmitter's frame.

        """
        if not self.left:
            return rotation, position_mm
        return rotation * np.outer(MIRROR, MIRROR), position_mm * MIRROR


def neighbours(layout: Layout, worn: Sequence[str]) -> list[tuple[str, str]]:
    """Return pairs of each worn receiver's nearest worn neighbour towards the body, and that receiver."""
    before = {joint.child: joint.parent_receiver for joint in layout.solvable}
    pairs = []
    for child in worn:
        parent = before.get(child)
        while parent is not None and parent not in worn:
            parent = before.get(parent)
        if parent is not None:
            pairs.append((parent, child))
    return pairs


def postures(frames: Frames, pairs: Sequence[tuple[int, int]]) -> Array:
    """Compute features of the posture in each frame: rotations between pairs of receivers.

    Parameters
    ----------
    frames : Frames
        T frames.
    pairs : sequence of tuple
        Indices of the receivers of each pair.

    Returns
    -------
    array, shape (T, 9 P)
        Rotation matrices of the P pairs that are valid together in some frame; their mean in other frames.

    """
    features = []
    for parent, child in pairs:
        relative = np.swapaxes(frames.rotation[:, parent], -1, -2) @ frames.rotation[:, child]
        both = frames.valid[:, parent] & frames.valid[:, child]
        if both.any():
            mean = relative[both].mean(0)
            features.append(np.where(both[:, None, None], relative, mean).reshape(-1, 9))
    if not features:
        return np.zeros((len(frames.valid), 1))
    return np.concatenate(features, 1)


def spread_frames(
    postures: Float[Array, "T D"], n_frames: int
) -> tuple[Int[Integers, " n"], Float[Array, " n"]]:
    """Choose frames by farthest-point sampling: each is the farthest from all previous ones (Gonzalez 1985).

    The first one is the farthest from the mean of all.

    Parameters
    ----------
    postures : array, shape (T, D)
        Features of the frames.
    n_frames : int
        Largest number of frames to choose.

    Returns
    -------
    rows : array of int, shape (n,)
        Chosen frames in order of time.
    share : array, shape (n,)
        Share of all frames that are nearest to each chosen one.

    """
    step = max(1, len(postures) // MOST_CANDIDATES)
    candidates = postures[::step]
    distance = ((candidates - candidates.mean(0)) ** 2).sum(1)
    chosen = [int(np.argmax(distance))]
    nearest: Index = np.zeros(len(candidates), int)
    distance = ((candidates - candidates[chosen[0]]) ** 2).sum(1)
    while len(chosen) < min(n_frames, len(candidates)) and distance.max() > 0.0:
        chosen.append(int(np.argmax(distance)))
        other = ((candidates - candidates[chosen[-1]]) ** 2).sum(1)
        closer = other < distance
        nearest[closer] = len(chosen) - 1
        distance = np.where(closer, other, distance)
    share = np.bincount(nearest, minlength=len(chosen)) / len(candidates)
    order = np.argsort(chosen)
    return np.array(chosen)[order] * step, share[order]
