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

from kinematics.rotations import (
    Array,
    conjugate,
    from_matrix,
    left_matrix,
    matrix,
    relative_parts,
    rotate,
    rotate_back_parts,
)
from schemas.poses import ReceiverSeries

BATCH_FRAMES = 2
"""Frames averaged into one batch mean: short beside any motion of a hand, at 240 Hz and at 60 Hz."""

MAX_BATCHES = 1 << 16
"""Nine minutes at 240 Hz. Beyond this many, neighbouring batches are merged and later ones are made as long,
so that memory does not grow with the recording."""

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
    """Child receivers seen from their parents, J joints over T frames; worked out when asked for.

    parents, children : J receivers each over the same T frames, None for one that never was there.
    """

    parents: tuple[ReceiverSeries | None, ...]
    children: tuple[ReceiverSeries | None, ...]
    n_frames: int

    def valid(self, joint: int) -> npt.NDArray[np.bool_]:
        """Whether both poses may be used, shape (T,)."""
        parent, child = self.parents[joint], self.children[joint]
        if parent is None or child is None:
            return np.zeros(self.n_frames, bool)
        return parent.valid & child.valid

    def quaternion(self, joint: int, out: Array | None = None) -> Array:
        """Child to parent frame, number by number, shape (4, T): into `out` where it is given.

        Where not valid, numbers may be NaN.
        """
        parent, child = self._both(joint)
        return relative_parts(parent.quaternion, child.quaternion, out)

    def position_mm(self, joint: int, out: Array | None = None) -> Array:
        """Child's origin in the parent's frame, number by number, shape (3, T); otherwise as `quaternion`."""
        parent, child = self._both(joint)
        offset = [there - here for here, there in zip(parent.position_mm, child.position_mm, strict=True)]
        return rotate_back_parts(parent.quaternion, offset, out)

    def of(self, joint: int, rows: slice | npt.NDArray[np.int64]) -> RelativePoses:
        """One joint in some of the frames, as the only one."""
        parent, child = self.parents[joint], self.children[joint]
        n_frames = len(range(self.n_frames)[rows]) if isinstance(rows, slice) else len(rows)
        return RelativePoses(
            (None if parent is None else parent.take(rows),),
            (None if child is None else child.take(rows),),
            n_frames,
        )

    def _both(self, joint: int) -> tuple[ReceiverSeries, ReceiverSeries]:
        parent, child = self.parents[joint], self.children[joint]
        if parent is None or child is None:
            raise ValueError(f"joint {joint}: a receiver that never was there has no pose")
        return parent, child


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
    series = {
        receiver: ReceiverSeries(
            tuple(np.ascontiguousarray(position_mm[:, receiver].T)),
            tuple(np.ascontiguousarray(quaternion[:, receiver].T)),
            valid[:, receiver],
        )
        for receiver in {*parents.tolist(), *children.tolist()}
    }
    return RelativePoses(
        tuple(series[parent] for parent in parents.tolist()),
        tuple(series[child] for child in children.tolist()),
        len(valid),
    )


