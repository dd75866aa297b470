"""Centre, axis and uncertainty of one joint (Eq. 1-7), as printed and in closed form (docs/method.md).

`solve_stacked` is the paper's solver: the rotations of all frames are stacked and inverted by SVD.
`solve_closed` computes the same numbers from the joint's moments, that is in one pass over the data. The
former is kept because it is the paper's, and because the closed form is tested against it.

In the closed form all vectors and matrices are in the frame of the joint's first pose, in which the parent's
and the child's axes coincide. `solve_closed` converts the results to the receiver frames of parent and child.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.arrays import Array, Float
from shukotsu.hand.rotations import matrix
from shukotsu.hand.series import angle_range, effective_samples, flattening
from shukotsu.paper.moments import JointMoments

EXACT_HINGE = 5e-13
"""Smallest squared singular value, over the number of frames, below which it is only rounding error.

The joint is then a hinge without noise, whose sixth unknown is undetermined.
"""

_SINGULAR = 1e-12
"""Threshold on 1 - s^2: below it the joint did not move. It corresponds to 1e-6 rad rms, far below any
tracker's noise.
"""


@dataclass(frozen=True)
class SolvedJoint:
    """Solution of Eq. 5-7 for one joint.

    The joint centre is p in the parent's receiver frame and q in the child's. null_parent and null_child are
    the halves of the null vector: a slide of p and q along them changes the gap least (the SARA axis).

    Attributes
    ----------
    p_mm, q_mm : array, shape (3,)
        Joint centre in the parent's and the child's receiver frame, mm.
    null_parent, null_child : array, shape (3,)
        Unit vector of the axis in the parent's and the child's receiver frame.
    singular_values : array, shape (6,)
        Singular values of the stack (Eq. 4) over the root of the number of frames, descending.

    """

    p_mm: Array
    q_mm: Array
    null_parent: Array
    null_child: Array
    singular_values: Array


@dataclass(frozen=True)
class JointSolution(SolvedJoint):
    """Solution of Eq. 1-7 for one joint, with the precision of its centre and axis.

    Attributes
    ----------
    mean_rotation : array, shape (3, 3)
        Mean of R_a^T R_b, child to parent receiver frame; not orthogonal unless the joint is still.
    covariance_mm2 : array, shape (6, 6)
        Covariance of (p, q), mm^2; without the null direction if only five singular values are inverted.
    gap_rms_mm, gap_rms_free_mm : float
        Root mean square gap of this centre, and of the centre with all six singular values inverted.
    slide_to_free_mm : float
        Distance along the axis from this centre to that of the six-value solution.
    range_deg, spread_deg : float
        Range and standard deviation of the angle about the axis.
    axis_sd_deg : float
        Standard deviation of the axis direction.
    n_frames : int
        Frames in which both receivers are valid.
    n_effective : float
        Number of independent samples among them, from the autocorrelation of the gap.

    """

    mean_rotation: Array
    covariance_mm2: Array
    gap_rms_mm: float
    gap_rms_free_mm: float
    slide_to_free_mm: float
    range_deg: float
    spread_deg: float
    axis_sd_deg: float
    n_frames: int
    n_effective: float


def solve_stacked(
    parent_quaternion: Float[Array, "N 4"],
    parent_position_mm: Float[Array, "N 3"],
    child_quaternion: Float[Array, "N 4"],
    child_position_mm: Float[Array, "N 3"],
    n_singular_values: int,
) -> SolvedJoint:
    """Solve one joint by Eq. 5-7: x = V W^-1 U^T b, without the smallest singular values.

    Parameters
    ----------
    parent_quaternion, child_quaternion : array, shape (N, 4)
        Unit quaternions (w, x, y, z), receiver to transmitter frame, in N >= 2 frames, all valid.
    parent_position_mm, child_position_mm : array, shape (N, 3)
        Positions in the transmitter frame, mm.
    n_singular_values : int
        6 as printed, or 5 to leave the position along a hinge's axis open.

    Returns
    -------
    SolvedJoint
        Centre, axis and singular values.

    """
    n = len(parent_position_mm)
    stack = np.concatenate([matrix(child_quaternion), -matrix(parent_quaternion)], -1).reshape(3 * n, 6)
    right = (parent_position_mm - child_position_mm).reshape(3 * n)
    u, w, vt = np.linalg.svd(stack, full_matrices=False)
    kept = slice(0, 5 if w[5] ** 2 < EXACT_HINGE * n else n_singular_values)
    x = vt[kept].T @ ((u[:, kept].T @ right) / w[kept])
    null_parent, null_child = (half / np.linalg.norm(half) for half in (vt[5, 3:], vt[5, :3]))
    return SolvedJoint(x[3:], x[:3], null_parent, null_child, singular_values=w / np.sqrt(n))


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations of one joint in the frame of its first pose (docs/method.md, "The closed form").

    A frame with rotation I + D and offset d has the gap p - (I + D) q - d. At the minimum p = M q + u.

    Attributes
    ----------
    R0 : array, shape (3, 3)
        First pose of the joint: rotation from the child's to the parent's receiver frame.
    M : array, shape (3, 3)
        Mean of I + D.
    u, w : array, shape (3,)
        Means of d and of (I + D)^T d, mm.
    C_DD : array, shape (3, 3)
        Covariance of D over frames, summed over its rows; equal to I - M^T M.
    C_Dd : array, shape (3,)
        Covariance of D with d, mm.
    C_dd : float
        Variance of d, summed over its components, mm^2.

    """

    R0: Array
    M: Array
    u: Array
    w: Array
    C_DD: Array
    C_Dd: Array
    C_dd: float

    def gap_rms_mm(self, p: Array, q: Array) -> float:
        """Compute the root mean square gap of a centre over frames (Eq. 3).

        Parameters
        ----------
        p, q : array, shape (3,)
            Parent's and child's half of the centre, mm, in the frame of the first pose.

        Returns
        -------
        float
            Rms gap, mm.

        """
        offset = p - self.M @ q - self.u
        return float(np.sqrt(max(float(offset @ offset) + self.gap_variance(q), 0.0)))

    def gap_variance(self, q: Array) -> float:
        """Compute the variance of the gap over frames, summed over its components; it depends on q alone.

        Parameters
        ----------
        q : array, shape (3,)
            Child's half, mm, in the frame of the first pose.

        Returns
        -------
        float
            Variance, mm^2.

        """
        return float(q @ self.C_DD @ q + 2 * q @ self.C_Dd + self.C_dd)


