"""Moments of the relative poses of joints, by which one pass over the data replaces the stack of Eq. 4-7.

With R = R_a^T R_b and d = R_a^T (t_b - t_a), the gap of a joint seen from the parent a is p - R q - d (Eq.
3). Its normal equations need only the means of R and d and their second moments, so frames are added as they
arrive and not stored. All moments are relative to the joint's first pose (R = R_0 (I + D)): for a joint that
hardly moves, I - M M^T suffers cancellation when computed as written, whereas the covariance of D, which is
the same matrix, does not.

Nine products of quaternion components are summed over frames; D is a linear function of them
(`_D_OF_PRODUCTS`). As I + D is a rotation, D^T D = -(D + D^T), so that the only second moments to accumulate
are those with d. docs/method.md, "The closed form", has the derivation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Bool, Bools, Float, Int, Integers
from shukotsu.hand.rotations import Array, conjugate, from_matrix, left_matrix, matrix, multiply, rotate

BATCH_FRAMES = 2
"""Number of frames averaged into a batch mean: short compared with any hand motion at 60 and 240 Hz."""

MAX_BATCHES = 1 << 16
"""Largest number of batches of a joint, nine minutes at 240 Hz. Longer recordings have longer batches, so
that memory is bounded.
"""

BLOCK_FRAMES = 8192
"""Number of frames that are processed at once; they fit into the processor's cache."""

_PRODUCTS, _FEATURES = 9, 12  # xx yy zz wx wy wz xy xz yz of the quaternion, then d (3,)

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
"""(9, 9): the entries of D, row by row, from the products of quaternion components.

It is the formula of a rotation matrix less the identity: D_xx = -2 (yy + zz), D_xy = 2 (xy - wz), and so on
(docs/method.md, "The closed form").
"""


@dataclass(frozen=True)
class RelativePoses:
    """Poses of J child receivers in their parents' frames over T frames.

    Attributes
    ----------
    quaternion : array, shape (T, J, 4)
        Unit quaternions (w, x, y, z), child to parent receiver frame (R of Eq. 3).
    position_mm : array, shape (T, J, 3)
        Origin of the child in the parent's frame, mm (d of Eq. 3).
    valid : array of bool, shape (T, J)
        Whether both receivers have a valid pose.

    """

    quaternion: Array
    position_mm: Array
    valid: npt.NDArray[np.bool_]

    def take(self, rows: slice) -> RelativePoses:
        """Select some of the frames."""
        return RelativePoses(self.quaternion[rows], self.position_mm[rows], self.valid[rows])


def relative_poses(
    quaternion: Float[Array, "T S 4"],
    position_mm: Float[Array, "T S 3"],
    valid: Bool[Bools, "T S"],
    parents: Int[Integers, " J"],
    children: Int[Integers, " J"],
) -> RelativePoses:
    """Compute poses of children relative to their parents, R = R_a^T R_b and d = R_a^T (t_b - t_a) of Eq. 3.

    Parameters
    ----------
    quaternion : array, shape (T, S, 4)
        Unit quaternions (w, x, y, z) of all receivers, receiver to transmitter frame.
    position_mm : array, shape (T, S, 3)
        Positions in the transmitter frame, mm.
    valid : array of bool, shape (T, S)
        Whether a receiver has a pose in a frame.
    parents, children : array of int, shape (J,)
        Indices of the receivers of each joint.

    Returns
    -------
    RelativePoses
        Relative poses of J joints.

    """
    shape = len(valid), len(parents)
    turn, place_mm = np.empty((*shape, 4), order="F"), np.empty((*shape, 3), order="F")
    for joint, (parent, child) in enumerate(zip(parents, children, strict=True)):  # one joint fits the cache
        back = conjugate(quaternion[:, parent])
        turn[:, joint] = multiply(back, quaternion[:, child])
        place_mm[:, joint] = rotate(back, position_mm[:, child] - position_mm[:, parent])
    return RelativePoses(turn, place_mm, valid[:, parents] & valid[:, children])


