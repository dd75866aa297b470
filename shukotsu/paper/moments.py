"""Eq. 1-7 in closed form: everything that the stacked least squares needs, in one pass over the data.

With R = R_a^T R_b and d = R_a^T (t_b - t_a) the gap of a joint, seen from the parent a, is
p - R q - d (Eq. 3). Its normal equations need only the mean of R and d and their second moments, so
frames can be added as they come and forgotten. Everything is kept relative to the joint's first pose
(R = R_0 (I + D)), because I - M M^T, computed as written, cancels to nothing for a joint that hardly
moves, while the covariance of D, which is the same matrix, does not.

Of a frame's rotation what is summed up is not D but nine products of its quaternion's numbers, of which D
is a linear function. D^T D is another, since D belongs to a rotation, so that the only second moments to be
taken are those with d.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.hand.rotations import Array, conjugate, from_matrix, left_matrix, matrix, multiply, rotate

BATCH_FRAMES = 2
"""Frames averaged into one batch mean: short beside any motion of a hand, at 240 Hz and at 60 Hz."""

MAX_BATCHES = 1 << 16
"""Nine minutes at 240 Hz. Batches of longer recordings are made longer, so that memory does not grow."""

BLOCK_FRAMES = 8192
"""Frames worked on at once: few enough for the processor's cache."""

_PRODUCTS, _FEATURES = 9, 12  # xx yy zz wx wy wz xy xz yz of the quaternion, then three of d

_D_OF_PRODUCTS = 2.0 * np.array(
    [
        [0, -1, -1, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 0, 0, -1, 1, 0, 0],
        [0, 0, 0, 0, 1, 0, 0, 1, 0],
        [0, 0, 0, 0, 0, 1, 1, 0, 0],
        [-1, 0, -1, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, -1, 0, 0, 0, 0, 1],
        [0, 0, 0, 0, -1, 0, 0, 1, 0],
        [0, 0, 0, 1, 0, 0, 0, 0, 1],
        [-1, -1, 0, 0, 0, 0, 0, 0, 0],
    ]
)
"""(9, 9): D, row by row, from the products."""


@dataclass(frozen=True)
class RelativePoses:
    """J child receivers in their parents' frames over T frames: (T, J, 4) and (T, J, 3) mm."""

    quaternion: Array
    position_mm: Array
    valid: npt.NDArray[np.bool_]

    def take(self, rows: slice) -> RelativePoses:
        """Only some of the frames."""
        return RelativePoses(self.quaternion[rows], self.position_mm[rows], self.valid[rows])


def relative_poses(
    quaternion: Array,
    position_mm: Array,
    valid: npt.NDArray[np.bool_],
    parents: npt.NDArray[np.int64],
    children: npt.NDArray[np.int64],
) -> RelativePoses:
    """Poses of child receivers relative to their parents; parents, children : (J,) indices of S."""
    shape = len(valid), len(parents)
    turn, place_mm = np.empty((*shape, 4), order="F"), np.empty((*shape, 3), order="F")
    for joint, (parent, child) in enumerate(zip(parents, children, strict=True)):  # few enough for the cache
        back = conjugate(quaternion[:, parent])
        turn[:, joint] = multiply(back, quaternion[:, child])
        place_mm[:, joint] = rotate(back, position_mm[:, child] - position_mm[:, parent])
    return RelativePoses(turn, place_mm, valid[:, parents] & valid[:, children])


