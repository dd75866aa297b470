"""Where the bones of a skeleton are in a recording, whatever its model.

Bone frames have x distal and z dorsal (docs/conventions.md). A fitted hand moves as the fit posed its bones
with all receivers together. Of every other skeleton each bone goes with the receiver that drives it, turned
against it by the constant rotation that lays the frame along the bone; its joint is where the child half of
the centre is (that of a digit's base at the parent half or the wrist), metacarpals turn as the metacarpals
table says, and the digit ends at the origin of its distal receiver.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.arrays import Array, Bools, Index
from shukotsu.errors import InputError, guess
from shukotsu.hand.digit_chain import Rows, carried_mm, digit_chain, starts_at_wrist
from shukotsu.hand.rotations import bone_frame, conjugate, from_matrix, mean_rotation, multiply, rotate
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.study.layout import Digit, Layout
from shukotsu.study.model import SkeletonModel
from shukotsu.tables.device_clock import nominal_rate_hz
from shukotsu.tables.poses import Poses, RecordingName
from shukotsu.tables.typed_table import vector_of

if TYPE_CHECKING:
    import xarray

_LEAST_RANGE_RAD = np.radians(1.0)
"""A joint that turns by less shows no axis."""


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


ZERO_COLUMNS = ("rest_flexion_deg", "rest_abduction_deg", "rest_rotation_deg", "axes_turn_deg")
"""Columns of joint_centres that say where a fitted joint's angles are zero, and about what they turn."""


@dataclass(frozen=True)
class SkeletonJoint:
    """A joint, and the bone that starts there.

    name : as the layout calls the joint; `<digit>_tip` is where a digit's bones end and `<digit>_skin_tip`,
    after it, where its skin does. parent : index of the joint before it, -1 where there is none. segment :
    the bone; a tip's is that which it ends. digit : empty for the root. tip : whether it is such an end. dof
    : degrees of freedom that the model gave it, 0 where none are known. zero_deg : numbers of `ZERO_COLUMNS`;
    none where the model has none.
    """

    name: str
    parent: int
    segment: str
    digit: str = ""
    tip: bool = False
    dof: int = 0
    zero_deg: tuple[float, ...] = ()


@dataclass(frozen=True)
class Origin:
    """Whose motion it is and what it was made from.

    inputs : SHA-256 of the tables, by their path in the results folder. licence : words of the user.
    """

    recording: RecordingName
    model: str = ""
    layout: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    licence: str = ""

    def __str__(self) -> str:
        return ", ".join(part for part in (str(self.recording), self.model) if part)


