"""Poses of a skeleton's bones in a recording, for any model.

Bone frames have x distal and z dorsal (docs/conventions.md). For a fitted hand, poses are those of the fit,
which uses all receivers together. For every other skeleton, each bone follows the receiver that drives it,
with a constant rotation between the receiver's frame and the bone's. Its joint is at the child half of the
centre (a digit's base at the parent half or the wrist), rotations of metacarpals are those of the metacarpals
table, and the digit ends at the origin of its distal receiver.
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
"""Range of a joint's rotation below which its axis cannot be determined."""


@dataclass(frozen=True)
class Skeleton:
    """Joints and bones of one hand under one model.

    joints : rows of joint_centres by joint. bones : rows of bone_lengths by digit and bone, as a bone that
    two digits share ends at a different joint in each.
    """

    layout: Layout
    model: SkeletonModel
    joints: Rows
    bones: Mapping[tuple[str, str], Mapping[str, Any]]


ZERO_COLUMNS = ("rest_flexion_deg", "rest_abduction_deg", "rest_rotation_deg", "axes_turn_deg")
"""Columns of joint_centres that define the zero and the axes of a fitted joint's angles."""


@dataclass(frozen=True)
class SkeletonJoint:
    """A joint and the bone that starts there, or an end of a digit.

    Attributes
    ----------
    name : str
        Name of the joint in the layout; `<digit>_tip` for the end of a digit's bones, `<digit>_skin_tip`,
        which follows it, for the end of its skin.
    parent : int
        Index of the previous joint; -1 for the root.
    segment : str
        The bone; for an end, the bone that ends there.
    digit : str
        Digit of the joint; empty for the root.
    tip : bool
        Whether it is an end of a digit.
    dof : int
        Degrees of freedom in the model; 0 if unknown.
    zero_deg : tuple of float
        Values of `ZERO_COLUMNS`; empty if the model has none.
    assumed : str
        Why the model assumes its angles instead of measuring them; empty if it does not, or before
        `export.exported_motion.read_motion` sets it.

    """

    name: str
    parent: int
    segment: str
    digit: str = ""
    tip: bool = False
    dof: int = 0
    zero_deg: tuple[float, ...] = ()
    assumed: str = ""