class JointMoments:
    """First and second moments of J joints' relative poses, and their means over short batches.

    Add blocks in the order of time; then read. n_frames : to come, which sets the length of batches; 0 where
    few. first_turn, reference_mm : a joint's first pose, matrix (3, 3), child to parent, and d (3,) turned
    into the child's frame.
    """

    def __init__(self, n_joints: int, n_frames: int = 0) -> None:
        self.count: npt.NDArray[np.int64] = np.zeros(n_joints, np.int64)
        self.reference_mm: Array = np.zeros((n_joints, 3))
        self.first_turn: Array = np.tile(np.eye(3), (n_joints, 1, 1))
        self._first: Array = np.zeros((n_joints, 7))
        self._sums: Array = np.zeros((n_joints, _FEATURES + 1, 4))
        self._batch_frames = BATCH_FRAMES
        while n_frames > MAX_BATCHES * self._batch_frames < MAX_BATCHES * BLOCK_FRAMES:
            self._batch_frames *= 2
        self._batches: list[list[Array]] = [[] for _ in range(n_joints)]

    def add(self, poses: RelativePoses) -> None:
        """Add frames; their number should be a multiple of BLOCK_FRAMES but for the last ones."""
        for start in range(0, len(poses.valid), BLOCK_FRAMES):
            block = poses.take(slice(start, start + BLOCK_FRAMES))
            for joint in range(len(self.count)):
                self._add_joint(joint, block)

    def mean(self, joint: int) -> Array:
        """Mean of a joint's (D, d), shape (12,)."""
        sums = self._sums[joint, :_FEATURES, 3]
        return np.asarray(self._in_first_pose(joint) @ sums / max(self.count[joint], 1))

    def spread(self, joint: int) -> tuple[Array, Array, float]:
        """Covariances of D and d over frames, summed over their three rows: of D (3, 3), D with d (3,), d."""
        n, mean = max(self.count[joint], 1), self.mean(joint)
        D, d = mean[:9].reshape(3, 3), mean[9:]
        second = self._sums[joint, :_FEATURES, :3] / n
        across = (_D_OF_PRODUCTS @ second[:_PRODUCTS] @ self.first_turn[joint]).reshape(3, 3, 3)
        return (
            -(D + D.T) - D.T @ D,  # D^T D = -(D + D^T), as I + D is a rotation
            np.einsum("rir->i", across) - D.T @ d,
            float(np.trace(second[_PRODUCTS:]) - d @ d),
        )

    def batch_turns(self, joint: int) -> Array:
        """Mean rotations from the first pose, quaternions (4, B), w > 0, of short batches in order."""
        sums, counts = self._batches_of(joint)
        squares, turns = sums[:3] / counts, np.empty((4, len(counts)))
        w_squared = 1.0 - squares.sum(0)
        far = np.flatnonzero(w_squared < squares.max(0, initial=0.0))
        w_squared[far] = 1.0
        np.sqrt(w_squared, out=turns[0])
        np.divide(sums[3:6], counts * turns[0], out=turns[1:])
        if len(far):  # more than some 120 deg, where another formula is better conditioned
            D = (_D_OF_PRODUCTS @ (sums[:_PRODUCTS, far] / counts[far])).T.reshape(-1, 3, 3)
            turns[:, far] = from_matrix(np.eye(3) + D).T
        return turns

    def batch_gaps_mm(self, joint: int, p_mm: Array, q_mm: Array) -> Array:
        """Mean gaps (3, B) over the same batches of a centre (p, q), all in the frame of the first pose."""
        sums, counts = self._batches_of(joint)
        of_means = np.zeros((3, _FEATURES))
        for axis in range(3):
            of_means[axis, 3 * axis : 3 * axis + 3] = q_mm
            of_means[axis, 9 + axis] = 1.0
        gaps = (of_means @ self._in_first_pose(joint)) @ sums
        return np.asarray((p_mm - q_mm - self.reference_mm[joint])[:, None] - gaps / counts)

    def _in_first_pose(self, joint: int) -> Array:
        """(12, 12) that makes (D, d) of features as they are summed up, d in the frame of the first pose."""
        combined = np.zeros((_FEATURES, _FEATURES))
        combined[:9, :9] = _D_OF_PRODUCTS
        combined[9:, 9:] = self.first_turn[joint].T
        return combined

    def _batches_of(self, joint: int) -> tuple[Array, Array]:
        """Sums (12, B) of the batches that have a frame, and their frames (B,)."""
        sums = np.concatenate([np.zeros((_FEATURES + 1, 0)), *self._batches[joint]], 1)
        self._batches[joint] = [sums]
        if not sums[_FEATURES].all():
            sums = sums[:, sums[_FEATURES] > 0]
        return sums[:_FEATURES], sums[_FEATURES]

    def _add_joint(self, joint: int, poses: RelativePoses) -> None:
        valid = poses.valid[:, joint]
        n_valid = int(np.count_nonzero(valid))
        if not n_valid:
            return
        quaternion, position_mm = poses.quaternion[:, joint], poses.position_mm[:, joint]
        if not self.count[joint]:
            self._start(joint, quaternion[valid][0], position_mm[valid][0])
        features = self._features(joint, quaternion, position_mm)
        if n_valid < len(valid):
            features[:, ~valid] = 0.0
        self.count[joint] += n_valid
        self._sums[joint] += features @ features[_PRODUCTS:].T
        starts = np.arange(0, len(valid), self._batch_frames)
        self._batches[joint].append(np.add.reduceat(features, starts, axis=1))

    def _start(self, joint: int, quaternion: Array, position_mm: Array) -> None:
        """Keep a joint's first pose (4,), (3,), to which all others are taken relative."""
        self._first[joint] = [*quaternion, *position_mm]
        self.first_turn[joint] = matrix(quaternion)
        self.reference_mm[joint] = rotate(conjugate(quaternion), position_mm)

    def _features(self, joint: int, quaternion: Array, position_mm: Array) -> Array:
        """Products of the quaternions (T, 4) from the first pose, d relative to it, and 1: (13, T)."""
        turn = left_matrix(conjugate(self._first[joint, :4])) @ quaternion.T
        features = np.empty((_FEATURES + 1, len(quaternion)))
        np.multiply(turn[1:], turn[1:], out=features[:3])
        np.multiply(turn[0], turn[1:], out=features[3:6])
        np.multiply(turn[1], turn[2:], out=features[6:8])
        np.multiply(turn[2], turn[3], out=features[8])
        np.subtract(position_mm.T, self._first[joint, 4:, None], out=features[_PRODUCTS:_FEATURES])
        features[_FEATURES] = 1.0
        return features