@dataclass(frozen=True)
class PosedRecording:
    """A hand's B bones over T frames under a model; bone 0 is the root, and parents come before children.

    Parameters
    ----------
    joints : tuple of SkeletonJoint, length B
        The bones, each named by the joint that it starts at.
    position_mm : array, shape (T, B, 3)
        Of the joints, in the transmitter frame; NaN where not known.
    quaternion : array, shape (T, B, 4)
        Unit (w, x, y, z), bone to transmitter frame, x distal and z dorsal; NaN where not known. A tip has
        its bone's.
    receivers : Poses
        The R receivers that the bones come from, over the same frames, by number and device time, NaN where
        there is none.
    rest_offset_mm : array, shape (B, 3)
        Each joint in its parent's bone frame by the bone's length; zeros for the root, all NaN for a digit's
        first joint and for the skin beyond its last bone, of which no table but the motion tells, and
        (NaN, 0, 0) where the bone before has no length.
    axis : array, shape (B, 3)
        Unit vector in its own bone's frame, of a joint of one degree of freedom; NaN where there is none.
    left_out : mapping of str to str
        Digits that are not among the bones, and why.
    root_failure : str
        Why the root has no position.
    rest, neutral : array, shape (B, 4)
        Each bone against its parent, on average over time, and where its joint angles are zero
        (docs/movement.md), NaN where no anatomy says; both from `hand.neutral_bones.at_rest` on.
    origin : Origin
        Whose motion it is.
    rate_hz : float
        Frames a second, NaN where the times do not tell.
    notes : tuple of str
        Sentences, in order, on what is left out and what was done to the motion since it was read.

    """

    joints: tuple[SkeletonJoint, ...]
    position_mm: Array
    quaternion: Array
    receivers: Poses
    rest_offset_mm: Array
    axis: Array
    left_out: Mapping[str, str] = field(default_factory=dict)
    root_failure: str = ""
    rest: Array = field(default_factory=lambda: np.empty((0, 4)))
    neutral: Array = field(default_factory=lambda: np.empty((0, 4)))
    origin: Origin = Origin(RecordingName("", "", ""))
    rate_hz: float = float("nan")
    notes: tuple[str, ...] = ()

    @property
    def frame(self) -> Index:
        """Numbers of the frames (T,) as recorded; where resampled, of the one nearest in time."""
        return self.receivers.frame

    @property
    def time_s(self) -> Array:
        """Device times (T,), NaN where the recording has none."""
        return self.receivers.time_s

    @property
    def hand(self) -> str:
        """Side of the hand, right or left."""
        return self.origin.recording.hand

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints; `<digit>_tip` ends a digit's bones, `<digit>_skin_tip` its skin."""
        return tuple(joint.name for joint in self.joints)

    @property
    def parents(self) -> Index:
        """Index of each joint's parent (B,), -1 where there is none."""
        return np.array([joint.parent for joint in self.joints], np.int64)

    @cached_property
    def known(self) -> Bools:
        """Whether joints have a whole pose in frames, (T, B)."""
        return known_points(self.position_mm, self.quaternion)

    @property
    def whole(self) -> Bools:
        """Frames (T,) in which every joint has a pose."""
        return np.asarray(self.known.all(1))

    def index(self, joint: str) -> int:
        """Return the place of a joint among the bones; InputError where there is none of that name."""
        if joint not in self.names:
            raise InputError(f"the hand has no joint {joint!r}; {guess(joint, self.names)}")
        return self.names.index(joint)

    def in_hand_mm(self) -> Array:
        """Return positions (T, B, 3) in the frame of the root, which is at zero: x distal, z dorsal."""
        moved = self.position_mm - self.position_mm[:, :1]
        return rotate(conjugate(self.quaternion[:, :1]), moved)

    def to_xarray(self) -> xarray.Dataset:
        """Return the moving hand with named dimensions and units, as the package movement names them.

        Returns
        -------
        xarray.Dataset
            `position` (time, bone, space) in mm and `rotation` (time, bone, quaternion), bone to transmitter
            frame, NaN in gaps. A bone has the name of the joint that it starts at; coordinates are its
            `segment` and its parent's name, and each time's `frame` number. Time is in s, or is the frame
            number unless every frame has a device time.

        Raises
        ------
        InputError
            Where xarray is not installed.

        """
        try:
            import xarray
        except ModuleNotFoundError as error:
            raise InputError("to_xarray: needs xarray; run `pip install shukotsu[xarray]`") from error
        timed = bool(np.isfinite(self.time_s).all())
        time = self.time_s if timed else self.frame
        parents = [self.names[joint.parent] if joint.parent >= 0 else "" for joint in self.joints]
        coordinates = {
            "time": ("time", time, {"units": "s" if timed else "frames"}),
            "space": [*"xyz"],
            "quaternion": [*"wxyz"],
            "bone": [*self.names],
            "frame": ("time", self.frame),
            "parent": ("bone", parents),
            "segment": ("bone", [joint.segment for joint in self.joints]),
        }
        variables = {
            "position": (("time", "bone", "space"), self.position_mm, {"units": "mm"}),
            "rotation": (("time", "bone", "quaternion"), self.quaternion, {"units": "1"}),
        }
        rate_hz = nominal_rate_hz(self.frame, self.time_s)
        attributes = vars(self.origin.recording) | {"model": self.origin.model, "layout": self.origin.layout}
        attributes |= {"fs": rate_hz, "source_software": f"{PROGRAM} {VERSION}"}
        return xarray.Dataset(variables, coordinates, attributes)

    def only(self, kept: Sequence[int]) -> PosedRecording:
        """Select some of the joints, each with its parent.

        Parameters
        ----------
        kept : sequence of int
            Their indices, ascending.

        Returns
        -------
        PosedRecording
            With these joints.

        """
        new_index = {-1: -1} | {old: new for new, old in enumerate(kept)}
        return replace(
            self,
            joints=tuple(
                replace(self.joints[index], parent=new_index[self.joints[index].parent]) for index in kept
            ),
            position_mm=self.position_mm[:, kept],
            quaternion=self.quaternion[:, kept],
            rest_offset_mm=self.rest_offset_mm[kept],
            axis=self.axis[kept],
        )

    def mapped(
        self, move: Callable[[Array], Array], turn: Callable[[Array], Array], **times: Any
    ) -> PosedRecording:
        """Replace positions and rotations of joints and receivers by functions of them.

        Parameters
        ----------
        move : callable
            Positions (T, N, 3), mm, to positions (F, N, 3).
        turn : callable
            Rotations (T, N, 4) to rotations (F, N, 4).
        **times : array
            frame, time_s (F,) and valid (F, R), where they change too.

        Returns
        -------
        PosedRecording
            The motion in F frames.

        """
        there = self.receivers
        there = replace(
            there, position_mm=move(there.position_mm), quaternion=turn(there.quaternion), **times
        )
        turned = turn(self.quaternion)
        return replace(self, position_mm=move(self.position_mm), quaternion=turned, receivers=there)

    def take(self, rows: slice | Index | Bools) -> PosedRecording:
        """Select some of the frames.

        Parameters
        ----------
        rows : slice or array
            Indices, or a mask (T,).

        Returns
        -------
        PosedRecording
            With these frames.

        """
        receivers = self.receivers.take(rows if isinstance(rows, slice) else np.arange(len(self.frame))[rows])
        kept = self.position_mm[rows], self.quaternion[rows]
        return replace(self, position_mm=kept[0], quaternion=kept[1], receivers=receivers)

    def noting(self, *sentences: str) -> PosedRecording:
        """Return the same with more notes."""
        return replace(self, notes=(*self.notes, *sentences))