class JointMoments:
    """First and second moments of the relative poses of J joints, and their means over short batches.

    Blocks are added in order of time; results may be read after the last one.

    Parameters
    ----------
    n_joints : int
        Number of joints J.
    n_frames : int
        Expected number of frames, which sets the length of the batches; 0 for a short recording.

    Attributes
    ----------
    count : array of int, shape (J,)
        Valid frames of each joint.
    first_turn : array, shape (J, 3, 3)
        Rotation of each joint's first pose, child to parent receiver frame (R_0).
    reference_mm : array, shape (J, 3)
        Offset d of each joint's first pose in the frame of that pose, R_0^T d, mm.

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
        """Add frames, a multiple of BLOCK_FRAMES except in the last call."""
        for start in range(0, len(poses.valid), BLOCK_FRAMES):
            block = poses.take(slice(start, start + BLOCK_FRAMES))
            for joint in range(len(self.count)):
                self._add_joint(joint, block)

    def mean(self, joint: int) -> Array:
        """Compute the mean of D and d of a joint (docs/method.md, "The closed form").

        Parameters
        ----------
        joint : int
            Index of the joint.

        Returns
        -------
        array, shape (12,)
            D row by row, then d less that of the first pose, mm, in the frame of the first pose.

        """
        sums = self._sums[joint, :_FEATURES, 3]
        return np.asarray(self._in_first_pose(joint) @ sums / max(self.count[joint], 1))

    def spread(self, joint: int) -> tuple[Array, Array, float]:
        """Compute the covariances of D and d of a joint over frames (docs/method.md, "The closed form").

        Parameters
        ----------
        joint : int
            Index of the joint.

        Returns
        -------
        C_DD : array, shape (3, 3)
            Covariance of D, summed over its rows.
        C_Dd : array, shape (3,)
            Covariance of D with d, mm.
        C_dd : float
            Variance of d, summed over its components, mm^2.

        """
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
        """Compute the mean rotations of the batches relative to the first pose, in order of time.

        Parameters
        ----------
        joint : int
            Index of the joint.

        Returns
        -------
        array, shape (4, B)
            Unit quaternions (w, x, y, z), w > 0.

        """
        sums, counts = self._batches_of(joint)
        squares, turns = sums[:3] / counts, np.empty((4, len(counts)))
        w_squared = 1.0 - squares.sum(0)
        far = np.flatnonzero(w_squared < squares.max(0, initial=0.0))
        w_squared[far] = 1.0
        np.sqrt(w_squared, out=turns[0])
        np.divide(sums[3:6], counts * turns[0], out=turns[1:])
        if len(far):  # beyond about 120 deg w is small, and the matrix is better conditioned
            D = (_D_OF_PRODUCTS @ (sums[:_PRODUCTS, far] / counts[far])).T.reshape(-1, 3, 3)
            turns[:, far] = from_matrix(np.eye(3) + D).T
        return turns

    def batch_gaps_mm(self, joint: int, p_mm: Array, q_mm: Array) -> Array:
        """Compute the mean gaps of the batches for a centre, in order of time.

        Parameters
        ----------
        joint : int
            Index of the joint.
        p_mm, q_mm : array, shape (3,)
            Parent's and child's half of the centre, in the frame of the first pose.

        Returns
        -------
        array, shape (3, B)
            Gaps in the frame of the first pose, mm.

        """
        sums, counts = self._batches_of(joint)
        of_means = np.zeros((3, _FEATURES))
        for axis in range(3):
            of_means[axis, 3 * axis : 3 * axis + 3] = q_mm
            of_means[axis, 9 + axis] = 1.0
        gaps = (of_means @ self._in_first_pose(joint)) @ sums
        return np.asarray((p_mm - q_mm - self.reference_mm[joint])[:, None] - gaps / counts)

    def _in_first_pose(self, joint: int) -> Array:
        """Return the matrix (12, 12) from accumulated features to (D, d), d in the first pose's frame."""
        combined = np.zeros((_FEATURES, _FEATURES))
        combined[:9, :9] = _D_OF_PRODUCTS
        combined[9:, 9:] = self.first_turn[joint].T
        return combined

    def _batches_of(self, joint: int) -> tuple[Array, Array]:
        """Return sums (12, B) of the batches that have a valid frame, and their numbers of frames (B,)."""
        sums = np.concatenate([np.zeros((_FEATURES + 1, 0)), *self._batches[joint]], 1)
        self._batches[joint] = [sums]
        if not sums[_FEATURES].all():
            sums = sums[:, sums[_FEATURES] > 0]
        return sums[:_FEATURES], sums[_FEATURES]

    def _add_joint(self, joint: int, poses: RelativePoses) -> None:
        """Add one joint's frames to its moments and batches; frames that are not valid add nothing."""
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
        """Store a joint's first pose, quaternion (4,) and position (3,): the reference of its moments."""
        self._first[joint] = [*quaternion, *position_mm]
        self.first_turn[joint] = matrix(quaternion)
        self.reference_mm[joint] = rotate(conjugate(quaternion), position_mm)

    def _features(self, joint: int, quaternion: Array, position_mm: Array) -> Array:
        """Return features (13, T): quaternion products and d, relative to the first pose, and 1."""
        turn = left_matrix(conjugate(self._first[joint, :4])) @ quaternion.T
        features = np.empty((_FEATURES + 1, len(quaternion)))
        np.multiply(turn[1:], turn[1:], out=features[:3])
        np.multiply(turn[0], turn[1:], out=features[3:6])
        np.multiply(turn[1], turn[2:], out=features[6:8])
        np.multiply(turn[2], turn[3], out=features[8])
        np.subtract(position_mm.T, self._first[joint, 4:, None], out=features[_PRODUCTS:_FEATURES])
        features[_FEATURES] = 1.0
        return features
