"""Where the bones of a skeleton are in a recording, whatever its model.

Bone frames have x distal and z dorsal (docs/conventions.md). A fitted hand moves as the fit posed its bones
with all receivers together. Of every other skeleton each bone rides on the receiver that drives it, turned
against it by the constant rotation that lays the frame along the bone; its joint is where the child half of
the centre is (that of a digit's base at the parent half or the wrist), metacarpals turn as the metacarpals
table says, and the digit ends at the origin of its distal receiver.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from schemas.layout import Digit, Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses
from skeleton.digit_chain import DigitChain, Rows, digit_chain, ride, starts_at_wrist
from skeleton.rotations import Array, bone_frame, conjugate, from_matrix, mean_rotation, multiply, rotate

_LEAST_RANGE_RAD = np.radians(1.0)
"""A joint that turns by less shows no axis."""

_XYZ = ("x", "y", "z")


@dataclass(frozen=True)
class Skeleton:
    """One hand under one model.

    joints : joint_centres' rows by joint; bones : bone_lengths' rows by digit and bone, for a bone that two
    digits share ends at another joint in each.
    """

    layout: Layout
    model: SkeletonModel
    joints: Rows
    bones: Mapping[tuple[str, str], Mapping[str, Any]]


@dataclass(frozen=True)
class Motion:
    """What the tables hold of a recording frame by frame, at the T frames of its poses, NaN in gaps.

    metacarpals : (T, 4) quaternions bone to transmitter, by digit. bone_poses : (T, 7) of fitted bones by
    segment, mm then quaternion. tips, skin_tips : (T, 3) mm of fitted digits, by digit: ends of their last
    bones, and of the skin beyond them.
    """

    metacarpals: Mapping[str, Array] = field(default_factory=dict)
    bone_poses: Mapping[str, Array] = field(default_factory=dict)
    tips: Mapping[str, Array] = field(default_factory=dict)
    skin_tips: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class SkeletonJoint:
    """A joint, and the bone that starts there.

    name : as the layout calls the joint; `<digit>_tip` is where a digit's bones end and `<digit>_skin_tip`,
    after it, where its skin does. parent : index of the joint before it, -1 where there is none. segment :
    the bone; a tip's is that which it ends. digit : empty for the root. tip : whether it is such an end. dof
    : degrees of freedom that the model gave it, 0 where none are known.
    """

    name: str
    parent: int
    segment: str
    digit: str = ""
    tip: bool = False
    dof: int = 0


@dataclass(frozen=True)
class PosedBones:
    """J joints with their bones over T frames; joint 0 is the root, and parents come before children.

    position_mm : (T, J, 3) of the joints and quaternion : (T, J, 4) unit (w, x, y, z) of the bone frames,
    both in the transmitter frame, NaN where not known; a tip has its bone's quaternion. rest_offset_mm : (J,
    3) each joint in its parent's bone frame by the bone's length; zeros for the root, all NaN for a digit's
    first joint and for the skin beyond its last bone, of which no table but the motion tells, and (NaN, 0, 0)
    where the bone before has no length. axis : (J, 3) unit, in its own bone frame, of a joint of one degree
    of freedom; NaN where there is none.
    left_out : digits that are not among the joints, and why. root_failure : why the root has no position, or
    empty.
    """

    joints: tuple[SkeletonJoint, ...]
    position_mm: Array
    quaternion: Array
    rest_offset_mm: Array
    axis: Array
    left_out: Mapping[str, str]
    root_failure: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def parents(self) -> npt.NDArray[np.int64]:
        """Index of each joint's parent (J,), -1 where there is none."""
        return np.array([joint.parent for joint in self.joints], np.int64)

    def index(self, name: str) -> int:
        """Place of the joint of that name; ValueError where there is none."""
        return self.names.index(name)


@dataclass(frozen=True)
class Seat:
    """Where a joint rides: at point_mm (3,) in the frame of the receiver of `segment`, nowhere if empty.

    name : the joint whose row of joint_centres says so (of a digit that starts at the wrist, the wrist), or
    `<digit>_tip`.
    """

    name: str
    segment: str
    point_mm: Array

    def position_mm(self, poses: Poses) -> Array:
        """Positions (T, 3) in the transmitter frame, NaN where the receiver has no valid pose."""
        if not self.segment:
            return np.full((len(poses.frame), 3), np.nan)
        valid = poses.valid[:, poses.index(self.segment), None]
        return np.where(valid, ride(poses, self.segment, self.point_mm), np.nan)


