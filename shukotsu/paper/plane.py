"""The plane of section 4: where it cuts a joint's axis, the effect on the uncertainty, and manual
corrections.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.arrays import Float
from shukotsu.hand.rotations import Array, nearest_rotation, unit
from shukotsu.paper.closed import JointSolution
from shukotsu.study.layout import Plane


@dataclass(frozen=True)
class Projection:
    """Joint centre on its plane.

    Attributes
    ----------
    p_mm, q_mm : array, shape (3,)
        Centre in the parent's and the child's receiver frame, mm.
    slide_mm : float
        Signed distance moved along the axis.
    axis_plane_deg : float or None
        Angle between axis and plane, 0 to 90 deg; None without a plane.
    covariance_mm2 : array, shape (6, 6)
        Covariance of (p, q), mm^2.

    """

    p_mm: Array
    q_mm: Array
    slide_mm: float
    axis_plane_deg: float | None
    covariance_mm2: Array


def project(solution: JointSolution, plane: Plane) -> Projection | None:
    """Slide both halves of a centre along the axis by the same amount, onto the plane (end of section 4).

    Separate planes for the two halves would leave a constant gap along the axis. Solutions with five and with
    six singular values differ only along the axis and therefore project to the same point.

    Parameters
    ----------
    solution : JointSolution
        The joint's centre, axis and covariance.
    plane : Plane
        Point (mm) and normal in the parent's or the child's receiver frame.

    Returns
    -------
    Projection or None
        None where the axis lies in the plane.

    """
    p_mm, q_mm, covariance_mm2 = solution.p_mm, solution.q_mm, solution.covariance_mm2
    axis_parent, axis_child = solution.null_parent, solution.null_child
    axis_sd_rad, in_parent = float(np.radians(solution.axis_sd_deg)), plane.frame == "parent"
    normal = unit(np.array(plane.normal))
    point_mm, axis_in_plane = (p_mm, axis_parent) if in_parent else (q_mm, axis_child)
    sine = float(axis_in_plane @ normal)
    if abs(sine) < 1e-9:
        return None
    slide = float((np.array(plane.point_mm) - point_mm) @ normal) / sine
    null = np.concatenate([axis_parent, axis_child])
    cut = np.concatenate([normal, np.zeros(3)] if in_parent else [np.zeros(3), normal])
    onto_plane = np.eye(6) - np.outer(null, cut) / sine
    covariance = covariance_mm2.copy()  # an axis error moves each half sideways by half the variance
    for part, axis in ((slice(0, 3), axis_parent), (slice(3, 6), axis_child)):
        covariance[part, part] += (np.eye(3) - np.outer(axis, axis)) * (slide * axis_sd_rad) ** 2 / 2
    return Projection(
        p_mm=p_mm + slide * axis_parent,
        q_mm=q_mm + slide * axis_child,
        slide_mm=slide,
        axis_plane_deg=float(np.degrees(np.arcsin(min(abs(sine), 1.0)))),
        covariance_mm2=onto_plane @ covariance @ onto_plane.T,
    )


def leave_uncut(solution: JointSolution) -> Projection:
    """Centre of the six-value solution, for a joint without a plane.

    Parameters
    ----------
    solution : JointSolution
        The joint's five-value centre, the distance along the axis to the six-value one, and the covariance
        without the axis direction.

    Returns
    -------
    Projection
        With axis_plane_deg None. The variance along the null vector is that of a sample of the gap over the
        squared smallest singular value.

    """
    slide_mm = solution.slide_to_free_mm
    per_sample_mm2 = solution.gap_rms_free_mm**2 / 3 / solution.n_effective
    along_mm2 = per_sample_mm2 / max(float(solution.singular_values[5]) ** 2, 1e-12)
    null = np.concatenate([solution.null_parent, solution.null_child]) / np.sqrt(2)
    across = np.eye(6) - np.outer(null, null)
    return Projection(
        p_mm=solution.p_mm + slide_mm * solution.null_parent,
        q_mm=solution.q_mm + slide_mm * solution.null_child,
        slide_mm=slide_mm,
        axis_plane_deg=None,
        covariance_mm2=across @ solution.covariance_mm2 @ across.T + along_mm2 * np.outer(null, null),
    )


def correct(
    p_mm: Float[Array, " 3"],
    q_mm: Float[Array, " 3"],
    shift_mm: Float[Array, " 3"],
    mean_rotation: Float[Array, "3 3"],
) -> tuple[Float[Array, " 3"], Float[Array, " 3"]]:
    """Apply a manual correction (section 6) to a joint centre.

    Parameters
    ----------
    p_mm, q_mm : array, shape (3,)
        Centre in the parent's and the child's receiver frame, mm.
    shift_mm : array, shape (3,)
        Correction in the child's receiver frame, mm.
    mean_rotation : array, shape (3, 3)
        Mean rotation from the child's to the parent's frame, by which the parent's half moves.

    Returns
    -------
    tuple of array, shape (3,)
        Corrected p and q, mm.

    """
    return p_mm + nearest_rotation(mean_rotation) @ shift_mm, q_mm + shift_mm


def centre_sd_mm(covariance_mm2: Float[Array, "6 6"]) -> float:
    """Three-dimensional standard deviation of a centre from the covariance (6, 6) of (p, q): of the worse
    half, mm.
    """
    variance = np.maximum(np.diag(covariance_mm2), 0.0)
    return float(np.sqrt(max(variance[:3].sum(), variance[3:].sum())))


def gap_rms_mm(
    solution: JointSolution,
    slide_mm: float,
    shift_parent_mm: Float[Array, " 3"],
    shift_child_mm: Float[Array, " 3"],
) -> float:
    """Root mean square gap of a centre moved along the axis and, possibly, by a manual correction.

    The mean square gap is a quadratic form about the six-value solution with the normal matrix [[I, -M],
    [-M^T, I]], M the mean of R_a^T R_b; along the axis it grows with the square of the smallest singular
    value.

    Parameters
    ----------
    solution : JointSolution
        The joint as solved.
    slide_mm : float
        Displacement of both halves along the axis.
    shift_parent_mm, shift_child_mm : array, shape (3,)
        Correction of p and of q in their frames, mm.

    Returns
    -------
    float
        Rms gap, mm.

    """
    beyond_free_mm = slide_mm - solution.slide_to_free_mm
    floor = float(solution.singular_values[5]) ** 2
    along = 2 * floor * beyond_free_mm**2
    towards_mm = solution.null_parent @ shift_parent_mm + solution.null_child @ shift_child_mm
    both = 2 * floor * beyond_free_mm * towards_mm
    across = (
        shift_parent_mm @ shift_parent_mm
        + shift_child_mm @ shift_child_mm
        - 2 * shift_parent_mm @ solution.mean_rotation @ shift_child_mm
    )
    return float(np.sqrt(solution.gap_rms_free_mm**2 + max(float(along + both + across), 0.0)))
