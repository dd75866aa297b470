"""Motion that the viewer shows: joints, tips and receivers of one hand's skeletons over a recording.

`hand.posing` determines joint positions: in a fitted hand from bones posed with all receivers, in any other
skeleton from points fixed to receivers. Still pictures show one frame of the same motion.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from shukotsu.arrays import Array, Integers
from shukotsu.errors import InputError
from shukotsu.hand import known_digits, rotations
from shukotsu.hand.posing import PosedRecording, ReceiverPoint, Skeleton, digit_points
from shukotsu.report.belief import BELIEVED, belief
from shukotsu.study.layout import Layout, Vector
from shukotsu.tables.poses import Poses
from shukotsu.tables.typed_table import vector_of

if TYPE_CHECKING:
    from shukotsu.tables.rows import ReceiversRow

MOST_FRAMES = 15_000
"""Largest number of frames in a view: a minute at 240 frames per second."""


@dataclass(frozen=True)
class BoneLine:
    """A line between two points.

    start, end : indices of the points. digit : index of the digit. level : index of the bone in its digit, or
    -1 for the line from the wrist to the start of a digit, which is not a bone. shared : whether bones of
    other digits start at the same point.
    """

    start: int
    end: int
    digit: int
    level: int
    shared: bool


@dataclass(frozen=True)
class JointAxis:
    """A joint's rotation axis, and the sagittal plane that cuts it if the model has one.

    point : index of the joint, which is in the plane. axis : (3,), unit, in the frame of the receiver on
    `segment`. normal : (3,), in the frame of the receiver on plane_segment, which is empty without a plane.
    """

    point: int
    segment: str
    axis: Vector
    plane_segment: str
    normal: Vector


@dataclass(frozen=True)
class ShownSkeleton:
    """One skeleton over T frames: P points, B bones, D digits.

    model_index : index of the model in the study, which determines its colour. points : names of joints, then
    of tips. position_mm : (T, P, 3), in the transmitter frame, NaN in gaps. on_receivers : the points as
    fixed to receivers; None for a fitted skeleton. sd_mm : (P,), 1-sigma error of each point in 3-D, NaN if
    none is stated. believed : (P,), each of BELIEFS; tips are always believed. tip_error_mm : (T, D), of the
    replay, NaN in gaps.
    """

    model: str
    model_index: int
    points: tuple[str, ...]
    position_mm: Array
    on_receivers: tuple[ReceiverPoint, ...] | None
    sd_mm: Array
    believed: tuple[str, ...]
    bones: tuple[BoneLine, ...]
    axes: tuple[JointAxis, ...]
    tip_error_mm: Array


@dataclass(frozen=True)
class HandMotion:
    """One hand over T frames: R receivers and one or more skeletons, all in the transmitter frame.

    frame : (T,), recorded frame numbers. time_s : (T,), device times, NaN if unknown. every : number of
    recorded frames per frame kept here. receiver_mm : (T, R, 3). receiver_quaternion : (T, R, 4), unit, (w,
    x, y, z), receiver to transmitter frame. Both are NaN if not valid. base : index of the receiver to which
    the view is fixed. upright : (3, 3), rows: the view's axes in its frame: right, up (distal), to the
    viewer, who sees the back of the hand. paper : name of the paper's skeleton, if it is included. begins_s :
    time from the recording's first frame to the first frame here.
    """

    hand: str
    digits: tuple[str, ...]
    frame: Integers
    time_s: Array
    every: int
    receivers: tuple[str, ...]
    receiver_mm: Array
    receiver_quaternion: Array
    base: int
    upright: Array
    skeletons: tuple[ShownSkeleton, ...]
    paper: str = ""
    begins_s: float = 0.0


def hand_motion(
    hand: str,
    layout: Layout,
    poses: Poses,
    skeletons: Iterable[ShownSkeleton],
    paper: str = "",
    every: int = 1,
) -> HandMotion:
    """Join skeletons with the receivers that they were made from.

    every : number of recorded frames per frame of these poses. Receivers without a valid pose are left out.
    Raises InputError if the receiver to which the view is fixed has none, since the hand's orientation is
    then unknown.
    """
    base = known_digits.root_of(layout)
    worn = np.asarray(poses.valid.any(axis=0))
    if not worn[poses.index(base)]:
        raise InputError(
            f"the receiver of {base} has no valid pose; without it no view of the hand is upright"
        )
    valid = poses.valid[..., None]
    distal, dorsal = np.array(layout.segments[base].distal), np.array(layout.segments[base].dorsal)
    return HandMotion(
        hand=hand,
        digits=tuple(layout.digits),
        frame=poses.frame,
        time_s=poses.time_s,
        every=every,
        receivers=tuple(name for name, there in zip(poses.segments, worn, strict=True) if there),
        receiver_mm=np.where(valid, poses.position_mm, np.nan)[:, worn],
        receiver_quaternion=np.where(valid, poses.quaternion, np.nan)[:, worn],
        base=int(worn[: poses.index(base)].sum()),
        # right is not the lateral axis, whose sign a layout does not fix, so that no hand is mirrored
        upright=np.stack([np.cross(distal, dorsal), distal, dorsal]),
        skeletons=tuple(skeletons),
        paper=paper,
    )


def receiver_skeleton(hand: Skeleton, poses: Poses) -> ShownSkeleton:
    """Return a skeleton whose joints are fixed to receivers, with model_index 0 and no tip errors."""
    digits = hand.layout.digits.values()
    by_digit = [digit_points(digit, hand.layout, hand.model, hand.joints) for digit in digits]
    points = {point.name: point for of_digit in by_digit for point in of_digit}
    positions = {name: point.position_mm(poses) for name, point in points.items()}
    bones = _bones(list(points), [[point.name for point in of_digit] for of_digit in by_digit], None)
    return _skeleton(hand, positions, bones, {}, tuple(points.values()))


def fitted_skeleton(hand: Skeleton, worn: Mapping[str, ReceiversRow], posed: PosedRecording) -> ShownSkeleton:
    """Return a fitted hand with its bones as posed; each digit ends at the end of its distal bone.

    Its model_index is 0, and it has no tip errors. worn : rows of receivers by segment. posed : the bones.
    """
    layout = hand.layout
    chains = [[*digit.joints, f"{name}_tip"] for name, digit in layout.digits.items()]
    wrist = layout.wrist.joint if layout.wrist else None
    names = dict.fromkeys([*([wrist] if wrist else []), *(name for chain in chains for name in chain)])
    nowhere = np.full((len(posed.position_mm), 3), np.nan)
    posed_mm = {name: posed.position_mm[:, index] for index, name in enumerate(posed.names)}
    positions = {name: posed_mm.get(name, nowhere) for name in names}
    sd_of_tip = {
        f"{name}_tip": worn.get(digit.tip, {}).get("bone_tip_sd_mm") for name, digit in layout.digits.items()
    }
    return _skeleton(hand, positions, _bones(list(positions), chains, wrist), sd_of_tip, None)


def shown_first(motion: HandMotion) -> tuple[int, ...]:
    """Return the indices of the skeletons that a view shows at first.

    They are the last fitted skeleton that was posed in this recording, or else the first skeleton; and, if
    there are others, the paper's skeleton or else the first of them.
    """
    posed = [np.isfinite(skeleton.position_mm).any() for skeleton in motion.skeletons]
    fitted = [i for i, s in enumerate(motion.skeletons) if s.on_receivers is None and posed[i]]
    first = fitted[-1] if fitted else 0
    others = [i for i in range(len(motion.skeletons)) if i != first and posed[i]]
    others.sort(key=lambda i: motion.skeletons[i].model != motion.paper)
    return (first, *others[:1])


def view_points(motion: HandMotion, frames: Integers, world_mm: Array) -> Array:
    """Transform points (F, n, 3), mm, of the frames with indices (F,) from the world to the view's axes.

    The result is NaN if the base has no pose.
    """
    turn = rotations.matrix(motion.receiver_quaternion[frames, motion.base])
    origin = motion.receiver_mm[frames, motion.base]
    return np.asarray((world_mm - origin[:, None]) @ turn @ motion.upright.T)


def still_frame(motion: HandMotion, skeleton: ShownSkeleton) -> int:
    """Return the index of the frame for a still picture, in which the hand is open.

    Of the frames with most valid receivers, including the base, it is the one with the largest sum of
    distances of the fingertips from the base.
    """
    valid = np.asarray(np.isfinite(motion.receiver_mm).all(-1))
    counts = np.where(valid[:, motion.base], valid.sum(1), 0)
    tips = skeleton.position_mm[:, [skeleton.points.index(f"{digit}_tip") for digit in motion.digits]]
    apart = np.linalg.norm(tips - motion.receiver_mm[:, [motion.base]], axis=-1)
    return int(np.argmax(np.where(counts == counts.max(), np.nan_to_num(apart).sum(1), -1.0)))


def open_frame(blocks: Iterable[Poses], layout: Layout) -> Poses | None:
    """Return the poses of the frame in which the hand is open and no finger hides another.

    Of the frames with most valid receivers, including the base, it is the one with the largest sum of
    distances of the fingertips' receivers from the base. Returns None if the base is never valid.
    """
    open_pose, best = None, (0, -np.inf)
    for poses in blocks:
        base = poses.index(known_digits.root_of(layout))
        counts = np.where(poses.valid[:, base], poses.valid.sum(1), 0)
        rows = np.flatnonzero(counts == counts.max(initial=1))
        if len(rows):
            tips = poses.position_mm[rows][:, [poses.index(digit.tip) for digit in layout.digits.values()]]
            apart = np.linalg.norm(tips - poses.position_mm[rows, None, base], axis=-1)
            reach = np.nan_to_num(apart).sum(1)
            score = int(counts[rows[0]]), float(reach.max())
            if score > best:
                row = int(rows[np.argmax(reach)])
                open_pose, best = poses.take(np.array([row])), score
    return open_pose


def _bones(points: list[str], chains: Sequence[Sequence[str]], wrist: str | None) -> tuple[BoneLine, ...]:
    bones = []
    starts = Counter(chain[0] for chain in chains)
    for digit, chain in enumerate(chains):
        ends = [points.index(name) for name in chain]
        if wrist is not None:
            bones.append(BoneLine(points.index(wrist), ends[0], digit, -1, shared=True))
        for level, (start, end) in enumerate(pairwise(ends)):
            bones.append(BoneLine(start, end, digit, level, shared=level == 0 and starts[chain[0]] > 1))
    return tuple(bones)


def _skeleton(
    hand: Skeleton,
    positions: Mapping[str, Array],
    bones: tuple[BoneLine, ...],
    sd_of_tip: Mapping[str, float | None],
    on_receivers: tuple[ReceiverPoint, ...] | None,
) -> ShownSkeleton:
    points, joints = tuple(positions), hand.joints
    position_mm = np.stack(list(positions.values()), 1)
    sd_mm = [sd_of_tip.get(p, joints.get(p, {}).get("sd_mm")) for p in points]
    return ShownSkeleton(
        model=hand.model.name,
        model_index=0,
        points=points,
        position_mm=position_mm,
        on_receivers=on_receivers,
        sd_mm=np.array(sd_mm, float),  # NaN for None
        believed=tuple(belief(joints[p]) if p in joints else BELIEVED for p in points),
        bones=bones,
        axes=_axes(hand, points),
        tip_error_mm=np.full((len(position_mm), len(hand.layout.digits)), np.nan),
    )


def _axes(hand: Skeleton, points: tuple[str, ...]) -> tuple[JointAxis, ...]:
    """Return the axis of each displayed joint that has one, in its child receiver's frame."""
    axes = []
    for joint in hand.layout.solvable:
        row = hand.joints.get(joint.name)
        if row is None or joint.name not in points or row["axis_child_x"] is None:
            continue
        x, y, z = vector_of(row, "axis_child_").tolist()
        plane = joint.plane
        side = joint.parent_receiver if plane.frame == "parent" else joint.child
        cut_by = side if hand.model.planes.cut and plane.frame != "none" else ""
        axes.append(JointAxis(points.index(joint.name), joint.child, (x, y, z), cut_by, plane.normal))
    return tuple(axes)