@dataclass(frozen=True)
class Origin:
    """Recording, model and input files of a motion.

    inputs : SHA-256 of the tables, by their path in the results folder. licence : licence stated by the user.
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
        Bones, each named after the joint at which it starts.
    position_mm : array, shape (T, B, 3)
        Positions of the joints in the transmitter frame; NaN if unknown.
    quaternion : array, shape (T, B, 4)
        Unit quaternions (w, x, y, z), bone to transmitter frame, x distal and z dorsal; NaN if unknown. A tip
        has the rotation of its bone.
    receivers : Poses
        The R receivers from which the bones were posed, over the same frames.
    rest_offset_mm : array, shape (B, 3)
        Offset of each joint in its parent's bone frame, from the bone's length. Zero for the root; all NaN
        for a digit's first joint and for the skin beyond its last bone, whose offsets only the motion shows;
        (NaN, 0, 0) if the bone before the joint has no length.
    axis : array, shape (B, 3)
        Unit axis, in its bone's frame, of a joint with one degree of freedom; NaN for other joints.
    left_out : mapping of str to str
        Digits without bones, and why.
    root_failure : str
        Why the root has no position; otherwise empty.
    rest, neutral : array, shape (B, 4)
        Rotation of each bone relative to its parent, averaged over time, and at zero joint angles
        (docs/movement.md; NaN without known anatomy). Empty until set by `hand.neutral_bones.at_rest`.
    origin : Origin
        Recording and model.
    rate_hz : float
        Frames per second; NaN if the times do not show it.
    notes : tuple of str
        Sentences on what is left out and how the motion was changed since it was read, in order.

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
        """Recorded numbers of the frames (T,); after resampling, of the frame nearest in time."""
        return self.receivers.frame

    @property
    def time_s(self) -> Array:
        """Device times (T,); NaN if the recording has none."""
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
        """Index of each joint's parent (B,); -1 for the root."""
        return np.array([joint.parent for joint in self.joints], np.int64)

    @cached_property
    def known(self) -> Bools:
        """Whether each joint has a complete pose in each frame, (T, B)."""
        return known_points(self.position_mm, self.quaternion)

    @property
    def whole(self) -> Bools:
        """Whether all joints have a pose in a frame, (T,)."""
        return np.asarray(self.known.all(1))

    def index(self, joint: str) -> int:
        """Return the index of a joint; raise InputError if the hand has no joint of that name."""
        if joint not in self.names:
            raise InputError(f"the hand has no joint {joint!r}; {guess(joint, self.names)}")
        return self.names.index(joint)

    def in_hand_mm(self) -> Array:
        """Return positions (T, B, 3) in the frame of the root: x distal, z dorsal."""
        moved = self.position_mm - self.position_mm[:, :1]
        return rotate(conjugate(self.quaternion[:, :1]), moved)

    def to_xarray(self) -> xarray.Dataset:
        """Convert the motion to an xarray data set, with dimensions named as in the package movement.

        Returns
        -------
        xarray.Dataset
            `position` (time, bone, space) in mm and `rotation` (time, bone, quaternion), bone to transmitter
            frame, NaN in gaps. A bone is named after the joint at which it starts; further coordinates are
            its `segment`, the name of its `parent`, and the `frame` number of each time. Time is in s if
            every frame has a device time, otherwise it is the frame number.

        Raises
        ------
        InputError
            If xarray is not installed.

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
        """Select some of the joints.

        Parameters
        ----------
        kept : sequence of int
            Their indices, ascending, including the parent of each.

        Returns
        -------
        PosedRecording
            The motion of these joints.

        """
        new_index = {-1: -1} | {old: new for new, old in enumerate(kept)}
        joints = [self.joints[index] for index in kept]
        return replace(
            self,
            joints=tuple(replace(joint, parent=new_index[joint.parent]) for joint in joints),
            position_mm=self.position_mm[:, kept],
            quaternion=self.quaternion[:, kept],
            rest_offset_mm=self.rest_offset_mm[kept],
            axis=self.axis[kept],
        )

    def mapped(
        self, move: Callable[[Array], Array], turn: Callable[[Array], Array], **times: Any
    ) -> PosedRecording:
        """Apply functions to positions and rotations of joints and receivers.

        Parameters
        ----------
        move : callable
            Positions (T, N, 3), mm, to positions (F, N, 3).
        turn : callable
            Rotations (T, N, 4) to rotations (F, N, 4).
        **times : array
            New frame, time_s (F,) and valid (F, R), if they change as well.

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
            The motion in these frames.

        """
        receivers = self.receivers.take(rows if isinstance(rows, slice) else np.arange(len(self.frame))[rows])
        kept = self.position_mm[rows], self.quaternion[rows]
        return replace(self, position_mm=kept[0], quaternion=kept[1], receivers=receivers)

    def noting(self, *sentences: str) -> PosedRecording:
        """Append notes."""
        return replace(self, notes=(*self.notes, *sentences))


def known_points(position_mm: Array, quaternion: Array) -> Bools:
    """Find the points that have a complete pose.

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
    """A joint centre or tip that a receiver carries.

    Attributes
    ----------
    name : str
        Joint whose row of joint_centres states the point (the wrist, for the base of a digit that starts
        there), or `<digit>_tip`.
    segment : str
        Segment of the receiver; empty if the point is unknown.
    point_mm : array, shape (3,)
        The point in the receiver's frame.

    """

    name: str
    segment: str
    point_mm: Array

    def position_mm(self, poses: Poses) -> Array:
        """Compute the positions of the point over time.

        Parameters
        ----------
        poses : Poses
            T frames.

        Returns
        -------
        array, shape (T, 3)
            Positions in the transmitter frame, mm; NaN if the receiver has no valid pose.

        """
        if not self.segment:
            return np.full((len(poses.frame), 3), np.nan)
        valid = poses.valid[:, poses.index(self.segment), None]
        return np.where(valid, carried_mm(poses, self.segment, self.point_mm), np.nan)


def receiver_bones(skeleton: Skeleton, poses: Poses, metacarpals: Mapping[str, Array]) -> PosedRecording:
    """Pose the bones of a hand as its receivers carry them.

    The tips table is made from these bones, even for models that fit the whole hand. Digits with a failed
    joint are left out.

    Parameters
    ----------
    skeleton : Skeleton
        Joints and bones of the hand.
    poses : Poses
        The receivers over T frames.
    metacarpals : mapping
        Digit -> quaternions (T, 4), bone to transmitter frame; missing digits are NaN.

    Returns
    -------
    PosedRecording
        The bones; NaN in frames in which their receiver has no pose.

    Raises
    ------
    InputError
        If the model names a CMC joint that no receiver measures.

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
    root = point.position_mm(poses), multiply(poses.rotation(segment), align), NO_AXIS
    build = _Builder(SkeletonJoint(name, -1, segment), root)
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
        # as in the replay: lengths of the bone vectors, or stated lengths of bones posed frame by frame
        lengths_mm = np.array([np.linalg.norm(vector_of(row, "", "_mm")) for row in rows])
        stated_mm = np.array([row["length_mm"] for row in rows], float)
        lengths_mm = np.where(np.isfinite(lengths_mm), lengths_mm, stated_mm)
        build.add_digit(skeleton, digit, _receiver_digit(skeleton, digit, poses, turn), lengths_mm)
    return build.bones(poses, root_failure)


def fitted_bones(
    skeleton: Skeleton, poses: Poses, bone_poses: Mapping[str, Array], ends_mm: Mapping[str, Array]
) -> PosedRecording:
    """Pose the bones of a hand that was fitted as a whole, using the poses of the fit.

    Parameters
    ----------
    skeleton : Skeleton
        Joints and bones of the hand.
    poses : Poses
        The receivers over T frames.
    bone_poses : mapping
        Segment -> poses (T, 7): position in mm, then quaternion, in the transmitter frame.
    ends_mm : mapping
        Digit -> end of its last bone and of the skin beyond (T, 6), or of the bone alone (T, 3), mm.

    Returns
    -------
    PosedRecording
        The bones; the axis of a hinge is estimated from their motion.

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
            build.left_out[digit.name] = f"the fit of the whole hand does not pose {missing[0]}"
            continue
        bones = [pose_of(bone) for bone in digit.segments]
        ends = ends_mm.get(digit.name, np.full((count, 3), np.nan))
        rows = [skeleton.bones.get((digit.name, bone), {}) for bone in digit.segments]
        lengths_mm = np.array([row.get("length_mm") for row in rows], float)
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
    """Compute joint positions with bones of constant length, each joint at its rest offset from its parent.

    Parameters
    ----------
    posed : PosedRecording
        The hand, over T frames and B bones.

    Returns
    -------
    array, shape (T, B, 3)
        Positions in the transmitter frame, mm. A joint without a parent, or with an offset that is all NaN (a
        digit's first), keeps its position. Tips computed from `receiver_bones` are those of the least-squares
        binding.

    """
    out = posed.position_mm.copy()
    for index, (joint, offset_mm) in enumerate(zip(posed.joints, posed.rest_offset_mm, strict=True)):
        if joint.parent >= 0 and not np.isnan(offset_mm).all():
            out[:, index] = out[:, joint.parent] + rotate(posed.quaternion[:, joint.parent], offset_mm)
    return out


