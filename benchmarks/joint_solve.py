"""Joints between two receivers: our closed form, our stacked SVD, and biobuddy's SCoRE and SARA."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks import solve_hand
from benchmarks.interleaved import Timing, compare
from benchmarks.text_table import Cell, TextTable
from kinematics.rotations import Array, about_axis, matrix, multiply, rotate, unit
from schemas.layout import Joint, Plane, read_layout
from schemas.poses import Poses
from stages.simulate.realism import Realism
from stages.simulate.simulation import simulate
from stages.solve_joints.closed import JointSolution, solve_closed
from stages.solve_joints.moments import BLOCK_FRAMES, JointMoments
from stages.solve_joints.solve import add_block
from stages.solve_joints.stacked import StackedSolution, solve_stacked

NOISE_MM, NOISE_DEG = 0.10, 0.06
SIX = 6
CLOSED, STACKED = "closed form (ours)", "stacked SVD (ours)"
MOMENTS = "closed form, its pass over the data"
SCORE, SARA = "biobuddy SCoRE", "biobuddy SARA"
WITH_OUTLIERS = ", with outlier pass (its default)"
WITHOUT_OUTLIERS = ", without"


@dataclass(frozen=True)
class Hinge:
    """Two receivers on a hinge with white noise; p_mm, q_mm its true centre, axis_* its true axis."""

    poses: Poses
    p_mm: Array
    q_mm: Array
    axis_parent: Array
    axis_child: Array


def run(
    sizes: tuple[tuple[int, int], ...] = ((3774, 9), (50_000, 3)), seeds: int = 20, hand_rounds: int = 3
) -> Iterator[TextTable]:
    """Give the tables: times for each (frames, rounds), a whole hand's, then agreement over seeds."""
    for n_frames, rounds in sizes:
        yield times(n_frames, rounds)
    yield times_from_poses(sizes[0][0], hand_rounds)
    yield agreement(sizes[0][0], seeds)


def times(n_frames: int, rounds: int) -> TextTable:
    """Time every solver on the same frames."""
    hinge = noisy_hinge(0, n_frames)
    rivals: dict[str, Callable[[], object]] = {
        CLOSED: lambda: closed(hinge.poses),
        MOMENTS: lambda: moments(hinge.poses),
        STACKED: lambda: stacked(hinge.poses),
    }
    missing: list[tuple[Cell, ...]] = []
    peer = peer_solvers()
    if isinstance(peer, str):
        missing = [(name, None, None, peer) for name in (SCORE, SARA)]
    else:
        parent, child = peer.series(hinge.poses)
        for name, solver in ((SCORE, peer.score), (SARA, peer.sara)):
            for suffix, outliers in ((WITH_OUTLIERS, True), (WITHOUT_OUTLIERS, False)):
                rivals[name + suffix] = _solved_by(solver, parent, child, outliers)
    found = compare(rivals, CLOSED, rounds)
    rows: list[tuple[Cell, ...]] = [
        (name, 1e3 * timing.seconds, timing.ratio, "") for name, timing in found.items()
    ]
    return TextTable(
        f"joint_solve: one joint, {n_frames} frames, {rounds} rounds in turns",
        (("solver", ""), ("median ms", ".2f"), ("x closed form", ".2f"), ("", "")),
        [*rows, *missing],
        "Timed is computing only, from arrays (biobuddy: from its own series of matrices, made before). The "
        "closed form also gives the centre's sd, range, gap and independent samples, which is most of its "
        "time at few frames; the others do not.",
    )


