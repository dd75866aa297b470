"""Cut a joint's axis with its plane, with the effect on the uncertainty, and manual corrections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.hand.rotations import Array, nearest_rotation, unit


@dataclass(frozen=True)
class Projection:
    """A joint centre on its plane: (3,) in both receivers' frames, and the covariance (6, 6) of both.

    slide_mm : along the axis, signed. axis_plane_deg : angle between axis and plane, 0 to 90, None without a
    plane.
    """

    p_mm: Array
    q_mm: Array
    slide_mm: float
    axis_plane_deg: float | None
    covariance_mm2: Array


def project(
    p_mm: Array,
    q_mm: Array,
    axis_parent: Array,
    axis_child: Array,
    covariance_mm2: Array,
    axis_sd_rad: float,
    *,
    plane_point_mm: Array,
    plane_normal: Array,
    plane_in_parent: bool,
) -> Projection | None:
    """Slide both halves of a centre along the axis by the same amount, until one lies in the plane.

    Two planes, one a half, would leave a constant gap along the axis. Solutions with five and six singular
    values differ only along it, so they end in the same point. None where the axis lies in the plane.
    """
    normal = unit(plane_normal)
    own_point, own_axis = (p_mm, axis_parent) if plane_in_parent else (q_mm, axis_child)
    sine = float(own_axis @ normal)
    if abs(sine) < 1e-9:
        return None
    slide = float((plane_point_mm - own_point) @ normal) / sine
    null = np.concatenate([axis_parent, axis_child])
    cut = np.concatenate([normal, np.zeros(3)] if plane_in_parent else [np.zeros(3), normal])
    onto_plane = np.eye(6) - np.outer(null, cut) / sine
    covariance = covariance_mm2.copy()  # the axis turns: either half moves sideways by half the variance
    for part, axis in ((slice(0, 3), axis_parent), (slice(3, 6), axis_child)):
        covariance[part, part] += (np.eye(3) - np.outer(axis, axis)) * (slide * axis_sd_rad) ** 2 / 2
    return Projection(
        p_mm=p_mm + slide * axis_parent,
        q_mm=q_mm + slide * axis_child,
        slide_mm=slide,
        axis_plane_deg=float(np.degrees(np.arcsin(min(abs(sine), 1.0)))),
        covariance_mm2=onto_plane @ covariance @ onto_plane.T,
    )


def leave_uncut(
    p_mm: Array,
    q_mm: Array,
    axis_parent: Array,
    axis_child: Array,
    covariance_mm2: Array,
    slide_to_free_mm: float,
    variance_along_mm2: float,
) -> Projection:
    """The centre of the six-unknown fit, for a joint without a plane; covariance : without the axis."""
    null = np.concatenate([axis_parent, axis_child]) / np.sqrt(2)
    across = np.eye(6) - np.outer(null, null)
    return Projection(
        p_mm=p_mm + slide_to_free_mm * axis_parent,
        q_mm=q_mm + slide_to_free_mm * axis_child,
        slide_mm=slide_to_free_mm,
        axis_plane_deg=None,
        covariance_mm2=across @ covariance_mm2 @ across.T + variance_along_mm2 * np.outer(null, null),
    )


def correct(p_mm: Array, q_mm: Array, shift_mm: Array, mean_rotation: Array) -> tuple[Array, Array]:
    """Move a centre by hand (section 6): shift_mm in the child's frame, the parent's half in mean posture."""
    return p_mm + nearest_rotation(mean_rotation) @ shift_mm, q_mm + shift_mm


def centre_sd_mm(covariance_mm2: Array) -> float:
    """1-sigma, three-dimensional error of a centre from the covariance of (p, q): the worse half's."""
    variance = np.maximum(np.diag(covariance_mm2), 0.0)
    return float(np.sqrt(max(variance[:3].sum(), variance[3:].sum())))


def gap_rms_mm(
    gap_rms_free_mm: float,
    smallest_singular_value: float,
    axis_parent: Array,
    axis_child: Array,
    beyond_free_mm: float,
    shift_parent_mm: Array,
    shift_child_mm: Array,
    mean_rotation: Array,
) -> float:
    """Rms gap of a centre that was slid along the axis and then, perhaps, shifted.

    The mean square gap is a quadratic form about the unconstrained solution, with the normal matrix [[I, -M],
    [-M^T, I]]; along the axis it grows with the smallest singular value of the stack over sqrt(frames).
    beyond_free_mm : along the axis from the unconstrained solution.
    """
    floor = smallest_singular_value**2
    along = 2 * floor * beyond_free_mm**2
    both = 2 * floor * beyond_free_mm * (axis_parent @ shift_parent_mm + axis_child @ shift_child_mm)
    across = (
        shift_parent_mm @ shift_parent_mm
        + shift_child_mm @ shift_child_mm
        - 2 * shift_parent_mm @ mean_rotation @ shift_child_mm
    )
    return float(np.sqrt(gap_rms_free_mm**2 + max(float(along + both + across), 0.0)))