class JointMoments:
    """First and second moments of J joints' relative poses, and their means over short batches.

    Add blocks of frames in the order of time; then read. Nothing kept grows without bound.
    reference, first_turn, reference_mm : a joint's first pose, as quaternion (4,) and matrix (3, 3), child to
    parent frame, and d (3,) turned into the child's frame there. n_frames : how many will come, where that is
    known, so that batches are of the right length at once.
    """

    def __init__(self, n_joints: int, n_frames: int = 0) -> None:
        self.count: npt.NDArray[np.int64] = np.zeros(n_joints, np.int64)
        self.reference: Array = np.tile([1.0, 0.0, 0.0, 0.0], (n_joints, 1))
        self.reference_mm: Array = np.zeros((n_joints, 3))
        self.first_turn: Array = np.tile(np.eye(3), (n_joints, 1, 1))
        self._first_mm: Array = np.zeros((n_joints, 3))
        self._sums: Array = np.zeros((n_joints, _FEATURES + 1, 4))
        self._batch_frames = BATCH_FRAMES
        while n_frames > MAX_BATCHES * self._batch_frames < MAX_BATCHES * BLOCK_FRAMES:
            self._batch_frames *= 2
        self._batches: list[Array] = []
        self._features: Array = np.empty((_FEATURES + 1, BLOCK_FRAMES))
        self._scratch: Array = np.empty((11, BLOCK_FRAMES))  # kept, since new memory costs more than the sums

    @property
    def nbytes(self) -> int:
        """Memory that grows with the recording, up to MAX_BATCHES."""
        return sum(part.nbytes for part in self._batches)

    def add(self, poses: RelativePoses) -> None:
        """Add a block of frames; its length should be a multiple of BATCH_FRAMES but for the last one."""
        for start in range(0, poses.n_frames, BLOCK_FRAMES):
            rows = slice(start, min(start + BLOCK_FRAMES, poses.n_frames))
            n_batches = -(-(rows.stop - start) // self._batch_frames)
            batches = np.zeros((len(self.count), _FEATURES + 1, n_batches))
            for joint, own in enumerate(batches):
                self._add_joint(joint, poses.of(joint, rows), own)
            self._batches.append(batches)
            while sum(part.shape[-1] for part in self._batches) > MAX_BATCHES:
                self._merge_batches()

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
        found = np.zeros((_FEATURES, _FEATURES))
        found[:9, :9] = _D_OF_PRODUCTS
        found[9:, 9:] = self.first_turn[joint].T
        return found

    def _batches_of(self, joint: int) -> tuple[Array, Array]:
        """Sums (12, B) of the batches that have a frame, and their frames (B,)."""
        parts = [part[joint] for part in self._batches] or [np.zeros((_FEATURES + 1, 0))]
        sums = np.concatenate(parts, 1) if len(parts) > 1 else parts[0]
        counts = sums[_FEATURES]
        if not counts.all():
            sums = sums[:, counts > 0]
        return sums[:_FEATURES], sums[_FEATURES]

    def _add_joint(self, joint: int, poses: RelativePoses, batches: Array) -> None:
        """Add frames of one joint, and what `batches` (13, B) are to hold, which are zero."""
        valid = poses.valid(0)
        n_valid = int(np.count_nonzero(valid))
        if not n_valid:
            return
        quaternion = poses.quaternion(0, self._scratch[:4, : poses.n_frames])
        position_mm = poses.position_mm(0, self._scratch[4:7, : poses.n_frames])
        if not self.count[joint]:
            first = int(np.argmax(valid))
            self.reference[joint], self._first_mm[joint] = quaternion[:, first], position_mm[:, first]
            self.first_turn[joint] = matrix(self.reference[joint])
            self.reference_mm[joint] = rotate(conjugate(self.reference[joint]), self._first_mm[joint])
        features = self._features[:, : batches.shape[1] * self._batch_frames]
        features[:, poses.n_frames :] = 0.0
        own = features[:, : poses.n_frames]
        self._fill(own, joint, quaternion, position_mm)
        if n_valid < len(valid):
            own[:, np.flatnonzero(~valid)] = 0.0
        self.count[joint] += n_valid
        self._sums[joint] += own @ own[_PRODUCTS:].T
        if self._batch_frames == 2:  # the quickest way of each
            np.add(features[:, ::2], features[:, 1::2], out=batches)
        else:
            width = self._batch_frames
            batches[...] = (features.reshape(-1, width) @ np.ones(width)).reshape(batches.shape)

    def _fill(self, features: Array, joint: int, quaternion: Array, position_mm: Array) -> None:
        """Products of quaternions (4, T), d relative to the first pose and 1 of every frame into (13, T)."""
        turn = self._scratch[7:, : quaternion.shape[1]]
        np.matmul(left_matrix(conjugate(self.reference[joint])), quaternion, out=turn)
        np.multiply(turn[1:], turn[1:], out=features[:3])
        np.multiply(turn[0], turn[1:], out=features[3:6])
        np.multiply(turn[1], turn[2:], out=features[6:8])
        np.multiply(turn[2], turn[3], out=features[8])
        np.subtract(position_mm, self._first_mm[joint][:, None], out=features[_PRODUCTS:_FEATURES])
        features[_FEATURES] = 1.0

    def _merge_batches(self) -> None:
        """Merge neighbouring batches, and neighbouring parts of them, so that their number does not grow."""
        for at in range(-(-len(self._batches) // 2)):
            both = np.concatenate([self._batches.pop(at) for _ in self._batches[at : at + 2]], -1)
            n_even = both.shape[-1] // 2 * 2
            pairs = both[..., :n_even:2] + both[..., 1:n_even:2]
            self._batches.insert(at, np.concatenate([pairs, both[..., n_even:]], -1))
        self._batch_frames = min(2 * self._batch_frames, BLOCK_FRAMES)