def pose_bones(skeleton: Skeleton, poses: Poses, motion: Motion) -> PosedBones:
    """Poses of all bones of a skeleton in a recording, by its model: fitted or ridden.

    A digit of which a joint failed, or that the fit does not pose, is left out. Raises InputError where the
    model asks for a first joint of its own that no receiver measures.
    """
    if skeleton.model.fitting is not None:
        return fitted_bones(skeleton, poses, motion)
    return ridden_bones(skeleton, poses, motion.metacarpals)


def ridden_bones(skeleton: Skeleton, poses: Poses, metacarpals: Mapping[str, Array]) -> PosedBones:
    """Poses of bones that ride on receivers. metacarpals : (T, 4) by digit; a digit that lacks them has NaN.

    Of a model that fits the whole hand these are its bones as its receivers alone carry them, which the tips
    table is made from.
    """
    layout = skeleton.layout
    build = _Builder([_ridden_root(skeleton, poses)])
    for digit in layout.digits.values():
        chain = digit_chain(digit, layout, skeleton.model, skeleton.joints)
        if isinstance(chain, str):
            build.left_out[digit.name] = chain
            continue
        lacking = [own for own in digit.segments if (digit.name, own) not in skeleton.bones]
        if lacking:
            build.left_out[digit.name] = f"bone_lengths has no row of {lacking[0]}"
            continue
        turn = metacarpals.get(digit.name, np.full((len(poses.frame), 4), np.nan))
        lengths_mm = [_replayed_length_mm(skeleton.bones[digit.name, own]) for own in digit.segments]
        build.add_digit(skeleton, digit, _ridden_digit(skeleton, chain, poses, turn), lengths_mm)
    return build.bones(_root_failure(skeleton))


def fitted_bones(skeleton: Skeleton, poses: Poses, motion: Motion) -> PosedBones:
    """Poses of the bones of a hand that was fitted as a whole: as the fit posed them.

    The axis of a hinge is that which its bones turn about.
    """
    layout, count, bone_poses = skeleton.layout, len(poses.frame), motion.bone_poses
    name, segment = root_names(layout)
    root = bone_poses.get(segment, np.full((count, 7), np.nan))
    build = _Builder([_Bone(SkeletonJoint(name, -1, segment), root[:, :3], root[:, 3:], np.zeros(3))])
    for digit in layout.digits.values():
        missing = [own for own in digit.segments if own not in bone_poses]
        if missing and bone_poses:
            build.left_out[digit.name] = f"the fit of the whole hand poses no {missing[0]}"
            continue
        series = [bone_poses.get(own, np.full((count, 7), np.nan)) for own in digit.segments]
        placed = [_Placed(pose[:, :3], pose[:, 3:]) for pose in series]
        end = motion.tips.get(digit.name, np.full((count, 3), np.nan))
        rows = [skeleton.bones.get((digit.name, own), {}) for own in digit.segments]
        lengths_mm = [_number(row.get("length_mm")) for row in rows]
        build.add_digit(skeleton, digit, [*placed, _Placed(end, placed[-1].quaternion)], lengths_mm)
        if digit.name in motion.skin_tips:
            build.add_skin_tip(motion.skin_tips[digit.name])
    bones = build.bones("")
    return replace(bones, axis=axes_turned_about(bones))


def rigid_positions(
    parents: Sequence[int], position_mm: Array, quaternion: Array, rest_offset_mm: Array
) -> Array:
    """Positions (T, J, 3) with bones of constant length: each joint at its rest offset from its parent.

    parents : (J,), before their children. position_mm : (T, J, 3), quaternion : (T, J, 4), rest_offset_mm :
    (J, 3) as in `PosedBones`. A joint without a parent, or whose offset is all NaN (a digit's first), stays
    where it is. The tips of `ridden_bones` so placed are those of the least-squares binding.
    """
    out = position_mm.copy()
    for index, parent in enumerate(parents):
        if parent >= 0 and not np.isnan(rest_offset_mm[index]).all():
            out[:, index] = out[:, parent] + rotate(quaternion[:, parent], rest_offset_mm[index])
    return out


