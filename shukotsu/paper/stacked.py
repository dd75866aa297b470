"""Eq. 4-7 as printed: the rotations of all frames are stacked and inverted by SVD.

The closed form (`closed`) computes the same numbers in one pass over the data. This solver is kept because it
is the paper's, and because the closed form is tested against it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.arrays import Float
from shukotsu.hand.rotations import Array, matrix

EXACT_HINGE = 5e-13
"""Smallest squared singular value, over the number of frames, below which it is only rounding error.

The joint is then a hinge without noise, whose sixth unknown is undetermined.
"""


@dataclass(frozen=True)
class StackedSolution:
    """Solution of Eq. 5-7 by the stacked SVD.

    Attributes
    ----------
    p_mm, q_mm : array, shape (3,)
        Joint centre in the parent's and the child's receiver frame, mm.
    null_parent, null_child : array, shape (3,)
        Halves of the last right singular vector, each of length 1: the axis in either receiver frame.
    singular_values : array, shape (6,)
        Singular values of the stack over the root of the number of frames, descending.

    """

    p_mm: Array
    q_mm: Array
    null_parent: Array
    null_child: Array
    singular_values: Array


def solve_stacked(
    parent_quaternion: Float[Array, "N 4"],
    parent_position_mm: Float[Array, "N 3"],
    child_quaternion: Float[Array, "N 4"],
    child_position_mm: Float[Array, "N 3"],
    n_singular_values: int,
) -> StackedSolution:
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
    StackedSolution
        Centre, axis and singular values.

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