def known_points(position_mm: Array, quaternion: Array) -> Bools:
    """Find the points that have a whole pose.

    Parameters
    ----------
    position_mm : array, shape (T, N, 3)
        Positions, NaN in gaps.
    quaternion : array, shape (T, N, 4)
        Rotations, NaN in gaps.

    Returns
    -------
    array of bool, shape (T, N)
        Whether position and rotation are finite.

    """
    return np.asarray(np.isfinite(position_mm).all(-1) & np.isfinite(quaternion).all(-1))


@dataclass(frozen=True)
class ReceiverPoint:
    """A joint's centre or a tip that a receiver carries: at point_mm (3,) in the frame of that of `segment`.

    name : the joint whose row of joint_centres says so (of a digit that starts at the wrist, the wrist), or
    `<digit>_tip`. segment : empty where the point is nowhere.
    """

    name: str
    segment: str
    point_mm: Array

    def position_mm(self, poses: Poses) -> Array:
        """Positions of the point over time.

        Parameters
        ----------
        poses : Poses
            T frames.

        Returns
        -------
        array, shape (T, 3)
            In the transmitter frame, mm; NaN where the receiver has no valid pose.

        """
        if not self.segment:
            return np.full((len(poses.frame), 3), np.nan)
        valid = poses.valid[:, poses.index(self.segment), None]
        return np.where(valid, carried_mm(poses, self.segment, self.point_mm), np.nan)


