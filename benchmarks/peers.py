"""Published software: biobuddy's SCoRE and SARA, qmt's hinge axis. None is needed: what cannot be imported is
named with the reason.
"""

from __future__ import annotations

import contextlib
import importlib
import io
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from schemas.layout import Joint
from schemas.poses import Poses
from skeleton.rotations import Array, conjugate, matrix, multiply, rotate
from stages.simulate.task_motion import RATE_HZ

SCORE, SARA, QMT = "biobuddy SCoRE", "biobuddy SARA", "qmt hinge axis"
PEERS = (SCORE, SARA, QMT)

NIMBLE = "nimblephysics"
NOT_RUN = {
    NIMBLE: "not run: 0.10.52 is built for NumPy 1 and crashes on the first array of NumPy 2, which this "
    "project needs"
}

GRAVITY_M_S2 = 9.81
SPAN_S = 0.05
"""Half the time over which motion is differentiated: a longer one blurs the motion, a shorter one leaves
the tracker's noise."""


@dataclass(frozen=True)
class Biobuddy:
    """biobuddy's solvers, which take a series of 4 x 4 matrices each for parent and child."""

    score: Any
    sara: Any
    series_class: Any

    def series(self, poses: Poses, parent: int = 0, child: int = 1) -> tuple[Any, Any]:
        """Two receivers' poses as biobuddy's series of matrices."""
        a, b = (
            self.series_class.from_rotation_matrix_and_translation(
                np.moveaxis(matrix(poses.quaternion[:, receiver]), 0, -1), poses.position_mm[:, receiver].T
            )
            for receiver in (parent, child)
        )
        return a, b

    def solver(self, name: str, parent: Any, child: Any, outliers: bool = True) -> Callable[[], Any]:
        """SCoRE or SARA on two series, with or without its outlier pass."""
        algorithm = self.score if name == SCORE else self.sara
        return lambda: algorithm.perform_algorithm(parent, child, recursive_outlier_removal=outliers)

    def joint(self, name: str, poses: Poses, outliers: bool = True) -> tuple[Array, Array, Array | None]:
        """The centre in the parent's and the child's receiver, of two receivers' poses; SARA's axis in the
        child's, which SCoRE has none of.
        """
        result = self.solver(name, *self.series(poses), outliers)()
        return (result[1], result[2], None) if name == SCORE else (result[4], result[5], result[2])


def biobuddy() -> Biobuddy | str:
    """Biobuddy's solvers, or the reason why they cannot be had."""
    try:
        from biobuddy.model_modifiers.joint_center_tool import Sara, Score
        from biobuddy.utils.linear_algebra import RotoTransMatrixTimeSeries
    except ImportError as error:
        return _missing(error)
    return Biobuddy(Score, Sara, RotoTransMatrixTimeSeries)


def missing_peers() -> dict[str, str]:
    """Peers that cannot be run, each with the reason."""
    reasons = dict(NOT_RUN)
    solvers = biobuddy()
    if isinstance(solvers, str):
        reasons |= dict.fromkeys((SCORE, SARA), solvers)
    try:
        importlib.import_module("qmt")
    except ImportError as error:
        reasons[QMT] = _missing(error)
    return reasons


def _missing(error: ImportError) -> str:
    return f"cannot be imported: {error}; see ./bootstrap requirements-bench.lock"


def receiver_pair(poses: Poses, joint: Joint) -> Poses:
    """Parent's and child's receivers alone, in the frames that have both."""
    both = [poses.index(joint.parent_receiver), poses.index(joint.child)]
    rows = np.flatnonzero(poses.valid[:, both].all(1))
    at = rows[:, None], np.array(both)
    return replace(
        poses.take(rows),
        segments=(joint.parent_receiver, joint.child),
        position_mm=poses.position_mm[at],
        quaternion=poses.quaternion[at],
        valid=poses.valid[at],
    )


def hinge_axis(poses: Poses) -> Array:
    """Axis of a hinge in the child by qmt, from ideal inertial sensors where the receivers are."""
    qmt: Any = importlib.import_module("qmt")
    gyr, acc = inertial(poses)
    with contextlib.redirect_stdout(io.StringIO()):  # it prints every step
        _, axis = qmt.jointAxisEstHingeOlsson(acc[:, 0], acc[:, 1], gyr[:, 0], gyr[:, 1])
    return np.asarray(axis, float).ravel()


def inertial(poses: Poses) -> tuple[Array, Array]:
    """Angular velocity (rad/s) and specific force (m/s2) in the receivers' own frames, (T', S, 3) each.

    Central differences over 2 SPAN_S, at frames with both neighbours; the transmitter's z points up.
    """
    n = round(SPAN_S * RATE_HZ)
    before, now, after = (
        (poses.position_mm[rows], poses.quaternion[rows])
        for rows in (slice(None, -2 * n), slice(n, -n), slice(2 * n, None))
    )
    turn = multiply(conjugate(before[1]), after[1])
    turn = turn * np.where(turn[..., :1] < 0, -1.0, 1.0)
    sine = np.linalg.norm(turn[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, turn[..., :1])
    gyr = turn[..., 1:] / np.where(sine > 0, sine, 1.0) * angle / (2 * SPAN_S)
    # the turn's axis is the same in both end frames; half-way it is so to the first order
    pulled = (before[0] - 2 * now[0] + after[0]) / SPAN_S**2 / 1e3 + [0.0, 0.0, GRAVITY_M_S2]
    return gyr, np.asarray(rotate(conjugate(now[1]), pulled))