def digit_seats(digit: Digit, layout: Layout, model: SkeletonModel, joints: Rows) -> tuple[Seat, ...]:
    """Seats of a digit's joints and of its tip, nowhere where a joint failed or was not solved.

    A base that is not the wrist rides on its parent's receiver, every other joint on its child's.
    """
    names, sides = list(digit.joints), ["child"] * len(digit.joints)
    if layout.wrist is not None and starts_at_wrist(digit, layout, model):
        names[0] = layout.wrist.joint
    else:
        sides[0] = "parent"
    seats = [joint_seat(name, side, joints.get(name)) for name, side in zip(names, sides, strict=True)]
    return (*seats, Seat(f"{digit.name}_tip", digit.tip, np.zeros(3)))


def joint_seat(name: str, side: str, row: Mapping[str, Any] | None) -> Seat:
    """The parent or child half of a joint, from its row of joint_centres."""
    if row is None or row["status"] == "failed" or not row[f"{side}_segment"]:
        return Seat(name, "", np.zeros(3))
    point = np.array([row[f"{side}_{axis}_mm"] for axis in _XYZ], float)
    return Seat(name, row[f"{side}_segment"], point)


@dataclass(frozen=True)
class _Placed:
    """A joint's positions (T, 3), its bone's rotations (T, 4), and its axis (3,) in the bone frame or NaN."""

    position_mm: Array
    quaternion: Array
    axis: Array = field(default_factory=lambda: np.full(3, np.nan))


@dataclass(frozen=True)
class _Bone:
    joint: SkeletonJoint
    position_mm: Array
    quaternion: Array
    offset_mm: Array
    axis: Array = field(default_factory=lambda: np.full(3, np.nan))


class _Builder:
    """The bones so far, root first; left_out : digits that are not among them, and why."""

    def __init__(self, bones: list[_Bone]) -> None:
        self._bones = bones
        self.left_out: dict[str, str] = {}

    def add_digit(
        self, skeleton: Skeleton, digit: Digit, placed: Sequence[_Placed], lengths_mm: Sequence[float]
    ) -> None:
        """Add a digit's joints and its tip; lengths_mm : of its bones, NaN where not known."""
        parent, offset = self._bone_of(digit.base), np.full(3, np.nan)
        for name, segment, place, length_mm in zip(
            digit.joints, digit.segments, placed[:-1], lengths_mm, strict=True
        ):
            row = skeleton.joints.get(name)
            joint = SkeletonJoint(
                name, parent, segment, digit.name, dof=0 if row is None else int(row["dof"])
            )
            parent = len(self._bones)
            self._bones.append(_Bone(joint, place.position_mm, place.quaternion, offset, place.axis))
            offset = np.array([length_mm, 0.0, 0.0])
        tip = SkeletonJoint(f"{digit.name}_tip", parent, digit.tip, digit.name, tip=True)
        self._bones.append(_Bone(tip, placed[-1].position_mm, placed[-1].quaternion, offset))

    def add_skin_tip(self, position_mm: Array) -> None:
        """Add where the skin of the digit added last ends, (T, 3)."""
        tip = self._bones[-1]
        joint = replace(tip.joint, name=f"{tip.joint.digit}_skin_tip", parent=len(self._bones) - 1)
        self._bones.append(_Bone(joint, position_mm, tip.quaternion, np.full(3, np.nan)))

    def _bone_of(self, segment: str) -> int:
        """Index of the joint that this segment's bone starts at, -1 where there is none."""
        for index, bone in enumerate(self._bones):
            if bone.joint.segment == segment and not bone.joint.tip:
                return index
        return -1

    def bones(self, root_failure: str) -> PosedBones:
        """All bones that were added; what they hold is let go of, as a long recording is not needed twice."""
        joints = tuple(bone.joint for bone in self._bones)
        offset = np.stack([bone.offset_mm for bone in self._bones])
        axis = np.stack([bone.axis for bone in self._bones])
        shape = (len(self._bones[0].position_mm), len(joints))
        position, turn = np.empty((*shape, 3)), np.empty((*shape, 4))
        for index in reversed(range(len(joints))):
            bone = self._bones.pop()
            position[:, index], turn[:, index] = bone.position_mm, bone.quaternion
        return PosedBones(joints, position, turn, offset, axis, self.left_out, root_failure)


def _replayed_length_mm(bone: Mapping[str, Any]) -> float:
    """Length of a bone as the replay has it: of its vector, or its own where it is posed frame by frame."""
    vector_mm = np.array([_number(bone[f"{axis}_mm"]) for axis in _XYZ])
    known = np.isfinite(vector_mm).all()
    return float(np.linalg.norm(vector_mm)) if known else _number(bone["length_mm"])


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def root_names(layout: Layout) -> tuple[str, str]:
    """Joint and segment of the root: the wrist, or without one what the first digit hangs from."""
    if layout.wrist is not None:
        return layout.wrist.joint, layout.wrist.segment
    base = next(iter(layout.digits.values())).base
    return base, base