def receiver_bones(skeleton: Skeleton, poses: Poses, metacarpals: Mapping[str, Array]) -> PosedRecording:
    """Pose the bones of a hand as its receivers carry them.

    The tips table is made from these bones, also for a model that fits the whole hand. A digit of which a
    joint failed is left out.

    Parameters
    ----------
    skeleton : Skeleton
        Joints and bones of the hand.
    poses : Poses
        The receivers over T frames.
    metacarpals : mapping
        Digit -> quaternions (T, 4), bone to transmitter frame; NaN is taken for a digit that it lacks.

    Returns
    -------
    PosedRecording
        The bones, NaN where their receiver has no pose.

    Raises
    ------
    InputError
        Where the model asks for a first joint of its own that no receiver measures.

    """
    layout = skeleton.layout
    name, segment = root_names(layout)
    point, root_failure = ReceiverPoint(name, segment, np.zeros(3)), ""
    if layout.wrist is not None:
        row = skeleton.joints.get(name)
        point = joint_point(name, "child", row)
        if row is None or row["status"] == "failed":
            root_failure = f"{name} failed: {'it was not solved' if row is None else row['message']}"
    axes = layout.segments[segment]
    align = from_matrix(bone_frame(np.array(axes.distal), np.array(axes.dorsal)))
    root = point.position_mm(poses), _frame_rotations(poses, segment, align), NO_AXIS
    build, frames = _Builder(SkeletonJoint(name, -1, segment), root), _bone_frames(skeleton)
    for digit in layout.digits.values():
        chain = digit_chain(digit, layout, skeleton.model, skeleton.joints)
        if isinstance(chain, str):
            build.left_out[digit.name] = chain
            continue
        lacking = [bone for bone in digit.segments if (digit.name, bone) not in skeleton.bones]
        if lacking:
            build.left_out[digit.name] = f"bone_lengths has no row of {lacking[0]}"
            continue
        turn = metacarpals.get(digit.name, np.full((len(poses.frame), 4), np.nan))
        rows = [skeleton.bones[digit.name, bone] for bone in digit.segments]
        # as the replay has them: of their vectors, or their own where a bone is posed frame by frame
        lengths_mm = [float(np.linalg.norm(vector_of(row, "", "_mm"))) for row in rows]
        lengths_mm = [
            length_mm if np.isfinite(length_mm) else _number(row["length_mm"])
            for length_mm, row in zip(lengths_mm, rows, strict=True)
        ]
        placed = _receiver_digit(skeleton, digit, poses, turn, frames)
        build.add_digit(skeleton, digit, placed, lengths_mm)
    return build.bones(poses, root_failure)


def fitted_bones(
    skeleton: Skeleton, poses: Poses, bone_poses: Mapping[str, Array], ends_mm: Mapping[str, Array]
) -> PosedRecording:
    """Pose the bones of a hand that was fitted as a whole, as the fit posed them.

    Parameters
    ----------
    skeleton : Skeleton
        Joints and bones of the hand.
    poses : Poses
        The receivers over T frames.
    bone_poses : mapping
        Segment -> poses (T, 7): position in mm, then quaternion, in the transmitter frame.
    ends_mm : mapping
        Digit -> end of its last bone and of the skin beyond, (T, 6), or of the bone alone, (T, 3).

    Returns
    -------
    PosedRecording
        The bones; the axis of a hinge is the one about which its bones turn.

    """
    layout, count = skeleton.layout, len(poses.frame)
    name, segment = root_names(layout)

    def pose_of(bone: str) -> _Placed:
        pose = bone_poses.get(bone, np.full((count, 7), np.nan))
        return pose[:, :3], pose[:, 3:], NO_AXIS

    build = _Builder(SkeletonJoint(name, -1, segment), pose_of(segment))
    for digit in layout.digits.values():
        missing = [bone for bone in digit.segments if bone not in bone_poses]
        if missing and bone_poses:
            build.left_out[digit.name] = f"the fit of the whole hand poses no {missing[0]}"
            continue
        bones = [pose_of(bone) for bone in digit.segments]
        ends = ends_mm.get(digit.name, np.full((count, 3), np.nan))
        rows = [skeleton.bones.get((digit.name, bone), {}) for bone in digit.segments]
        lengths_mm = [_number(row.get("length_mm")) for row in rows]
        turn = bones[-1][1]
        build.add_digit(skeleton, digit, [*bones, (ends[:, :3], turn, NO_AXIS)], lengths_mm)
        if ends.shape[1] > 3:
            tip = build.joints[-1]
            skin = replace(tip, name=f"{digit.name}_skin_tip", parent=len(build.joints) - 1)
            build.add(skin, (ends[:, 3:], turn, NO_AXIS), np.full(3, np.nan))
    posed = build.bones(poses, "")
    axes = [_axis_turned_about(posed, index) for index in range(len(posed.joints))]
    return replace(posed, axis=np.stack(axes))


