"""What moves in the view: joints and tips of one hand's skeletons over one recording, and its receivers.

A fitted hand moves as the bones that were posed with all receivers. Every other skeleton moves as in the
still picture (`stages.report.posed_skeleton`): each joint rides on a receiver, and a digit ends at its
distal receiver.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from kinematics.rotations import matrix
from kinematics.skeleton import ride, starts_at_wrist
from schemas.catalogue import BONE_POSES, JOINT_CENTRES, POSED_TIPS, RECEIVERS, TIPS
from schemas.errors import InputError
from schemas.layout import Digit, Layout, Vector
from schemas.model import SkeletonModel, the_papers
from schemas.poses import Poses, read_poses
from schemas.results import Results
from schemas.study import Recording
from schemas.tables import Table, column_array, read_table, rows_of
from stages.report.read_once import small_table

Array = npt.NDArray[np.float64]
Rows = Mapping[str, Mapping[str, Any]]

MOST_FRAMES = 15_000
"""Frames that a view holds at most: a minute at 240 frames a second."""

_PLACE = ("x_mm", "y_mm", "z_mm")
_TIP = tuple(f"tip_{name}" for name in _PLACE)

REPLAY_ERROR = "replayed fingertip to the receiver (least-squares binding)"
FITTED_ERROR = "distal receiver from where the hand posed with all receivers puts it"


@dataclass(frozen=True)
class Bone:
    """A line between two points (indices). digit : its index; level : 0 for a digit's first bone, -1 for
    the line from the wrist to where a digit starts, which is no bone. shared : whether other digits' bones
    start at the same point.
    """

    start: int
    end: int
    digit: int
    level: int
    shared: bool


@dataclass(frozen=True)
class JointAxis:
    """A joint's rotation axis, and the sagittal plane that cuts it where the model has one.

    point : index of the joint, which the plane goes through. axis : (3,) unit, in the frame of the receiver
    of `segment`. normal : (3,) in that of plane_segment, which is empty where no plane cuts.
    """

    point: int
    segment: str
    axis: Vector
    plane_segment: str
    normal: Vector


@dataclass(frozen=True)
class Seat:
    """Where a point rides: at local_mm in the frame of the receiver of segment, nowhere if that is empty."""

    segment: str
    local_mm: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SkeletonMotion:
    """One skeleton over T frames: P points, B bones, D digits.

    points : names of joints, then of tips. position_mm : (T, P, 3) in the transmitter frame, NaN in gaps.
    seats : where each point rides, if every point is fixed on a receiver; None for a fitted skeleton.
    sd_mm : (P,) 1-sigma error of each point in 3-D, NaN where none is stated. status : (P,) ok, weak or
    failed. tip_error_mm : (T, D), NaN in gaps; error_is : what that is, in words.
    """

    model: str
    points: tuple[str, ...]
    position_mm: Array
    seats: tuple[Seat, ...] | None
    sd_mm: Array
    status: tuple[str, ...]
    bones: tuple[Bone, ...]
    axes: tuple[JointAxis, ...]
    tip_error_mm: Array
    error_is: str


@dataclass(frozen=True)
class HandMotion:
    """One hand over T frames: R receivers and one skeleton or more, all in the transmitter frame.

    frame : (T,) as recorded; time_s : (T,) device time, NaN where the recording has none. every : how many
    recorded frames there are to one kept here. receiver_mm : (T, R, 3), receiver_quaternion : (T, R, 4) unit
    (w, x, y, z), receiver to transmitter frame, both NaN where not valid. base : the receiver that the view
    hangs on; distal, dorsal : unit vectors in its frame. paper : the paper's skeleton, if it is among these.
    """

    hand: str
    digits: tuple[str, ...]
    frame: npt.NDArray[np.int64]
    time_s: Array
    every: int
    receivers: tuple[str, ...]
    receiver_mm: Array
    receiver_quaternion: Array
    base: int
    distal: Vector
    dorsal: Vector
    skeletons: tuple[SkeletonMotion, ...]
    paper: str = ""


def read_motion(
    paths: Results, recording: Recording, layout: Layout, models: Sequence[SkeletonModel]
) -> HandMotion:
    """Read one recording's poses and its hand's tables under each model.

    Raises InputError where a table is absent or its making failed.
    """
    poses = read_poses(paths.poses(recording), layout.measured)
    skeletons = [_read_skeleton(paths, recording, layout, model, poses) for model in models]
    motion = hand_motion(recording.hand.hand, layout, poses, skeletons)
    return replace(motion, paper=the_papers(models))


def _read_skeleton(
    paths: Results, recording: Recording, layout: Layout, model: SkeletonModel, poses: Poses
) -> SkeletonMotion:
    hand = recording.hand

    def path_of(table: Table) -> Path:
        return paths.hand_table(model.name, hand, table.name)

    def whole(table: Table) -> pa.Table:
        return small_table(path_of(table), table)

    def ours(table: Table, columns: Sequence[str]) -> pa.Table:
        rows = read_table(path_of(table), table, ["task", "trial", "frame", *columns])
        wanted = pc.and_(pc.equal(rows["task"], recording.task), pc.equal(rows["trial"], recording.trial))
        return rows.filter(wanted)

    joints = {row["joint"]: row for row in rows_of(whole(JOINT_CENTRES))}
    if model.fitting is None:
        return ridden_skeleton(layout, model, joints, ours(TIPS, ["digit", "error_mm"]), poses)
    worn = {row["segment"]: row for row in rows_of(whole(RECEIVERS))}
    bones = ours(BONE_POSES, ["segment", *_PLACE])
    tips = ours(POSED_TIPS, ["digit", *_TIP, "error_mm"])
    return fitted_skeleton(layout, model, joints, worn, bones, tips, poses)


def hand_motion(hand: str, layout: Layout, poses: Poses, skeletons: Iterable[SkeletonMotion]) -> HandMotion:
    """Join skeletons with the receivers that they were made from, thinned to MOST_FRAMES.

    Receivers without a valid pose are left out. Raises InputError where the receiver that the view hangs on
    has none: then nothing says which way the hand is up.
    """
    base = next(iter(layout.digits.values())).base
    worn = np.asarray(poses.valid.any(axis=0))
    if not worn[poses.index(base)]:
        raise InputError(
            f"the receiver of {base} has no valid pose; without it no view of the hand is upright"
        )
    valid = poses.valid[..., None]
    motion = HandMotion(
        hand=hand,
        digits=tuple(layout.digits),
        frame=poses.frame,
        time_s=poses.time_s,
        every=1,
        receivers=tuple(name for name, there in zip(poses.segments, worn, strict=True) if there),
        receiver_mm=np.where(valid, poses.position_mm, np.nan)[:, worn],
        receiver_quaternion=np.where(valid, poses.quaternion, np.nan)[:, worn],
        base=int(worn[: poses.index(base)].sum()),
        distal=layout.segments[base].distal,
        dorsal=layout.segments[base].dorsal,
        skeletons=tuple(skeletons),
    )
    return thinned(motion, MOST_FRAMES)


def thinned(motion: HandMotion, most: int) -> HandMotion:
    """Every n-th frame, n the smallest that leaves at most `most` frames; the frames keep their numbers."""
    every = -(-len(motion.frame) // most)
    if every <= 1:
        return motion
    skeletons = tuple(
        replace(s, position_mm=s.position_mm[::every], tip_error_mm=s.tip_error_mm[::every])
        for s in motion.skeletons
    )
    return replace(
        motion,
        frame=motion.frame[::every],
        time_s=motion.time_s[::every],
        every=motion.every * every,
        receiver_mm=motion.receiver_mm[::every],
        receiver_quaternion=motion.receiver_quaternion[::every],
        skeletons=skeletons,
    )


def shown_first(motion: HandMotion) -> tuple[int, ...]:
    """Which skeletons a view shows before any is chosen: the last fitted one that was posed in this
    recording, else the first; beside it the paper's or else the first of the others, if there are any.
    """
    posed = [np.isfinite(skeleton.position_mm).any() for skeleton in motion.skeletons]
    fitted = [i for i, s in enumerate(motion.skeletons) if s.seats is None and posed[i]]
    first = fitted[-1] if fitted else 0
    others = [i for i in range(len(motion.skeletons)) if i != first and posed[i]]
    others.sort(key=lambda i: motion.skeletons[i].model != motion.paper)
    return (first, *others[:1])


def upright(motion: HandMotion) -> Array:
    """The view's axes as rows (3, 3) in the base receiver's frame: right, up (distal), towards the viewer.

    The viewer sees the back of the hand. Right is distal x dorsal, so that no hand is ever mirrored.
    """
    distal, dorsal = np.array(motion.distal), np.array(motion.dorsal)
    return np.stack([np.cross(distal, dorsal), distal, dorsal])


def seen(motion: HandMotion, frames: npt.NDArray[np.int64], world_mm: Array) -> Array:
    """Points (F, n, 3) of the frames (F,), indices, in the view's axes; NaN where the base has no pose."""
    turn = matrix(motion.receiver_quaternion[frames, motion.base])
    origin = motion.receiver_mm[frames, motion.base]
    return np.asarray((world_mm - origin[:, None]) @ turn @ upright(motion).T)


