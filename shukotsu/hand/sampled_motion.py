"""Sample of a recording for the checks: some frames, with receiver axes along the bones, as a right hand."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shukotsu.arrays import Array, Bools
from shukotsu.hand.rotations import matrix
from shukotsu.study.layout import Layout

FRAMES = 60
"""Number of frames, spread over the recording, on which hypotheses are compared."""

MIRROR = np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class SampledMotion:
    """Poses of S receivers in K frames: position_mm (K, S, 3), rotation (K, S, 3, 3), valid (K, S).

    Columns of rotations are the distal, lateral and dorsal axes.
    """

    position_mm: Array
    rotation: Array
    valid: Bools

    def mirrored(self) -> SampledMotion:
        """Return the motion of the other hand: mirror the world and the bones' lateral axes."""
        rotation = self.rotation * MIRROR[:, None] * MIRROR
        return replace(self, position_mm=self.position_mm * MIRROR, rotation=rotation)


def receiver_axes(layout: Layout, segments: tuple[str, ...]) -> Array:
    """Return rotations from the distal, lateral and dorsal axes of segments to the axes of their receivers.

    Parameters
    ----------
    layout : Layout
        Layout of the hand, which states how each receiver is oriented on its bone.
    segments : tuple of str, length S
        Segments that carry receivers.

    Returns
    -------
    array, shape (S, 3, 3)
        Columns are the distal, lateral (dorsal x distal) and dorsal axis in the receiver's frame.

    """
    distal = np.array([layout.segments[name].distal for name in segments])
    dorsal = np.array([layout.segments[name].dorsal for name in segments])
    return np.stack([distal, np.cross(dorsal, distal), dorsal], -1)


def motion_of(position_mm: Array, quaternion: Array, valid: Bools, axes: Array, hand: str) -> SampledMotion:
    """Sample frames in which most receivers are valid, spread over a recording, as a right hand.

    Parameters
    ----------
    position_mm, quaternion : array, shape (T, S, 3) and (T, S, 4)
        Receivers in the transmitter frame.
    valid : array of bool, shape (T, S)
        Whether there is a pose.
    axes : array, shape (S, 3, 3)
        Axes as returned by `receiver_axes`.
    hand : str
        right or left; a left hand is mirrored.

    Returns
    -------
    SampledMotion
        Motion in at most FRAMES frames.

    """
    seen = valid.sum(1)
    rows = np.flatnonzero(seen >= 0.8 * seen.max()) if len(seen) and seen.max() else np.zeros(0, int)
    rows = rows[np.linspace(0, len(rows) - 1, min(FRAMES, len(rows))).round().astype(int)]
    usable = valid[rows]
    usable_mm = np.where(usable[..., None], position_mm[rows], 0.0)
    turn = np.where(usable[..., None], quaternion[rows], [1.0, 0.0, 0.0, 0.0])
    motion = SampledMotion(usable_mm, matrix(turn) @ axes, usable)
    return motion.mirrored() if hand == "left" else motion