def times_from_poses(n_frames: int, rounds: int) -> TextTable:
    """Time a hand's joints, and one joint, from the same arrays of poses, each solver's inputs included."""
    from benchmarks.accuracy.peers import QMT, missing  # which imports this module

    layout = read_layout("liberty16")
    poses = solve_hand.as_poses(simulate("01", "right", "opposition", 0, Realism.full(), n_frames))
    joints = solve_hand.solved_joints(layout, poses)
    peer = peer_solvers()
    reasons = missing()
    rows: list[tuple[Cell, ...]] = []
    for own in (joints, joints[:1]):
        rivals: dict[str, Callable[[], object]] = {CLOSED: _solved_hand(poses, own)}
        if not isinstance(peer, str):
            rivals[SCORE + WITH_OUTLIERS] = _scored_hand(peer, poses, own, outliers=True)
            rivals[SCORE + WITHOUT_OUTLIERS] = _scored_hand(peer, poses, own, outliers=False)
        if QMT not in reasons:
            rivals[QMT] = _axes_of_hand(poses, own)
        found: dict[str, Timing] = compare(rivals, CLOSED, rounds)
        rows += [(name, len(own), 1e3 * timing.seconds, timing.ratio, "") for name, timing in found.items()]
        rows += [(SCORE, len(own), None, None, peer)] if isinstance(peer, str) else []
        rows += [(QMT, len(own), None, None, reasons[QMT])] if QMT in reasons else []
    return TextTable(
        f"joint_solve: from poses of {len(poses.segments)} receivers, {n_frames} frames, {rounds} rounds",
        (("solver", ""), ("joints", "d"), ("median ms", ".1f"), ("x closed form", ".0f"), ("", "")),
        rows,
        "From arrays of quaternions and positions (frames, receivers, numbers) to every joint's centre. The "
        "closed form: the pass over the data, the solution, its sd, range, gap and independent samples, all "
        "joints. biobuddy, joint after joint: matrices of the two quaternions (our numpy), its two series of "
        "4 x 4 matrices, and its SCoRE. qmt finds an axis and no centre, from inertial signals made of the "
        "poses.",
    )


def _solved_hand(poses: Poses, joints: list[Joint]) -> Callable[[], object]:
    return lambda: solve_hand.closed(poses, joints, SIX)


def _scored_hand(
    peer: Biobuddy, poses: Poses, joints: list[Joint], *, outliers: bool
) -> Callable[[], object]:
    pairs = [[poses.index(joint.parent_receiver), poses.index(joint.child)] for joint in joints]

    def work() -> list[Any]:
        return [
            peer.score.perform_algorithm(*peer.series(poses, *pair), recursive_outlier_removal=outliers)
            for pair in pairs
        ]

    return work


def _axes_of_hand(poses: Poses, joints: list[Joint]) -> Callable[[], object]:
    from benchmarks.accuracy.peers import hinge_axis, pair_of  # which imports this module

    return lambda: [hinge_axis(pair_of(poses, joint)) for joint in joints]


def agreement(n_frames: int, seeds: int) -> TextTable:
    """How far the solvers' centres are from the closed form's, and from the true axis."""
    apart: dict[str, list[float]] = {}
    off_axis: dict[str, list[float]] = {}
    peer = peer_solvers()
    for seed in range(seeds):
        hinge = noisy_hinge(seed, n_frames)
        reference, literal = closed(hinge.poses), stacked(hinge.poses)
        centres = {CLOSED: (reference.p_mm, reference.q_mm), STACKED: (literal.p_mm, literal.q_mm)}
        if not isinstance(peer, str):
            centres |= peer.centres(hinge.poses)
        for name, (p, q) in centres.items():
            distances = (np.linalg.norm(p - reference.p_mm), np.linalg.norm(q - reference.q_mm))
            apart.setdefault(name, []).append(float(max(distances)))
            offsets = ((p - hinge.p_mm, hinge.axis_parent), (q - hinge.q_mm, hinge.axis_child))
            across = max(float(np.linalg.norm(np.cross(offset, axis))) for offset, axis in offsets)
            off_axis.setdefault(name, []).append(across)
    rows: list[tuple[Cell, ...]] = [
        (name, float(np.max(apart[name])), float(np.median(off_axis[name])), "") for name in apart
    ]
    if isinstance(peer, str):
        rows += [(name, None, None, peer) for name in (SCORE, SARA)]
    return TextTable(
        f"joint_solve: do they agree? an exact hinge, white noise of {NOISE_MM} mm and {NOISE_DEG} deg, "
        f"{n_frames} frames, {seeds} seeds",
        (
            ("solver", ""),
            ("mm from closed form (worst)", ".1e"),
            ("mm off true axis (median)", ".3f"),
            ("", ""),
        ),
        rows,
        "The centre's worse half, six singular values inverted as biobuddy does. Without its outlier pass "
        "SCoRE is the same least squares; with it biobuddy leaves out frames, which white noise does not ask "
        "for. SARA's centre slid along the axis: version 0.3.2 scales the null vector in place, then inverts "
        "with it.",
    )