def ridden_skeleton(
    layout: Layout, model: SkeletonModel, joints: Rows, tips: pa.Table, poses: Poses
) -> SkeletonMotion:
    """A skeleton whose joints ride on receivers: at child halves, a digit's own base at its parent half.

    joints : rows of joint_centres by joint; tips : this recording's rows of the tips table.
    """
    seats: dict[str, Seat] = {}
    chains: list[list[str]] = []
    for digit in layout.digits.values():
        anchors = _anchors(digit, layout, model)
        for name, side in anchors:
            seats.setdefault(name, _seat(joints.get(name), side))
        seats[f"{digit.name} tip"] = Seat(digit.tip)
        chains.append([*(name for name, _ in anchors), f"{digit.name} tip"])
    places = {name: _ridden(seat, poses) for name, seat in seats.items()}
    bones = _bones(list(places), chains, None)
    skeleton = _skeleton(layout, model, places, bones, joints, {}, _by_digit(layout, tips, poses))
    return replace(skeleton, seats=tuple(seats.values()))


def fitted_skeleton(
    layout: Layout,
    model: SkeletonModel,
    joints: Rows,
    worn: Rows,
    bone_poses: pa.Table,
    posed_tips: pa.Table,
    poses: Poses,
) -> SkeletonMotion:
    """A fitted hand, its bones as posed; each digit ends at the end of its distal bone.

    joints : rows of joint_centres by joint; worn : rows of receivers by segment; bone_poses, posed_tips :
    this recording's rows of those tables.
    """
    wrist = layout.wrist
    places = {wrist.joint: _placed(bone_poses, "segment", wrist.segment, _PLACE, poses)} if wrist else {}
    chains: list[list[str]] = []
    sd_of_tip: dict[str, float] = {}
    for digit in layout.digits.values():
        for joint, segment in zip(digit.joints, digit.segments, strict=True):
            places[joint] = _placed(bone_poses, "segment", segment, _PLACE, poses)
        tip = f"{digit.name} tip"
        places[tip] = _placed(posed_tips, "digit", digit.name, _TIP, poses)
        chains.append([*digit.joints, tip])
        sd_of_tip[tip] = _number(worn.get(digit.tip, {}).get("bone_tip_sd_mm"))
    bones = _bones(list(places), chains, wrist.joint if wrist else None)
    return _skeleton(layout, model, places, bones, joints, sd_of_tip, _by_digit(layout, posed_tips, poses))


