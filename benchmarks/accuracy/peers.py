"""Published software on the same data: biobuddy's SCoRE and SARA, qmt's hinge axis.

Each gets every frame in which both receivers of a joint are valid, in the form that it asks for, with its own
defaults. None is needed: what cannot be imported is named with the reason, and its rows stay empty.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.accuracy.errors import Centre, Estimate, phalanges_mm
from benchmarks.accuracy.estimators import part
from benchmarks.accuracy.trials import Trial
from benchmarks.joint_solve import Biobuddy, peer_solvers
from benchmarks.solve_hand import solved_joints
from kinematics.rotations import Array, conjugate, multiply, rotate
from schemas.layout import Joint, read_layout
from schemas.poses import Poses
from stages.simulate.motion import RATE_HZ
from stages.simulate.simulation import LAYOUT

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


def missing() -> dict[str, str]:
    """Peers that cannot be run, each with the reason."""
    reasons = dict(NOT_RUN)
    found = peer_solvers()
    if isinstance(found, str):
        reasons |= dict.fromkeys((SCORE, SARA), found)
    try:
        importlib.import_module("qmt")
    except ImportError as error:
        reasons[QMT] = f"cannot be imported: {error}; see ./bootstrap requirements-bench.lock"
    return reasons


def peer_estimate(trial: Trial, name: str, step: int = 1) -> Estimate:
    """What the peer of that name, which must be importable, makes of one frame in `step` of a hand."""
    ways: Mapping[str, Callable[[Poses], Centre]] = {SCORE: _score, SARA: _sara, QMT: hinge_axis}
    poses = part(trial.poses, slice(None, None, step))
    joints = solved_joints(read_layout(LAYOUT), poses)
    wanted = [joint for joint in joints if name != QMT or joint.dof == 1]
    pairs = {joint.name: pair_of(poses, joint) for joint in wanted}
    started = time.process_time()
    centres = {joint: ways[name](pair) for joint, pair in pairs.items()}
    seconds = time.process_time() - started
    return Estimate(centres, seconds, {} if name == QMT else phalanges_mm(centres))


def pair_of(poses: Poses, joint: Joint) -> Poses:
    """Parent's and child's receivers alone, in the frames that have both."""
    both = [poses.index(joint.parent_receiver), poses.index(joint.child)]
    rows = np.flatnonzero(poses.valid[:, both].all(1))
    at = rows[:, None], np.array(both)
    return replace(
        poses,
        segments=(joint.parent_receiver, joint.child),
        frame=poses.frame[rows],
        time_s=poses.time_s[rows],
        position_mm=poses.position_mm[at],
        quaternion=poses.quaternion[at],
        valid=poses.valid[at],
    )


def _biobuddy() -> Biobuddy:
    found = peer_solvers()
    assert isinstance(found, Biobuddy)
    return found


def _score(poses: Poses) -> Centre:
    peer = _biobuddy()
    found = peer.score.perform_algorithm(*peer.series(poses))
    return Centre(found[1], found[2])


def _sara(poses: Poses) -> Centre:
    peer = _biobuddy()
    found = peer.sara.perform_algorithm(*peer.series(poses))
    return Centre(found[4], found[5], None, found[2])


def hinge_axis(poses: Poses) -> Centre:
    """The axis alone, from what ideal inertial sensors would have measured where the receivers are."""
    qmt: Any = importlib.import_module("qmt")
    gyr, acc = inertial(poses)
    with contextlib.redirect_stdout(io.StringIO()):  # it prints every step
        _, axis = qmt.jointAxisEstHingeOlsson(acc[:, 0], acc[:, 1], gyr[:, 0], gyr[:, 1])
    nothing = np.full(3, np.nan)
    return Centre(nothing, nothing, None, np.asarray(axis, float).ravel())


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