def is_solvable(moments: JointMoments, joint: int) -> bool:
    """Return whether the joint moved enough to determine at least five of its six unknowns.

    Parameters
    ----------
    moments : JointMoments
        Moments of all joints.
    joint : int
        Index of the joint in `moments`.

    Returns
    -------
    bool
        False if fewer than two frames are valid or the joint did not move.

    """
    if moments.count[joint] < 2:
        return False
    return bool(np.linalg.eigvalsh(moments.spread(joint)[0])[1] > _SINGULAR)


def solve_closed(moments: JointMoments, joint: int, n_singular_values: int) -> JointSolution:
    """Solve one joint by Eq. 5-7 from its moments; the same centre as `solve_stacked`.

    docs/method.md, "The closed form", derives the normal equations, their eigenvectors and the covariance.

    Parameters
    ----------
    moments : JointMoments
        Moments of all joints, complete.
    joint : int
        Index of a joint for which `is_solvable` holds.
    n_singular_values : int
        6 inverts all singular values, as printed; 5 leaves the position along the axis to the plane. A joint
        that is a hinge to rounding is always solved with 5.

    Returns
    -------
    JointSolution
        Centre, axis, covariance and angle statistics, in the receiver frames of parent and child.

    """
    normal = normal_equations(moments, joint)
    one_minus_s2, V = np.linalg.eigh(normal.C_DD)
    one_minus_s2 = np.maximum(one_minus_s2, 0.0)
    if one_minus_s2[0] < 2 * EXACT_HINGE:
        n_singular_values = 5
    if V[np.argmax(np.abs(V[:, 0])), 0] < 0:
        V[:, 0] *= -1
    s = np.sqrt(np.maximum(1.0 - one_minus_s2, 0.0))
    U = _left_vectors(normal.M, V)
    p, q = _centre(normal, one_minus_s2, s, U, V, n_singular_values)
    free = (p, q) if one_minus_s2[0] < 2 * EXACT_HINGE else _centre(normal, one_minus_s2, s, U, V, 6)
    gap = normal.gap_rms_mm(p, q)
    n_frames = int(moments.count[joint])
    n_effective = effective_samples(moments.batch_gaps_mm(joint, p, q).T, normal.gap_variance(q), n_frames)
    turns = moments.batch_turns(joint)
    off_axis = effective_samples((2 * V[:, 1:].T @ turns[1:]).T, float(one_minus_s2[0]), n_frames)
    angle_deg = _angles_deg(turns, V[:, 0])
    small = one_minus_s2 / (1.0 + s)  # 1 - s without cancellation
    apart, together = np.concatenate([U, -V]), np.concatenate([U, V])
    weights = np.where(np.arange(3) >= 6 - n_singular_values, 1.0 / np.maximum(small, _SINGULAR), 0.0)
    # inverse of [[I, -M], [-M^T, I]] by its eigenvectors (docs/method.md), without the directions left out
    inverse = np.asarray((apart / (1.0 + s)) @ apart.T + (together * weights) @ together.T) / 2
    covariance = gap**2 / 3 / n_effective * inverse
    turn = np.eye(6)
    turn[:3, :3] = normal.R0
    return JointSolution(
        p_mm=normal.R0 @ p,
        q_mm=q,
        null_parent=normal.R0 @ U[:, 0],
        null_child=V[:, 0],
        mean_rotation=normal.R0 @ normal.M,
        singular_values=np.sqrt(np.concatenate([1.0 + s, small[::-1]])),
        covariance_mm2=turn @ covariance @ turn.T,
        gap_rms_mm=gap,
        gap_rms_free_mm=normal.gap_rms_mm(*free),
        slide_to_free_mm=float((free[1] - q) @ V[:, 0]),
        range_deg=angle_range(angle_deg, flattening(np.radians(angle_deg))),
        spread_deg=float(np.std(angle_deg)),
        axis_sd_deg=_axis_sd_deg(one_minus_s2, off_axis),
        n_frames=n_frames,
        n_effective=n_effective,
    )