def _anchors(digit: Digit, layout: Layout, model: SkeletonModel) -> list[tuple[str, str]]:
    """Each joint of the digit and the half that places it, as the first-frame binding does."""
    names, sides = list(digit.joints), ["child"] * len(digit.joints)
    if layout.wrist is not None and starts_at_wrist(digit, layout, model):
        names[0] = layout.wrist.joint
    else:
        sides[0] = "parent"
    return list(zip(names, sides, strict=True))


def _seat(row: Mapping[str, Any] | None, side: str) -> Seat:
    """Where that half of a joint rides: nowhere if the joint failed or was not solved."""
    if row is None or row["status"] == "failed" or not row[f"{side}_segment"]:
        return Seat("")
    x, y, z = (float(row[f"{side}_{axis}_mm"]) for axis in "xyz")
    return Seat(row[f"{side}_segment"], (x, y, z))


def _ridden(seat: Seat, poses: Poses) -> Array:
    """Positions (T, 3) of what rides there, NaN where the receiver has no valid pose."""
    if not seat.segment:
        return np.full((len(poses.frame), 3), np.nan)
    index = poses.index(seat.segment)
    return np.where(poses.valid[:, index, None], ride(poses, seat.segment, np.array(seat.local_mm)), np.nan)


def _placed(table: pa.Table, key: str, value: str, columns: Sequence[str], poses: Poses) -> Array:
    """Columns (T, n) of one segment or digit at the frames of the poses, NaN where the table has no row."""
    rows = table.filter(pc.equal(table[key], value))
    out = np.full((len(poses.frame), len(columns)), np.nan)
    _, here, there = np.intersect1d(poses.frame, column_array(rows, "frame"), return_indices=True)
    out[here] = np.stack([column_array(rows, name).astype(float) for name in columns], -1)[there]
    return out


