"""Eq. 1-7 in closed form: everything that the stacked least squares needs, in one pass over the data.

With R = R_a^T R_b and d = R_a^T (t_b - t_a) the gap of a joint, seen from the parent a, is
p - R q - d (Eq. 3). Its normal equations need only the mean of R and d and their second moments, so
frames can be added as they come and forgotten. Everything is kept relative to the joint's first pose
(R = R_0 (I + D)), because I - M M^T, computed as written, cancels to nothing for a joint that hardly
moves, while the covariance of D, which is the same matrix, does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array, conjugate, multiply, rotate

BATCH_FRAMES = 2
"""Frames averaged into one batch mean: short beside any motion of a hand, at 240 Hz and at 60 Hz."""

MAX_BATCHES = 1 << 16
"""Nine minutes at 240 Hz. Beyond this many, neighbouring batches are merged, so that memory does not grow
with the recording."""

_FEATURES = 12  # nine of D, row by row, then three of d


@dataclass(frozen=True)
class RelativePoses:
    """Child receivers seen from their parents, J joints over T frames.

    quaternion : (T, J, 4) child to parent frame; position_mm : (T, J, 3) child origin in the parent's
    frame; valid : (T, J). Where not valid, numbers may be NaN.
    """

    quaternion: Array
    position_mm: Array
    valid: npt.NDArray[np.bool_]


def relative_poses(
    quaternion: Array,
    position_mm: Array,
    valid: npt.NDArray[np.bool_],
    parents: npt.NDArray[np.int64],
    children: npt.NDArray[np.int64],
) -> RelativePoses:
    """Poses of child receivers relative to their parents.

    quaternion : (T, S, 4), position_mm : (T, S, 3), valid : (T, S) of S receivers in the transmitter
    frame; parents, children : (J,) indices into S.
    """
    to_parent = conjugate(quaternion[:, parents])
    offset = position_mm[:, children] - position_mm[:, parents]
    return RelativePoses(
        multiply(to_parent, quaternion[:, children]),
        rotate(to_parent, offset),
        valid[:, parents] & valid[:, children],
    )


class JointMoments:
    """First and second moments of J joints' relative poses, and their means over short batches.

    Add blocks of frames in the order of time; then read. Nothing kept grows without bound.
    """

    def __init__(self, n_joints: int) -> None:
        self.count: npt.NDArray[np.int64] = np.zeros(n_joints, np.int64)
        self.reference: Array = np.tile([1.0, 0.0, 0.0, 0.0], (n_joints, 1))
        self.reference_mm: Array = np.zeros((n_joints, 3))
        self._sum: Array = np.zeros((n_joints, _FEATURES))
        self._products: Array = np.zeros((n_joints, _FEATURES, _FEATURES))
        self._batch_sums: Array = np.zeros((n_joints, _FEATURES, 0))
        self._batch_counts: Array = np.zeros((n_joints, 0))

    def add(self, poses: RelativePoses) -> None:
        """Add a block of frames; its length should be a multiple of BATCH_FRAMES but for the last one."""
        if not len(poses.valid):
            return
        self._choose_references(poses)
        features = self._features(poses)
        self._sum += features.sum(-1)
        self._products += features @ features.transpose(0, 2, 1)
        self.count += poses.valid.sum(0)
        self._add_batches(features, poses.valid)

    def mean(self, joint: int) -> Array:
        """Mean of a joint's (D, d), shape (12,)."""
        return np.asarray(self._sum[joint] / max(self.count[joint], 1))

    def covariance(self, joint: int) -> Array:
        """Covariance of a joint's (D, d) over frames, shape (12, 12)."""
        mean = self.mean(joint)
        return np.asarray(self._products[joint] / max(self.count[joint], 1) - np.outer(mean, mean))

    def batch_means(self, joint: int) -> Array:
        """Means of a joint's (D, d) over short batches in the order of time, shape (B, 12)."""
        counts = self._batch_counts[joint]
        filled = counts > 0
        return np.asarray((self._batch_sums[joint][:, filled] / counts[filled]).T)

    def _choose_references(self, poses: RelativePoses) -> None:
        for joint in np.flatnonzero((self.count == 0) & poses.valid.any(0)):
            first = int(np.argmax(poses.valid[:, joint]))
            self.reference[joint] = poses.quaternion[first, joint]
            self.reference_mm[joint] = rotate(
                conjugate(poses.quaternion[first, joint]), poses.position_mm[first, joint]
            )

    def _features(self, poses: RelativePoses) -> Array:
        """(D, d) of every frame, zero where not valid, shape (J, 12, T)."""
        back = conjugate(self.reference)
        w, x, y, z = np.moveaxis(multiply(back, poses.quaternion), -1, 0)
        d_mm = rotate(back, poses.position_mm) - self.reference_mm
        features = np.empty((_FEATURES, *poses.valid.shape))
        features[0], features[4], features[8] = y * y + z * z, x * x + z * z, x * x + y * y
        features[[0, 4, 8]] *= -1.0
        features[1], features[2], features[3] = x * y - w * z, x * z + w * y, x * y + w * z
        features[5], features[6], features[7] = y * z - w * x, x * z - w * y, y * z + w * x
        features[:9] *= 2.0
        features[9:] = np.moveaxis(d_mm, -1, 0)
        features[:, ~poses.valid] = 0.0
        return np.ascontiguousarray(features.transpose(2, 0, 1))

    def _add_batches(self, features: Array, valid: npt.NDArray[np.bool_]) -> None:
        starts = np.arange(0, features.shape[-1], BATCH_FRAMES)
        sums = np.add.reduceat(features, starts, axis=-1)
        counts = np.add.reduceat(valid.T.astype(float), starts, axis=-1)
        self._batch_sums = np.concatenate([self._batch_sums, sums], -1)
        self._batch_counts = np.concatenate([self._batch_counts, counts], -1)
        while self._batch_counts.shape[-1] > MAX_BATCHES:
            pairs = np.arange(0, self._batch_counts.shape[-1], 2)
            self._batch_sums = np.add.reduceat(self._batch_sums, pairs, axis=-1)
            self._batch_counts = np.add.reduceat(self._batch_counts, pairs, axis=-1)
