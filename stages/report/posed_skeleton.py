"""The skeleton at one frame of a recording: where its joints are, seen from the hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from kinematics.rotations import matrix
from kinematics.skeleton import starts_at_wrist
from schemas.layout import Digit, Layout, Vector
from schemas.model import SkeletonModel
from schemas.poses import Poses, pose_blocks
from stages.report.study_results import Row

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Point:
    """A joint or a tip: position (right, up, towards the viewer) in mm, seen from the back of the hand.

    reach_mm is the distance from the receiver that carries the point.
    """

    name: str
    position_mm: Array
    status: str
    reach_mm: float


@dataclass(frozen=True)
class Chain:
    """A digit's points from its base to its tip, None where one has no place, and what they are called."""

    digit: str
    names: tuple[str, ...]
    points: tuple[Point | None, ...]

    @property
    def absent(self) -> list[str]:
        """Names of the points without a place."""
        return [name for name, point in zip(self.names, self.points, strict=True) if point is None]


@dataclass(frozen=True)
class Posture:
    """All receivers at one frame: frame number, rotations (S, 3, 3), positions (S, 3) mm, NaN if invalid."""

    frame: int
    segments: tuple[str, ...]
    rotation: Array
    position_mm: Array

    def world(self, segment: str, local_mm: Array) -> Array:
        """A point of the receiver's frame in the transmitter frame, mm; NaN where it is not valid."""
        index = self.segments.index(segment)
        return np.asarray(self.rotation[index] @ local_mm + self.position_mm[index])


def middle_posture(path: Path, layout: Layout) -> Posture | None:
    """The posture at the frame with most valid receivers, of these the one nearest the recording's middle.

    The base of the first digit must be valid, for the view hangs on it; None where no such frame exists.
    The recording is streamed, never in memory as a whole.
    """
    base = layout.measured.index(view_base(layout))
    counts = np.concatenate(
        [
            np.where(block.valid[:, base], block.valid.sum(axis=1), 0)
            for block in pose_blocks(path, layout.measured)
        ]
    )
    if not counts.any():
        return None
    best = np.flatnonzero(counts == counts.max())
    wanted = int(best[np.argmin(np.abs(best - (len(counts) - 1) / 2))])
    for block in pose_blocks(path, layout.measured):
        if wanted < len(block.frame):
            return _posture(block, wanted)
        wanted -= len(block.frame)
    return None


def view_base(layout: Layout) -> str:
    """The segment whose receiver the view hangs on: the base of the first digit."""
    return next(iter(layout.digits.values())).base


def skeleton_chains(
    layout: Layout, model: SkeletonModel, joints: Mapping[str, Row], posture: Posture
) -> list[Chain]:
    """Every digit's chain under that model; `joints` are rows of joint_centres by joint."""
    return [_chain(digit, layout, model, joints, posture) for digit in layout.digits.values()]


def receiver_points(layout: Layout, posture: Posture) -> Array:
    """Positions of the valid receivers in the view's axes, shape (n, 3), mm."""
    valid = np.isfinite(posture.position_mm).all(axis=1)
    return _seen(layout, posture, posture.position_mm[valid])


def _posture(block: Poses, index: int) -> Posture:
    valid = block.valid[index][:, None]
    position = np.where(valid, block.position_mm[index], np.nan)
    rotation = matrix(np.where(valid, block.quaternion[index], np.nan))
    return Posture(int(block.frame[index]), block.segments, rotation, position)


def _chain(
    digit: Digit, layout: Layout, model: SkeletonModel, joints: Mapping[str, Row], posture: Posture
) -> Chain:
    """Base, joints and tip, placed as the first-frame binding does.

    A base that is not the wrist rides on its parent's receiver, every other joint on its child's.
    """
    names, sides = list(digit.joints), ["child"] * len(digit.joints)
    if layout.wrist is not None and starts_at_wrist(digit, layout, model):
        names[0] = layout.wrist.joint
    else:
        sides[0] = "parent"
    points = [_joint(name, side, joints, layout, posture) for name, side in zip(names, sides, strict=True)]
    tip_name = f"{digit.name} tip"
    tip = posture.world(digit.tip, np.zeros(3))
    known = np.isfinite(tip).all()
    points.append(Point(tip_name, _seen(layout, posture, tip), "ok", 0.0) if known else None)
    return Chain(digit.name, (*names, tip_name), tuple(points))


def _joint(name: str, side: str, joints: Mapping[str, Row], layout: Layout, posture: Posture) -> Point | None:
    row = joints.get(name)
    if row is None or row["status"] == "failed" or not row[f"{side}_segment"]:
        return None
    local = np.array([row[f"{side}_{axis}_mm"] for axis in "xyz"], float)
    world = posture.world(row[f"{side}_segment"], local)
    if not np.isfinite(world).all():
        return None
    return Point(name, _seen(layout, posture, world), row["status"], float(np.linalg.norm(local)))


def _seen(layout: Layout, posture: Posture, world_mm: Array) -> Array:
    """World points (..., 3) in the view's axes: right, up (distal), towards the viewer (dorsal).

    Right is distal x dorsal and not the lateral axis, whose sign a layout leaves open: so no hand is
    ever mirrored.
    """
    base = layout.segments[view_base(layout)]
    index = posture.segments.index(base.name)
    distal, dorsal = _vector(base.distal), _vector(base.dorsal)
    axes = np.stack([np.cross(distal, dorsal), distal, dorsal])
    return np.asarray((world_mm - posture.position_mm[index]) @ posture.rotation[index] @ axes.T)


def _vector(values: Vector) -> Array:
    return np.array(values, float)