def _by_digit(layout: Layout, table: pa.Table, poses: Poses) -> Array:
    return np.concatenate([_placed(table, "digit", name, ["error_mm"], poses) for name in layout.digits], 1)


def _bones(points: list[str], chains: list[list[str]], wrist: str | None) -> tuple[Bone, ...]:
    bones = []
    starts = Counter(chain[0] for chain in chains)
    for digit, chain in enumerate(chains):
        ends = [points.index(name) for name in chain]
        if wrist is not None:
            bones.append(Bone(points.index(wrist), ends[0], digit, -1, shared=True))
        for level, (start, end) in enumerate(pairwise(ends)):
            bones.append(Bone(start, end, digit, level, shared=level == 0 and starts[chain[0]] > 1))
    return tuple(bones)


def _skeleton(
    layout: Layout,
    model: SkeletonModel,
    places: Mapping[str, Array],
    bones: tuple[Bone, ...],
    joints: Rows,
    sd_of_tip: Mapping[str, float],
    tip_error_mm: Array,
) -> SkeletonMotion:
    points = tuple(places)
    sd = [sd_of_tip.get(p, _number(joints.get(p, {}).get("sd_mm"))) for p in points]
    return SkeletonMotion(
        model=model.name,
        points=points,
        position_mm=np.stack(list(places.values()), 1),
        seats=None,
        sd_mm=np.array(sd),
        status=tuple(joints[p]["status"] if p in joints else "ok" for p in points),
        bones=bones,
        axes=_axes(layout, model, points, joints),
        tip_error_mm=tip_error_mm,
        error_is=REPLAY_ERROR if model.fitting is None else FITTED_ERROR,
    )


def _axes(
    layout: Layout, model: SkeletonModel, points: tuple[str, ...], joints: Rows
) -> tuple[JointAxis, ...]:
    """The axis of each joint drawn that has one, in its child receiver's frame."""
    axes = []
    for joint in layout.solvable:
        row = joints.get(joint.name)
        if row is None or joint.name not in points or row["axis_child_x"] is None:
            continue
        x, y, z = (float(row[f"axis_child_{axis}"]) for axis in "xyz")
        plane = joint.plane
        side = joint.parent_receiver if plane.frame == "parent" else joint.child
        cut_by = side if model.cut and plane.frame != "none" else ""
        axes.append(JointAxis(points.index(joint.name), joint.child, (x, y, z), cut_by, plane.normal))
    return tuple(axes)


def _number(value: float | None) -> float:
    return np.nan if value is None else float(value)