def rigid_positions(posed: PosedRecording) -> Array:
    """Place bones of constant length: each joint at its rest offset from its parent.

    Parameters
    ----------
    posed : PosedRecording
        The hand, over T frames and B bones.

    Returns
    -------
    array, shape (T, B, 3)
        mm, transmitter frame. A joint without a parent, or whose offset is all NaN (a digit's first), stays
        where it is. The tips of `receiver_bones` so placed are those of the least-squares binding.

    """
    out = posed.position_mm.copy()
    for index, (joint, offset_mm) in enumerate(zip(posed.joints, posed.rest_offset_mm, strict=True)):
        if joint.parent >= 0 and not np.isnan(offset_mm).all():
            out[:, index] = out[:, joint.parent] + rotate(posed.quaternion[:, joint.parent], offset_mm)
    return out


def digit_points(
    digit: Digit, layout: Layout, model: SkeletonModel, joints: Rows
) -> tuple[ReceiverPoint, ...]:
    """Return a digit's joints and its tip on the receivers, nowhere where a joint failed or was not solved.

    A base that is not the wrist goes with its parent's receiver, every other joint with its child's.
    """
    names, sides = list(digit.joints), ["child"] * len(digit.joints)
    if layout.wrist is not None and starts_at_wrist(digit, layout, model):
        names[0] = layout.wrist.joint
    else:
        sides[0] = "parent"
    points = [joint_point(name, side, joints.get(name)) for name, side in zip(names, sides, strict=True)]
    return (*points, ReceiverPoint(f"{digit.name}_tip", digit.tip, np.zeros(3)))


def joint_point(name: str, side: str, row: Mapping[str, Any] | None) -> ReceiverPoint:
    """Return the parent or child half of a joint, from its row of joint_centres."""
    if row is None or row["status"] == "failed" or not row[f"{side}_segment"]:
        return ReceiverPoint(name, "", np.zeros(3))
    return ReceiverPoint(name, row[f"{side}_segment"], vector_of(row, f"{side}_", "_mm"))


NO_AXIS = np.full(3, np.nan)

_Placed = tuple[Array, Array, Array]
"""A joint's positions (T, 3), its bone's rotations (T, 4), and its axis (3,) in the bone frame or NaN."""


