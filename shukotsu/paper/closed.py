"""The joint's centre, axis and uncertainty from its moments (see `moments`), shape by shape.

Everything here is in the frame of the joint's first pose, in which parent and child axes coincide at that
pose; `solve_closed` turns the results into the parent's and the child's receiver frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.hand.rotations import Array
from shukotsu.hand.series import angle_range, effective_samples, flattening
from shukotsu.paper.moments import JointMoments
from shukotsu.paper.stacked import EXACT_HINGE

_SINGULAR = 1e-12
"""1 - s^2 below this is no motion at all: 1e-6 rad rms, far under any tracker's noise."""


@dataclass(frozen=True)
class JointSolution:
    """One joint as Eq. 1-7 give it, and how well the data fix it.

    p_mm, q_mm : (3,) centre in both receivers' frames. null_parent, null_child : (3,) unit, along which (p,
    q) may slide together (SARA axis); slide_to_free_mm : from this centre to that of the six-value fit.
    mean_rotation : (3, 3) mean of R_a^T R_b. singular_values : (6,) of the stack over sqrt(frames).
    covariance_mm2 : (6, 6) of (p, q), without the null direction when five singular values are inverted.
    """

    p_mm: Array
    q_mm: Array
    null_parent: Array
    null_child: Array
    mean_rotation: Array
    singular_values: Array
    covariance_mm2: Array
    gap_rms_mm: float
    gap_rms_free_mm: float
    slide_to_free_mm: float
    range_deg: float
    spread_deg: float
    axis_sd_deg: float
    n_frames: int
    n_effective: float


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations of one joint, in the frame of its first pose.

    M, u, w : means of R, d and R^T d (at the minimum p = M q + u). C_DD = I - M^T M, C_Dd, C_dd : covariances
    of D and d.
    """

    R0: Array
    M: Array
    u: Array
    w: Array
    C_DD: Array
    C_Dd: Array
    C_dd: float

    def gap_rms_mm(self, p: Array, q: Array) -> float:
        """Root mean square gap of the centre (p, q), p in the frame of the first pose."""
        offset = p - self.M @ q - self.u
        return float(np.sqrt(max(float(offset @ offset) + self.gap_variance(q), 0.0)))

    def gap_variance(self, q: Array) -> float:
        """Variance of the gap over single frames, summed over its components."""
        return float(q @ self.C_DD @ q + 2 * q @ self.C_Dd + self.C_dd)


def is_solvable(moments: JointMoments, joint: int) -> bool:
    """Whether the joint moved at all: five of its six unknowns have an answer."""
    if moments.count[joint] < 2:
        return False
    return bool(np.linalg.eigvalsh(moments.spread(joint)[0])[1] > _SINGULAR)


def solve_closed(moments: JointMoments, joint: int, n_singular_values: int) -> JointSolution:
    """Solve one solvable joint, as `stacked.solve_stacked`; n_singular_values : 5 leaves the axis open."""
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
    inverse = np.asarray((apart / (1.0 + s)) @ apart.T + (together * weights) @ together.T) / 2
    covariance = gap**2 / 3 / n_effective * inverse  # of [[I, -M], [-M^T, I]], zero where left out
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
    """The normal equations of a joint that has a frame."""
    mean = moments.mean(joint)
    C_DD, C_Dd, C_dd = moments.spread(joint)
    M, u = np.eye(3) + mean[:9].reshape(3, 3), moments.reference_mm[joint] + mean[9:]
    w = M.T @ u + C_Dd  # mean of R^T d: product of the means and covariance
    return NormalEquations(moments.first_turn[joint], M, u, w, C_DD, C_Dd, C_dd)


def _left_vectors(M: Array, V: Array) -> Array:
    """Left singular vectors of M that belong to its right ones; orthonormal also where M is singular."""
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
    """Least-squares p and q; with five values only 1 + s of pair 0, the axis, is solved (Eq. 7)."""
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
    """1-sigma direction error of the axis, at most 90 deg.

    To first order an eigenvector turns by covariance over difference of variance; 1 - s_i^2 is the sum of the
    other two's. n_effective counts the rotation off the axis, which wanders with the skin however white the
    gap is.
    """
    variance = one_minus_s2.sum() / 2 - one_minus_s2
    spread = np.maximum(variance[0] - variance[1:], 1e-30)
    turn = np.sqrt(np.sum(variance[0] * np.maximum(variance[1:], 0.0) / spread**2) / n_effective)
    return float(min(np.degrees(turn), 90.0))


def _angles_deg(turns: Array, axis: Array) -> Array:
    """Angles (B,) about the axis of quaternions (4, B), relative to their circular mean, deg."""
    half = turns[0] + 1j * (axis @ turns[1:])
    whole = half * half
    whole /= np.abs(whole)
    return np.asarray(np.degrees(np.angle(whole * np.conj(whole.mean()))))