def digit_points(
    digit: Digit, layout: Layout, model: SkeletonModel, joints: Rows
) -> tuple[ReceiverPoint, ...]:
    """Return a digit's joints and tip as points that receivers carry; `segment` is empty for failed joints.

    A base that is not the wrist is carried by its parent's receiver, every other joint by its child's.
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
    """Builder of a posed hand, root first; left_out : digits that are left out, and why."""

    def __init__(self, joint: SkeletonJoint, placed: _Placed) -> None:
        self.joints, self._placed, self._offsets = [joint], [placed], [np.zeros(3)]
        self.left_out: dict[str, str] = {}

    def add(self, joint: SkeletonJoint, placed: _Placed, offset_mm: Array) -> None:
        """Append a joint."""
        self.joints.append(joint)
        self._placed.append(placed)
        self._offsets.append(offset_mm)

    def add_digit(
        self, skeleton: Skeleton, digit: Digit, placed: Sequence[_Placed], lengths_mm: Array
    ) -> None:
        """Append a digit's joints and its tip; lengths_mm : lengths of its bones, NaN if unknown."""
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
        """Concatenate all bones; the builder's arrays are released one by one to limit memory."""
        axis = np.stack([axis for _, _, axis in self._placed])
        shape = (len(self._placed[0][0]), len(self.joints))
        position, turn = np.empty((*shape, 3)), np.empty((*shape, 4))
        for index in reversed(range(len(self.joints))):
            position[:, index], turn[:, index], _ = self._placed.pop()
        offset = np.stack(self._offsets)
        joints = tuple(self.joints)
        return PosedRecording(joints, position, turn, poses, offset, axis, self.left_out, root_failure)


def root_names(layout: Layout) -> tuple[str, str]:
    """Return joint and segment of the root: the wrist, or the base of the first digit if there is none."""
    if layout.wrist is not None:
        return layout.wrist.joint, layout.wrist.segment
    base = next(iter(layout.digits.values())).base
    return base, base


def _receiver_digit(skeleton: Skeleton, digit: Digit, poses: Poses, metacarpal: Array) -> list[_Placed]:
    """Pose the joints and tip of one digit; metacarpal : (T, 4) rotation of its metacarpal, if it has one."""
    *points, end = digit_points(digit, skeleton.layout, skeleton.model, skeleton.joints)
    placed: list[_Placed] = []
    for index, (name, segment, point) in enumerate(zip(digit.joints, digit.segments, points, strict=True)):
        position = point.position_mm(poses)
        if index == 0 and digit.metacarpal:
            placed.append((position, metacarpal, NO_AXIS))
            continue
        row, dorsal = skeleton.bones[digit.name, segment], skeleton.layout.segments[segment].dorsal
        align = from_matrix(bone_frame(vector_of(row, "", "_mm"), np.array(dorsal)))
        joint, axis = skeleton.joints.get(name), NO_AXIS
        if joint is not None and joint["dof"] == 1 and joint["axis_child_x"] is not None:
            axis = rotate(conjugate(align), vector_of(joint, "axis_child_"))
        placed.append((position, multiply(poses.rotation(row["driven_by"]), align), axis))
    return [*placed, (end.position_mm(poses), placed[-1][1], NO_AXIS)]


def _axis_turned_about(bones: PosedRecording, index: int) -> Array:
    """Return the axis (3,) about which a joint with one degree of freedom turns, from the posed bones.

    The fit turns such a joint about a single constant axis, which the rotations of the bones show without
    skin motion. NaN if the joint hardly moves.
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
