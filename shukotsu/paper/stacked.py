"""Eq. 4-7 to the letter: stack the rotations of all frames and invert them by SVD.

The closed form in `moments` gives the same numbers from one pass over the data; this one is kept because
it is the paper's, and to hold the other against it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.hand.rotations import Array, matrix

EXACT_HINGE = 5e-13
"""Square of the last singular value over frames below which it is rounding: a hinge without any noise,
whose sixth unknown no inverse can find."""


@dataclass(frozen=True)
class StackedSolution:
    """Centre (3,) mm in both frames, null vector's halves, and singular values (6,) over sqrt(frames)."""

    p_mm: Array
    q_mm: Array
    null_parent: Array
    null_child: Array
    singular_values: Array


def solve_stacked(
    parent_quaternion: Array,
    parent_position_mm: Array,
    child_quaternion: Array,
    child_position_mm: Array,
    n_singular_values: int,
) -> StackedSolution:
    """Solve one joint as Eq. 5-7 do: x = V W^-1 U^T b, the smallest singular values left out.

    quaternions : (N, 4) unit, receiver to transmitter; positions : (N, 3) mm; every frame valid, N >= 2.
    n_singular_values : 6 as printed, or 5 to leave the point on a hinge's axis open.
    """
    n = len(parent_position_mm)
    stack = np.concatenate([matrix(child_quaternion), -matrix(parent_quaternion)], -1).reshape(3 * n, 6)
    right = (parent_position_mm - child_position_mm).reshape(3 * n)
    u, w, vt = np.linalg.svd(stack, full_matrices=False)
    kept = slice(0, 5 if w[5] ** 2 < EXACT_HINGE * n else n_singular_values)
    x = vt[kept].T @ ((u[:, kept].T @ right) / w[kept])
    null = vt[5]
    return StackedSolution(
        p_mm=x[3:],
        q_mm=x[:3],
        null_parent=null[3:] / np.linalg.norm(null[3:]),
        null_child=null[:3] / np.linalg.norm(null[:3]),
        singular_values=w / np.sqrt(n),
    )
