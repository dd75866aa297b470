"""Joints between two receivers: our closed form, our stacked SVD, biobuddy's SCoRE and SARA, qmt's axis."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.benchmark_table import Cell, TextTable
from benchmarks.peers import QMT, SARA, SCORE, Biobuddy, biobuddy, hinge_axis, missing_peers, receiver_pair
from benchmarks.solvers import closed, moments, solved_joints, stacked
from schemas.layout import Joint, Plane, read_layout
from schemas.poses import Poses
from skeleton.rotations import Array, about_axis, multiply, rotate, unit
from stages.simulate.realism import Realism
from stages.simulate.simulation import simulate

NOISE_MM, NOISE_DEG = 0.10, 0.06
SIX = 6
CLOSED, STACKED = "closed form (ours)", "stacked SVD (ours)"
MOMENTS = "closed form, its pass over the data"
OUTLIERS = {", with outlier pass (its default)": True, ", without": False}

Work = dict[str, Callable[[], object]]


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
        yield joint_times(n_frames, rounds)
    yield hand_times(sizes[0][0], hand_rounds)
    yield agreement(sizes[0][0], seeds)


def joint_times(n_frames: int, rounds: int) -> TextTable:
    """Time every solver on the same frames of one joint."""
    poses = noisy_hinge(0, n_frames).poses
    rivals = _ours(poses, [HINGE])
    peer = biobuddy()
    if not isinstance(peer, str):
        series = peer.series(poses)
        for name in (SCORE, SARA):
            rivals |= {name + way: peer.solver(name, *series, outliers) for way, outliers in OUTLIERS.items()}
    missing = dict.fromkeys((SCORE, SARA), peer) if isinstance(peer, str) else {}
    return TextTable(
        f"joint_solve: one joint, {n_frames} frames, {rounds} rounds in turns",
        ("solver", "median ms:.2f", "x closed form:.2f", ""),
        _timed(rivals, missing, rounds),
        "Timed is computing only, from arrays (biobuddy: from its own series of matrices, built before). The "
        "closed form also gives the centre's sd, range, gap and independent samples, which is most of its "
        "time at few frames; the others do not.",
    )


def hand_times(n_frames: int, rounds: int) -> TextTable:
    """Time a hand's joints from the same arrays of poses, each solver's inputs included."""
    layout = read_layout("liberty16")
    poses = simulate("01", "right", "opposition", 0, Realism.full(), n_frames).poses()
    joints = solved_joints(layout, poses)
    peer, missing = biobuddy(), missing_peers()
    rivals = _ours(poses, joints)
    if not isinstance(peer, str):
        for way, outliers in OUTLIERS.items():
            rivals[SCORE + way] = partial(_scored, peer, poses, joints, outliers)
    if QMT not in missing:
        rivals[QMT] = lambda: [hinge_axis(receiver_pair(poses, joint)) for joint in joints]
    absent = {name: reason for name, reason in missing.items() if name in (SCORE, QMT)}
    return TextTable(
        f"joint_solve: {len(joints)} joints of {len(poses.segments)} receivers, {n_frames} frames, "
        f"{rounds} rounds in turns",
        ("solver", "median ms:.1f", "x closed form:.2f", ""),
        _timed(rivals, absent, rounds),
        "From arrays of quaternions and positions (frames, receivers, numbers) to every joint's centre. The "
        "closed form: the pass over the data, the solution, its sd, range, gap and independent samples, all "
        "joints. biobuddy, joint after joint: matrices of the two quaternions (our numpy), its two series of "
        "4 x 4 matrices, and its SCoRE. qmt finds an axis and no centre, from inertial signals computed from "
        "the poses.",
    )


def _scored(peer: Biobuddy, poses: Poses, joints: list[Joint], outliers: bool) -> None:
    for joint in joints:
        pair = poses.index(joint.parent_receiver), poses.index(joint.child)
        peer.solver(SCORE, *peer.series(poses, *pair), outliers)()


def _ours(poses: Poses, joints: list[Joint]) -> Work:
    return {
        CLOSED: lambda: closed(poses, joints, SIX),
        MOMENTS: lambda: moments(poses, joints),
        STACKED: lambda: stacked(poses, joints, SIX),
    }


def _timed(rivals: Work, missing: Mapping[str, str], rounds: int) -> list[tuple[Cell, ...]]:
    timings = compare(rivals, CLOSED, rounds)
    rows: list[tuple[Cell, ...]] = [(name, 1e3 * t.seconds, t.ratio, "") for name, t in timings.items()]
    return rows + [(name, None, None, reason) for name, reason in missing.items()]


def agreement(n_frames: int, seeds: int) -> TextTable:
    """How far the solvers' centres are from the closed form's, and from the true axis."""
    apart: dict[str, list[float]] = {}
    off_axis: dict[str, list[float]] = {}
    peer = biobuddy()
    for seed in range(seeds):
        hinge = noisy_hinge(seed, n_frames)
        (reference,), (literal,) = closed(hinge.poses, [HINGE], SIX), stacked(hinge.poses, [HINGE], SIX)
        centres = {CLOSED: (reference.p_mm, reference.q_mm), STACKED: (literal.p_mm, literal.q_mm)}
        if not isinstance(peer, str):
            for way, outliers in OUTLIERS.items():
                peers = {name + way: peer.joint(name, hinge.poses, outliers) for name in (SCORE, SARA)}
                centres |= {name: (p, q) for name, (p, q, _) in peers.items()}
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
        ("solver", "mm from closed form (worst):.1e", "mm off true axis (median):.3f", ""),
        rows,
        "The centre's worse half, six singular values inverted as biobuddy does. Without its outlier pass "
        "SCoRE is the same least squares; with it biobuddy leaves out frames, which white noise does not ask "
        "for. SARA's centre slid along the axis: version 0.3.2 scales the null vector in place, then inverts "
        "with it.",
    )


HINGE = Joint("joint", "parent", "child", "parent", 1, Plane("child", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))


def noisy_hinge(seed: int, n_frames: int) -> Hinge:
    """A hinge with 60 deg of range between two receivers that both also move freely."""
    rng = np.random.default_rng(seed)
    phase = np.linspace(0.0, 6 * np.pi, n_frames)
    axis_parent = unit(rng.standard_normal(3))
    mount = _random_rotation(rng)
    axis_child = rotate(mount * [1, -1, -1, -1], axis_parent)
    p, q = rng.normal(0, 20, (2, 3))
    wave = np.sin(phase[:, None] * rng.uniform(0.3, 1.0, 3) + rng.uniform(0, 6, 3))
    parent = multiply(about_axis(unit(wave), 0.8 * np.linalg.norm(wave, axis=-1)), _random_rotation(rng))
    parent_mm = 200.0 + 80.0 * wave
    bend = about_axis(axis_parent, np.radians(30.0) * np.sin(phase))
    child = multiply(parent, multiply(bend, mount))
    child_mm = parent_mm + rotate(parent, p) - rotate(child, q)
    quaternion, position_mm = np.stack([parent, child], 1), np.stack([parent_mm, child_mm], 1)
    noise = np.radians(NOISE_DEG) * rng.standard_normal(position_mm.shape)
    quaternion = multiply(quaternion, about_axis(unit(noise), np.linalg.norm(noise, axis=-1)))
    position_mm = position_mm + NOISE_MM * rng.standard_normal(position_mm.shape)
    frame = np.arange(1, n_frames + 1)
    valid = np.ones((n_frames, 2), bool)
    poses = Poses(("parent", "child"), frame, frame / 240.0, position_mm, quaternion, valid)
    return Hinge(poses, p, q, axis_parent, axis_child)


def _random_rotation(rng: np.random.Generator) -> Array:
    return unit(rng.standard_normal(4))


@dataclass(frozen=True)
class Timing:
    """Median seconds, and the median over the rounds of the ratio to the baseline in the same round."""

    seconds: float
    ratio: float


TURN_S = 0.2
"""A turn repeats quick work for this long, else it would pay for the caches that its predecessor emptied."""


def compare(
    rivals: Mapping[str, Callable[[], object]], baseline: str, rounds: int, turn_s: float = TURN_S
) -> dict[str, Timing]:
    """Give each rival a turn a round, A B A B, so that whatever slows one slows the others.

    A turn's time is the mean over its repetitions.
    """
    seconds: dict[str, list[float]] = {name: [] for name in rivals}
    for _ in range(rounds):
        for name, work in rivals.items():
            seconds[name].append(_turn(work, turn_s))
    return {
        name: Timing(
            statistics.median(own),
            statistics.median(a / b for a, b in zip(own, seconds[baseline], strict=True)),
        )
        for name, own in seconds.items()
    }


def _turn(work: Callable[[], object], turn_s: float) -> float:
    """Mean seconds of the work, repeated until the turn is over; once at least."""
    started = time.perf_counter()
    repetitions = 0
    while not repetitions or time.perf_counter() - started < turn_s:
        work()
        repetitions += 1
    return (time.perf_counter() - started) / repetitions
