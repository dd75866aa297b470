"""From pose tables to frames that can be fitted: one convention for every receiver, a right hand always."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinematics.rotations import Array, matrix
from schemas.layout import Layout
from schemas.poses import Poses
from stages.fit_hand.normal_equations import Frames

MIRROR = np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Convention:
    """How receivers' own frames become x distal, z dorsal of a right hand, and back.

    axes : (S, 3, 3) columns distal, lateral (z x x) and dorsal in the receiver's own frame; left : whether
    the hand is a left one, which is fitted as its mirror image.
    """

    receivers: tuple[str, ...]
    axes: Array
    left: bool

    @classmethod
    def of(cls, layout: Layout, receivers: Sequence[str], hand: str) -> Convention:
        """Give the convention of a layout's receivers."""
        axes = []
        for name in receivers:
            distal, dorsal = np.array(layout.segments[name].distal), np.array(layout.segments[name].dorsal)
            axes.append(np.stack([distal, np.cross(dorsal, distal), dorsal], -1))
        return cls(tuple(receivers), np.array(axes), hand == "left")

    def frames(self, poses: Poses) -> Frames:
        """Poses as frames; what is not valid gets harmless numbers."""
        index = [poses.index(name) if name in poses.segments else -1 for name in self.receivers]
        worn = np.array(index) >= 0
        quaternion, position = poses.quaternion[:, index], poses.position_mm[:, index]
        valid = poses.valid[:, index] & worn
        valid &= np.isfinite(quaternion).all(-1) & np.isfinite(position).all(-1)
        quaternion = np.where(valid[..., None], quaternion, [1.0, 0.0, 0.0, 0.0])
        position = np.where(valid[..., None], position, 0.0)
        rotation = matrix(quaternion) @ self.axes
        if self.left:
            rotation, position = rotation * np.outer(MIRROR, MIRROR), position * MIRROR
        return Frames(rotation, position, valid)

    def point(self, receiver: str, points_mm: Array) -> Array:
        """Points (..., 3) in the fitted receiver's frame, given in the receiver's own."""
        return np.asarray(points_mm @ self.point_matrix(receiver).T)

    def axis(self, receiver: str, axes: Array) -> Array:
        """Axes of rotation (..., 3), which mirror as pseudo-vectors, in the receiver's own frame."""
        return np.asarray((-axes if self.left else axes) @ self.point_matrix(receiver).T)

    def point_matrix(self, receiver: str) -> Array:
        """Matrix (3, 3) that `point` multiplies with; NaN for a segment without a receiver."""
        if receiver not in self.receivers:
            return np.full((3, 3), np.nan)
        own = self.axes[self.receivers.index(receiver)]
        return np.asarray(own * MIRROR if self.left else own)

    def world(self, rotation: Array, position_mm: Array) -> tuple[Array, Array]:
        """Bone poses (..., 3, 3), (..., 3) back in the transmitter's frame; x stays distal, z dorsal."""
        if not self.left:
            return rotation, position_mm
        return rotation * np.outer(MIRROR, MIRROR), position_mm * MIRROR


def joined(parts: Sequence[Frames]) -> Frames:
    """Frames of several recordings, one after the other."""
    return Frames(
        np.concatenate([part.rotation for part in parts]),
        np.concatenate([part.position_mm for part in parts]),
        np.concatenate([part.valid for part in parts]),
    )


def postures(frames: Frames, pairs: Sequence[tuple[int, int]]) -> Array:
    """Rotation matrices between pairs of receivers, (T, 9 pairs); a pair's mean where one is missing."""
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