def _root_failure(skeleton: Skeleton) -> str:
    wrist = skeleton.layout.wrist
    if wrist is None:
        return ""
    row = skeleton.joints.get(wrist.joint)
    if row is not None and row["status"] != "failed":
        return ""
    return f"joint {wrist.joint} failed ({'it was not solved' if row is None else row['message']})"


def _ridden_root(skeleton: Skeleton, poses: Poses) -> _Bone:
    """The wrist on the hand's receiver, or where a layout has no wrist that receiver itself."""
    layout = skeleton.layout
    name, segment = root_names(layout)
    seat = Seat(name, segment, np.zeros(3))
    if layout.wrist is not None:
        seat = joint_seat(name, "child", skeleton.joints.get(name))
    axes = layout.segments[segment]
    turn = from_matrix(bone_frame(np.array(axes.distal), np.array(axes.dorsal)))
    joint = SkeletonJoint(name, -1, segment)
    return _Bone(joint, seat.position_mm(poses), _turned(poses, segment, turn), np.zeros(3))


def _ridden_digit(skeleton: Skeleton, chain: DigitChain, poses: Poses, metacarpal: Array) -> list[_Placed]:
    """Joints and tip of one digit. metacarpal : (T, 4), of a digit that has one."""
    layout, digit = skeleton.layout, chain.digit
    *seats, end = digit_seats(digit, layout, skeleton.model, skeleton.joints)
    placed: list[_Placed] = []
    for index, (name, segment, seat) in enumerate(zip(digit.joints, digit.segments, seats, strict=True)):
        position = seat.position_mm(poses)
        if index == 0 and digit.metacarpal:
            placed.append(_Placed(position, metacarpal))
            continue
        row = skeleton.bones[digit.name, segment]
        vector = np.array([row[f"{axis}_mm"] for axis in _XYZ], float)
        align = from_matrix(bone_frame(vector, np.array(layout.segments[segment].dorsal)))
        turn = _turned(poses, row["driven_by"], align)
        placed.append(_Placed(position, turn, _solved_axis(skeleton.joints.get(name), align)))
    return [*placed, _Placed(end.position_mm(poses), placed[-1].quaternion)]


def _solved_axis(row: Mapping[str, Any] | None, align: Array) -> Array:
    """A hinge's axis in its bone's frame, which is turned by `align` against its receiver; NaN if none."""
    if row is None or row["dof"] != 1 or row["axis_child_x"] is None:
        return np.full(3, np.nan)
    return rotate(conjugate(align), np.array([row[f"axis_child_{axis}"] for axis in _XYZ], float))


def _turned(poses: Poses, segment: str, align: Array) -> Array:
    """Rotations (T, 4) of a frame that a receiver carries, NaN where it is not valid."""
    index = poses.index(segment)
    turn = multiply(poses.quaternion[:, index], align)
    return np.where(poses.valid[:, index, None], turn, np.nan)


def axes_turned_about(bones: PosedBones) -> Array:
    """Axes (J, 3), each in its bone's frame, of the joints of one degree of freedom; NaN of the others."""
    return np.stack([_axis_turned_about(bones, index) for index in range(len(bones.joints))])


def _axis_turned_about(bones: PosedBones, index: int) -> Array:
    """The axis (3,) that a joint of one degree of freedom turns about, as the posed bones show it.

    The fit turns such a joint about one constant axis, which the bones' own rotations hold without the
    receivers' skin. NaN where it hardly moves.
    """
    joint = bones.joints[index]
    if joint.dof != 1 or joint.parent < 0:
        return np.full(3, np.nan)
    relative = multiply(conjugate(bones.quaternion[:, joint.parent]), bones.quaternion[:, index])
    relative = relative[np.isfinite(relative).all(-1)]
    if not len(relative):
        return np.full(3, np.nan)
    change = multiply(conjugate(mean_rotation(relative)), relative)
    vector = change[:, 1:] * np.where(change[:, :1] < 0, -1.0, 1.0)
    axis = np.linalg.eigh(vector.T @ vector)[1][:, -1]
    if 2 * np.ptp(np.arcsin(np.clip(vector @ axis, -1, 1))) < _LEAST_RANGE_RAD:
        return np.full(3, np.nan)
    return np.asarray(axis * np.sign(axis[np.argmax(np.abs(axis))]))