def noisy_hinge(seed: int, n_frames: int) -> Hinge:
    """Make a hinge with 60 deg of range between two receivers that both also move freely."""
    rng = np.random.default_rng(seed)
    phase = np.linspace(0.0, 6 * np.pi, n_frames)
    axis_parent = unit(rng.standard_normal(3))
    mount = _random_turns(rng, 1)[0]
    axis_child = rotate(mount * [1, -1, -1, -1], axis_parent)
    p, q = rng.normal(0, 20, (2, 3))
    wave = np.sin(phase[:, None] * rng.uniform(0.3, 1.0, 3) + rng.uniform(0, 6, 3))
    parent = multiply(about_axis(unit(wave), 0.8 * np.linalg.norm(wave, axis=-1)), _random_turns(rng, 1))
    parent_mm = 200.0 + 80.0 * wave
    bend = about_axis(axis_parent, np.radians(30.0) * np.sin(phase))
    child = multiply(parent, multiply(bend, mount))
    child_mm = parent_mm + rotate(parent, p) - rotate(child, q)
    quaternion, position_mm = np.stack([parent, child], 1), np.stack([parent_mm, child_mm], 1)
    turn = np.radians(NOISE_DEG) * rng.standard_normal(position_mm.shape)
    quaternion = multiply(quaternion, about_axis(unit(turn), np.linalg.norm(turn, axis=-1)))
    position_mm = position_mm + NOISE_MM * rng.standard_normal(position_mm.shape)
    frame = np.arange(1, n_frames + 1)
    valid = np.ones((n_frames, 2), bool)
    poses = Poses(("parent", "child"), frame, frame / 240.0, position_mm, quaternion, valid)
    return Hinge(poses, p, q, axis_parent, axis_child)


def _random_turns(rng: np.random.Generator, n: int) -> Array:
    return unit(rng.standard_normal((n, 4)))


_JOINT = Joint("joint", "parent", "child", "parent", 1, Plane("child", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))


def moments(poses: Poses) -> JointMoments:
    """Take the pass over the data, in blocks as the stage does."""
    made = JointMoments(1)
    for start in range(0, len(poses.frame), BLOCK_FRAMES):
        rows = slice(start, start + BLOCK_FRAMES)
        block = replace(
            poses,
            frame=poses.frame[rows],
            time_s=poses.time_s[rows],
            position_mm=poses.position_mm[rows],
            quaternion=poses.quaternion[rows],
            valid=poses.valid[rows],
        )
        add_block(made, block, (_JOINT,))
    return made


def closed(poses: Poses) -> JointSolution:
    """Solve by the closed form."""
    return solve_closed(moments(poses), 0, SIX)


def stacked(poses: Poses) -> StackedSolution:
    """Solve by the stack of all frames."""
    (a, b), (a_mm, b_mm) = np.swapaxes(poses.quaternion, 0, 1), np.swapaxes(poses.position_mm, 0, 1)
    return solve_stacked(a, a_mm, b, b_mm, SIX)


@dataclass(frozen=True)
class Biobuddy:
    """biobuddy's solvers, which take a series of 4 x 4 matrices each for parent and child."""

    score: Any
    sara: Any
    series_class: Any

    def series(self, poses: Poses, parent: int = 0, child: int = 1) -> tuple[Any, Any]:
        """Turn two receivers' poses into biobuddy's series of matrices."""
        made = [
            self.series_class.from_rotation_matrix_and_translation(
                np.moveaxis(matrix(poses.quaternion[:, receiver]), 0, -1), poses.position_mm[:, receiver].T
            )
            for receiver in (parent, child)
        ]
        return made[0], made[1]

    def centres(self, poses: Poses) -> dict[str, tuple[Array, Array]]:
        """Centres in parent and child of each solver, with and without its outlier pass."""
        found = {}
        parent, child = self.series(poses)
        for suffix, outliers in ((WITH_OUTLIERS, True), (WITHOUT_OUTLIERS, False)):
            by_score = _solved_by(self.score, parent, child, outliers)()
            by_sara = _solved_by(self.sara, parent, child, outliers)()
            found[SCORE + suffix] = (by_score[1], by_score[2])
            found[SARA + suffix] = (by_sara[4], by_sara[5])
        return found


def _solved_by(solver: Any, parent: Any, child: Any, outliers: bool) -> Callable[[], Any]:
    return lambda: solver.perform_algorithm(parent, child, recursive_outlier_removal=outliers)


def peer_solvers() -> Biobuddy | str:
    """Give biobuddy's solvers, or the reason why they cannot be had."""
    try:
        from biobuddy.model_modifiers.joint_center_tool import Sara, Score
        from biobuddy.utils.linear_algebra import RotoTransMatrixTimeSeries
    except ImportError as error:
        return f"cannot be imported: {error}; see ./bootstrap requirements-bench.lock"
    return Biobuddy(Score, Sara, RotoTransMatrixTimeSeries)