def normal_equations(moments: JointMoments, joint: int) -> NormalEquations:
    """Build the normal equations of one joint from its moments (docs/method.md, "The closed form").

    Parameters
    ----------
    moments : JointMoments
        Moments of all joints.
    joint : int
        Index of a joint with at least one valid frame.

    Returns
    -------
    NormalEquations
        Normal equations in the frame of the joint's first pose.

    """
    mean = moments.mean(joint)
    C_DD, C_Dd, C_dd = moments.spread(joint)
    M, u = np.eye(3) + mean[:9].reshape(3, 3), moments.reference_mm[joint] + mean[9:]
    w = M.T @ u + C_Dd  # mean of R^T d = product of the means + covariance
    return NormalEquations(moments.first_turn[joint], M, u, w, C_DD, C_Dd, C_dd)


def _left_vectors(M: Array, V: Array) -> Array:
    """Return left singular vectors of M (3, 3) for its right ones V, orthonormal even if M is singular."""
    U = np.empty((3, 3))
    for i in range(3):
        column = M @ V[:, i]
        column -= U[:, :i] @ (U[:, :i].T @ column)
        length = float(np.linalg.norm(column))
        if length < 1e-8:
            column = np.linalg.svd(U[:, :i].T)[2][-1] if i else V[:, i]
            length = 1.0
        U[:, i] = column / length
    return U


def _centre(
    normal: NormalEquations, one_minus_s2: Array, s: Array, U: Array, V: Array, n_singular_values: int
) -> tuple[Array, Array]:
    """Compute the least-squares p and q, (3,) mm.

    With five singular values, the components on the axis (pair 0) follow from the singular value 1 + s alone
    (Eq. 7).
    """
    right = -(V.T @ normal.C_Dd)
    solved = np.arange(3) >= (6 - n_singular_values)
    components = np.where(solved, right / np.where(solved, one_minus_s2, 1.0), 0.0)
    q = V @ components
    p = normal.M @ q + normal.u
    if n_singular_values == 5:
        q0 = -(normal.w @ V[:, 0] + normal.u @ U[:, 0]) / (2 * (1 + s[0]))
        q = q + q0 * V[:, 0]
        p = p - (p @ U[:, 0] + q0) * U[:, 0]
    return p, q


def _axis_sd_deg(one_minus_s2: Array, n_effective: float) -> float:
    """Compute the standard deviation of the axis direction, at most 90 deg.

    To first order an eigenvector turns by the covariance over the difference of the variances; 1 - s_i^2 is
    the sum of the variances about the two other axes. n_effective is the number of independent samples of the
    rotation off the axis, which drifts with the skin even if the gap is white noise.
    """
    variance = one_minus_s2.sum() / 2 - one_minus_s2
    spread = np.maximum(variance[0] - variance[1:], 1e-30)
    turn = np.sqrt(np.sum(variance[0] * np.maximum(variance[1:], 0.0) / spread**2) / n_effective)
    return float(min(np.degrees(turn), 90.0))


def _angles_deg(turns: Array, axis: Array) -> Array:
    """Return angles (B,), deg, of unit quaternions (4, B) about the axis, relative to their circular mean."""
    half = turns[0] + 1j * (axis @ turns[1:])
    whole = half * half
    whole /= np.abs(whole)
    return np.asarray(np.degrees(np.angle(whole * np.conj(whole.mean()))))