class _Builder:
    """The bones so far, root first: joints, where they are, rest offsets; left_out : digits, and why."""

    def __init__(self, joint: SkeletonJoint, placed: _Placed) -> None:
        self.joints, self._placed, self._offsets = [joint], [placed], [np.zeros(3)]
        self.left_out: dict[str, str] = {}

    def add(self, joint: SkeletonJoint, placed: _Placed, offset_mm: Array) -> None:
        """Add a joint."""
        self.joints.append(joint)
        self._placed.append(placed)
        self._offsets.append(offset_mm)

    def add_digit(
        self, skeleton: Skeleton, digit: Digit, placed: Sequence[_Placed], lengths_mm: Sequence[float]
    ) -> None:
        """Add a digit's joints and its tip; lengths_mm : of its bones, NaN where not known."""
        starts = [index for index, joint in enumerate(self.joints) if joint.segment == digit.base]
        parent, offset = next(iter(starts), -1), np.full(3, np.nan)
        for name, segment, pose, length_mm in zip(
            digit.joints, digit.segments, placed[:-1], lengths_mm, strict=True
        ):
            row: Mapping[str, Any] = skeleton.joints.get(name, {})
            zero_deg = tuple(row[column] for column in ZERO_COLUMNS if row.get(column) is not None)
            dof = int(row.get("dof", 0))
            joint = SkeletonJoint(name, parent, segment, digit.name, dof=dof, zero_deg=zero_deg)
            parent = len(self.joints)
            self.add(joint, pose, offset)
            offset = np.array([length_mm, 0.0, 0.0])
        tip = SkeletonJoint(f"{digit.name}_tip", parent, digit.tip, digit.name, tip=True)
        self.add(tip, placed[-1], offset)

    def bones(self, poses: Poses, root_failure: str) -> PosedRecording:
        """Join all bones that were added; each is let go of, as it is not needed twice."""
        axis = np.stack([axis for _, _, axis in self._placed])
        shape = (len(self._placed[0][0]), len(self.joints))
        position, turn = np.empty((*shape, 3)), np.empty((*shape, 4))
        for index in reversed(range(len(self.joints))):
            position[:, index], turn[:, index], _ = self._placed.pop()
        offset = np.stack(self._offsets)
        joints = tuple(self.joints)
        return PosedRecording(joints, position, turn, poses, offset, axis, self.left_out, root_failure)


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def root_names(layout: Layout) -> tuple[str, str]:
    """Joint and segment of the root: the wrist, or without one what the first digit hangs from."""
    if layout.wrist is not None:
        return layout.wrist.joint, layout.wrist.segment
    base = next(iter(layout.digits.values())).base
    return base, base


def _bone_frames(skeleton: Skeleton) -> dict[tuple[str, str], Array]:
    """Rotation (4,) from each bone's frame to that of the receiver that drives it, by digit and bone."""
    dorsal = np.array([skeleton.layout.segments[segment].dorsal for _, segment in skeleton.bones])
    along_mm = np.array([vector_of(row, "", "_mm") for row in skeleton.bones.values()])
    frames = bone_frame(along_mm.reshape(-1, 3), dorsal.reshape(-1, 3))
    return dict(zip(skeleton.bones, from_matrix(frames), strict=True))


def _receiver_digit(
    skeleton: Skeleton,
    digit: Digit,
    poses: Poses,
    metacarpal: Array,
    frames: Mapping[tuple[str, str], Array],
) -> list[_Placed]:
    """Joints and tip of one digit. metacarpal : (T, 4), of a digit that has one. frames : `_bone_frames`."""
    *points, end = digit_points(digit, skeleton.layout, skeleton.model, skeleton.joints)
    placed: list[_Placed] = []
    for index, (name, segment, point) in enumerate(zip(digit.joints, digit.segments, points, strict=True)):
        position = point.position_mm(poses)
        if index == 0 and digit.metacarpal:
            placed.append((position, metacarpal, NO_AXIS))
            continue
        row, align = skeleton.bones[digit.name, segment], frames[digit.name, segment]
        joint, axis = skeleton.joints.get(name), NO_AXIS
        if joint is not None and joint["dof"] == 1 and joint["axis_child_x"] is not None:  # a hinge's
            axis = rotate(conjugate(align), vector_of(joint, "axis_child_"))
        placed.append((position, _frame_rotations(poses, row["driven_by"], align), axis))
    return [*placed, (end.position_mm(poses), placed[-1][1], NO_AXIS)]


def _frame_rotations(poses: Poses, segment: str, align: Array) -> Array:
    """Rotations (T, 4) of a frame that a receiver carries, NaN where it is not valid."""
    index = poses.index(segment)
    turn = multiply(poses.quaternion[:, index], align)
    return np.where(poses.valid[:, index, None], turn, np.nan)


def _axis_turned_about(bones: PosedRecording, index: int) -> Array:
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
