"""The literature's own protocol: one joint between two segments with marker clusters, swept in range.

Ehrig et al. 2006 (centres) and 2007 (axes): 1 mm of isotropic white noise on every marker, or on the whole
cluster at once, or on both; the range of motion from 5 to 90 deg. Segments are tracked through their noisy
markers, then solved. Sizes and places of the clusters are our own, since they are not part of what is quoted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.peers import SARA, SCORE, biobuddy
from schemas.poses import Poses
from skeleton.rotations import Array, about_axis, from_matrix, matrix, nearest_rotation, unit
from stages.solve_joints.closed import solve_closed
from stages.solve_joints.moments import JointMoments, relative_poses

NOISE_MM = 1.0
NOISES = ("markers", "cluster", "both")
RANGES_DEG = (5.0, 10.0, 20.0, 45.0, 60.0, 90.0)
N_FRAMES = 200
MARKERS_MM = np.array([[50.0, 50.0, 0.0], [-50.0, 50.0, 0.0], [-50.0, -50.0, 0.0], [50.0, -50.0, 30.0]])
"""Four markers of a cluster about its origin."""

CENTRE_MM = 100.0
"""From the joint to the origin of either cluster, along its segment."""

PUBLISHED = {
    ("both", 20.0, "centre"): "about 1.2 (SCoRE, 2006)",
    ("both", 45.0, "centre"): "within 3 (most methods, 2006)",
    ("both", 5.0, "axis"): "about 12 (best method, 2007)",
    ("both", 90.0, "axis"): "within 1 (nearly all, 2007)",
}


@dataclass(frozen=True)
class ProtocolRow:
    """Root mean square errors in mm over the runs of one noise and range: of the centre of a ball joint, and
    of a hinge's axis where it passes the true centre; biobuddy's NaN where it was not run.
    """

    noise: str
    range_deg: float
    centre_mm: float
    axis_mm: float
    peer_centre_mm: float
    peer_axis_mm: float


@dataclass(frozen=True)
class TwoSegments:
    """Poses of two clusters over time; the true centre and, of a hinge, axis (3,) in the child's cluster."""

    poses: Poses
    centre_child_mm: Array
    axis_child: Array


def protocol_row(noise: str, range_deg: float, runs: int, peer_runs: int) -> ProtocolRow:
    """Simulate and solve one noise and range that many times."""
    peer = biobuddy()
    errors: dict[str, list[float]] = {"centre": [], "axis": [], "peer centre": [], "peer axis": []}
    for run in range(runs):
        rng = np.random.default_rng([NOISES.index(noise), round(range_deg), run])
        ball, hinge = (two_segments(rng, noise, range_deg, hinge=hinge) for hinge in (False, True))
        errors["centre"].append(_centre_error(ball, _closed(ball)[0]))
        errors["axis"].append(axis_distance_mm(hinge, *_closed(hinge)))
        if not isinstance(peer, str) and run < peer_runs:
            errors["peer centre"].append(_centre_error(ball, peer.joint(SCORE, ball.poses)[1]))
            _, point_mm, axis = peer.joint(SARA, hinge.poses)
            assert axis is not None
            errors["peer axis"].append(axis_distance_mm(hinge, point_mm, axis))
    return ProtocolRow(noise, range_deg, *(_rms(values) for values in errors.values()))


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values else float("nan")


def two_segments(rng: np.random.Generator, noise: str, range_deg: float, *, hinge: bool) -> TwoSegments:
    """A joint that uses its range evenly, between segments that both move, seen through noisy markers.

    The child turns about the joint by a rotation of up to half the range either way: about one axis, or
    about any axis across the segment.
    """
    half = np.radians(range_deg) / 2
    heading = rng.uniform(0, 2 * np.pi, N_FRAMES) if not hinge else np.zeros(N_FRAMES)
    across = np.stack([np.zeros(N_FRAMES), np.cos(heading), np.sin(heading)], -1)
    share = rng.uniform(-1, 1, N_FRAMES) if hinge else np.sqrt(rng.uniform(0, 1, N_FRAMES))
    bend = matrix(about_axis(across, half * share))
    sway = rng.uniform(-1, 1, (N_FRAMES, 3)) * np.radians(20.0)
    parent = matrix(about_axis(unit(sway), np.linalg.norm(sway, axis=-1)))
    parent_mm = rng.uniform(-50, 50, (N_FRAMES, 3))
    centre_child = np.array([-CENTRE_MM, 0.0, 0.0])
    child = parent @ bend
    child_mm = parent_mm + parent @ np.array([CENTRE_MM, 0.0, 0.0]) - child @ centre_child
    tracked = [_tracked(rng, noise, R, t) for R, t in ((parent, parent_mm), (child, child_mm))]
    frame = np.arange(1, N_FRAMES + 1)
    quaternion = np.stack([from_matrix(R) for R, _ in tracked], 1)
    position_mm = np.stack([t for _, t in tracked], 1)
    valid = np.ones((N_FRAMES, 2), bool)
    poses = Poses(("parent", "child"), frame, frame / 100.0, position_mm, quaternion, valid)
    return TwoSegments(poses, centre_child, np.array([0.0, 1.0, 0.0]))


def _tracked(rng: np.random.Generator, noise: str, R: Array, t_mm: Array) -> tuple[Array, Array]:
    """A cluster's pose (T, 3, 3), (T, 3) as its noisy markers give it, by least squares."""
    markers = t_mm[:, None] + MARKERS_MM @ np.swapaxes(R, -1, -2)
    if noise in ("markers", "both"):
        markers = markers + NOISE_MM * rng.standard_normal(markers.shape)
    if noise in ("cluster", "both"):
        markers = markers + NOISE_MM * rng.standard_normal((len(markers), 1, 3))
    return rigid_poses(MARKERS_MM, markers)


def rigid_poses(reference_mm: Array, markers_mm: Array) -> tuple[Array, Array]:
    """Rotations (T, 3, 3) and places (T, 3) that bring a cluster (M, 3) nearest to its markers (T, M, 3)."""
    middle = reference_mm.mean(0)
    seen = markers_mm.mean(1)
    turned = nearest_rotation(np.swapaxes(markers_mm - seen[:, None], -1, -2) @ (reference_mm - middle))
    return turned, seen - turned @ middle


def _closed(joint: TwoSegments) -> tuple[Array, Array]:
    """Centre and axis in the child's cluster by the closed form, six values."""
    moments = JointMoments(1)
    poses = joint.poses
    first, second = np.array([0]), np.array([1])
    moments.add(relative_poses(poses.quaternion, poses.position_mm, poses.valid, first, second))
    solution = solve_closed(moments, 0, 6)
    return solution.q_mm, solution.null_child


def _centre_error(joint: TwoSegments, child_mm: Array) -> float:
    return float(np.linalg.norm(child_mm - joint.centre_child_mm))


def axis_distance_mm(joint: TwoSegments, point_mm: Array, axis: Array) -> float:
    """From the true centre to an axis through a point, both in the child's cluster."""
    return float(np.linalg.norm(np.cross(joint.centre_child_mm - point_mm, unit(axis))))
