"""A recording's skeleton and motion from a study's tables, whatever the skeleton model.

A fitted hand moves as its bones were posed with all receivers (bone_poses, posed_tips). Of every other
skeleton each bone rides on the receiver that drives it, turned against it by the constant rotation that lays
the frame along the bone; its joint is where the child half of the centre is, that of a digit's base at the
parent half or the wrist, and the digit ends at its distal receiver. Metacarpals turn as the metacarpals
table says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from kinematics.rotations import Array, conjugate, from_matrix, multiply, rotate
from kinematics.skeleton import DigitChain, Rows, digit_chain, ride
from schemas.catalogue import BONE_LENGTHS, BONE_POSES, JOINT_CENTRES, METACARPALS, POSED_TIPS
from schemas.errors import InputError
from schemas.files import file_sha256
from schemas.layout import Digit, Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses, read_poses
from schemas.results import Results
from schemas.study import Recording
from schemas.tables import Table, column_array, read_table, rows_of
from stages.estimate_metacarpals.posture import bone_frame
from stages.export.anatomy import facing_nail, neutral_rotations
from stages.export.motion import (
    BONE_TO_WEBXR,
    Joint,
    Origin,
    Receivers,
    SkeletonMotion,
    continuous,
    nominal_rate_hz,
)

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
_XYZ = ("x_mm", "y_mm", "z_mm")
_TIP = ("tip_x_mm", "tip_y_mm", "tip_z_mm")
_Q = ("qw", "qx", "qy", "qz")
_MOVED_DEG = 1.0


@dataclass(frozen=True)
class _Bone:
    """A joint with its motion, in the bone frames of our tables (x distal, z dorsal).

    offset_mm : (3,) at rest in its parent's bone frame, None where the motion is to tell: of a digit's first.
    axis : (3,) in its own bone frame.
    """

    joint: Joint
    position_mm: Array
    quaternion: Array
    offset_mm: Array | None = None
    axis: Array = field(default_factory=lambda: np.full(3, np.nan))


@dataclass(frozen=True)
class _Source:
    """Everything that one recording's motion is read from."""

    paths: Results
    recording: Recording
    layout: Layout
    model: SkeletonModel
    poses: Poses
    joints: Rows
    lengths: Mapping[str, Mapping[str, Any]]

    def ours(self, table: Table, columns: Sequence[str]) -> pa.Table:
        """The recording's rows of a table of the hand."""
        path = self.paths.hand_table(self.model.name, self.recording.hand, table.name)
        whole = read_table(path, table, ["task", "trial", *columns])
        task, trial = self.recording.task, self.recording.trial
        rows = whole.filter(pc.and_(pc.equal(whole["task"], task), pc.equal(whole["trial"], trial)))
        if len(self.poses.frame) and not rows.num_rows:
            raise InputError(
                f"{path}: has no row of {self.recording.name}; only recordings of role evaluation or both "
                "are posed, so give it one of these roles in the recordings sheet and run the study again"
            )
        return rows


def read_motion(
    paths: Results, recording: Recording, layout: Layout, model: SkeletonModel, licence: str = ""
) -> SkeletonMotion:
    """Read one hand's skeleton under one model and its motion in one recording.

    licence : words to go into every file. Digits whose joints failed, or that have no pose in any frame, are
    left out, and a note says so. Raises InputError where a table is absent or its making failed, where no
    digit is left, or where the layout's digits do not hang together.
    """
    hand = recording.hand
    poses = read_poses(paths.poses(recording), layout.measured)

    def rows(table: Table) -> list[dict[str, Any]]:
        return list(rows_of(read_table(paths.hand_table(model.name, hand, table.name), table)))

    source = _Source(
        paths,
        recording,
        layout,
        model,
        poses,
        {row["joint"]: row for row in rows(JOINT_CENTRES)},
        {row["bone"]: row for row in rows(BONE_LENGTHS)},
    )
    bones, notes = _fitted(source) if model.fitting is not None else _ridden(source)
    bones, unseen = _seen_digits(bones)
    notes += unseen
    if len(bones) < 2:
        raise InputError(
            f"{paths.skeleton(model.name, hand)}: no digit of {recording.name} can be exported: "
            f"{'; '.join(notes) or 'the layout has none'}"
        )
    return _motion(source, bones, _origin(source, licence), tuple(notes))


def _ridden(source: _Source) -> tuple[list[_Bone], list[str]]:
    """The bones of a skeleton whose joints were solved one by one, and why digits are missing."""
    layout = source.layout
    bones, notes = [_ridden_root(source)], []
    metacarpals = None
    if any(digit.metacarpal for digit in layout.digits.values()):
        metacarpals = source.ours(METACARPALS, ["digit", "frame", *_Q])
    for digit in layout.digits.values():
        chain = digit_chain(digit, layout, source.model, source.joints)
        if isinstance(chain, str):
            notes.append(f"{digit.name} left out: {chain}")
            continue
        turn = None if metacarpals is None else _placed(metacarpals, "digit", digit.name, _Q, source.poses)
        bones += _ridden_digit(source, chain, turn, _parent(bones, digit), len(bones))
    return bones, notes


def _ridden_root(source: _Source) -> _Bone:
    """The wrist on the hand's receiver, or where a layout has no wrist that receiver itself."""
    layout, poses = source.layout, source.poses
    segment, name, place = next(iter(layout.digits.values())).base, "", np.zeros(3)
    if layout.wrist is not None:
        segment, name = layout.wrist.segment, layout.wrist.joint
        row = source.joints.get(name)
        if row is None or row["status"] == "failed":
            raise InputError(
                f"{source.paths.skeleton(source.model.name, source.recording.hand)}: joint {name} failed "
                f"({'it was not solved' if row is None else row['message']}), and it is the skeleton's root"
            )
        place = np.array([row[f"child_{axis}_mm"] for axis in "xyz"], float)
    axes = layout.segments[segment]
    turn = from_matrix(bone_frame(np.array(axes.distal), np.array(axes.dorsal)))
    joint = Joint(name or segment, -1, segment)
    return _Bone(joint, _carried(poses, segment, place), _turned(poses, segment, turn))


def _parent(bones: Sequence[_Bone], digit: Digit) -> int:
    """Index of the joint whose bone the digit hangs from."""
    for index, bone in enumerate(bones):
        if bone.joint.segment == digit.base and not bone.joint.tip:
            return index
    raise InputError(
        f"digit {digit.name} hangs from {digit.base}, which is no bone of the skeleton; an export needs one "
        "tree, so give each part a layout of its own"
    )


def _ridden_digit(
    source: _Source, chain: DigitChain, metacarpal: Array | None, parent: int, first: int
) -> list[_Bone]:
    """Bones of one digit; parent : index of the joint it hangs from, first : index of its own first joint."""
    layout, poses, digit = source.layout, source.poses, chain.digit
    bones: list[_Bone] = []
    offset = None
    for index, (name, segment) in enumerate(zip(digit.joints, digit.segments, strict=True)):
        row = source.lengths[segment]
        if index == 0:
            place = _carried(poses, digit.base, chain.base_point_mm)
        else:
            own = chain.child_mm[index]
            assert own is not None, "only a metacarpal may lack a joint of its own"
            place = _carried(poses, segment, own)
        if index == 0 and digit.metacarpal:
            assert metacarpal is not None, "a layout with metacarpals has a table of them"
            turn, align = metacarpal, None
        else:
            vector = np.array([row[axis] for axis in _XYZ], float)
            align = from_matrix(bone_frame(vector, np.array(layout.segments[segment].dorsal)))
            turn = _turned(poses, row["driven_by"], align)
        joint = Joint(
            name, first + index - 1 if index else parent, segment, digit.name, dof=_dof(source, name)
        )
        bones.append(_Bone(joint, place, turn, offset, _ridden_axis(source, name, align)))
        offset = np.array([_length(source, row, "length_mm"), 0.0, 0.0])
    tip = Joint(f"{digit.name}_tip", first + len(bones) - 1, digit.tip, digit.name, tip=True)
    end = _carried(poses, digit.tip, np.zeros(3))
    return [*bones, _Bone(tip, end, bones[-1].quaternion, offset)]


def _ridden_axis(source: _Source, name: str, align: Array | None) -> Array:
    """A hinge's axis in its bone's frame, which is turned by `align` against its receiver; NaN if none."""
    row = source.joints.get(name)
    if align is None or row is None or row["dof"] != 1 or row["axis_child_x"] is None:
        return np.full(3, np.nan)
    return rotate(conjugate(align), np.array([row[f"axis_child_{axis}"] for axis in "xyz"], float))


def _fitted(source: _Source) -> tuple[list[_Bone], list[str]]:
    """The bones of a hand that was fitted as a whole, and why digits are missing."""
    layout, poses = source.layout, source.poses
    table = source.ours(BONE_POSES, ["segment", "frame", *_XYZ, *_Q])
    tips = source.ours(POSED_TIPS, ["digit", "frame", *_TIP])
    posed = set(pc.unique(table["segment"]).to_pylist())

    def pose(segment: str) -> tuple[Array, Array]:
        both = _placed(table, "segment", segment, (*_XYZ, *_Q), poses)
        return both[:, :3], both[:, 3:]

    wrist = layout.wrist
    root = wrist.segment if wrist else next(iter(layout.digits.values())).base
    bones = [_Bone(Joint(wrist.joint if wrist else root, -1, root), *pose(root))]
    notes = []
    for digit in layout.digits.values():
        missing = [segment for segment in digit.segments if segment not in posed]
        if missing and posed:
            notes.append(f"{digit.name} left out: the fit of the whole hand poses no {missing[0]}")
            continue
        end = _placed(tips, "digit", digit.name, _TIP, poses)
        parent, first, offset = _parent(bones, digit), len(bones), None
        for index, (name, segment) in enumerate(zip(digit.joints, digit.segments, strict=True)):
            above = first + index - 1 if index else parent
            joint = Joint(name, above, segment, digit.name, dof=_dof(source, name))
            bones.append(_Bone(joint, *pose(segment), offset))
            offset = np.array([_length(source, source.lengths[segment], "bone_mm"), 0.0, 0.0])
        tip = Joint(f"{digit.name}_tip", len(bones) - 1, digit.tip, digit.name, tip=True)
        bones.append(_Bone(tip, end, bones[-1].quaternion, offset))
    return [_with_fitted_axis(bone, bones) for bone in bones], notes


def _with_fitted_axis(bone: _Bone, bones: Sequence[_Bone]) -> _Bone:
    """The bone with the axis that a joint of one degree of freedom turns about, as the posed bones show it.

    The fit turns such a joint about one constant axis, which the bones' own rotations hold without the
    receivers' skin. NaN where it hardly moves.
    """
    if bone.joint.dof != 1:
        return bone
    above = bones[bone.joint.parent].quaternion
    relative = multiply(conjugate(above), bone.quaternion)
    relative = relative[np.isfinite(relative).all(-1)]
    if not len(relative):
        return bone
    change = multiply(conjugate(_mean_rotation(relative)), relative)
    vector = change[:, 1:] * np.where(change[:, :1] < 0, -1.0, 1.0)
    _, directions = np.linalg.eigh(vector.T @ vector)
    axis = directions[:, -1]
    range_rad = 2 * np.ptp(np.arcsin(np.clip(vector @ axis, -1, 1)))
    if range_rad < np.radians(_MOVED_DEG):
        return bone
    return replace(bone, axis=axis * np.sign(axis[np.argmax(np.abs(axis))]))


def _seen_digits(bones: Sequence[_Bone]) -> tuple[list[_Bone], list[str]]:
    """The bones without the digits of which a joint has no pose in any frame, and notes on these.

    What hangs from such a digit goes with it.
    """
    blind: dict[str, str] = {}
    for bone in bones[1:]:
        known = np.isfinite(bone.position_mm).all(-1) & np.isfinite(bone.quaternion).all(-1)
        lost = bones[bone.joint.parent].joint.digit in blind
        if known.size and (lost or not known.any()):
            blind.setdefault(bone.joint.digit, bone.joint.name)
    kept = [index for index, bone in enumerate(bones) if bone.joint.digit not in blind]
    place = {-1: -1} | {old: new for new, old in enumerate(kept)}
    left = [
        replace(bones[index], joint=replace(bones[index].joint, parent=place[bones[index].joint.parent]))
        for index in kept
    ]
    return left, [f"{digit} left out: {joint} has no pose in any frame" for digit, joint in blind.items()]


def _motion(
    source: _Source, bones: Sequence[_Bone], origin: Origin, notes: tuple[str, ...]
) -> SkeletonMotion:
    poses = source.poses
    joints = tuple(bone.joint for bone in bones)
    position = np.stack([bone.position_mm for bone in bones], 1)
    turn = np.stack([bone.quaternion for bone in bones], 1)
    axis = np.stack([bone.axis for bone in bones])
    turn, axis = facing_nail(source.layout, origin.hand, joints, turn, axis)
    offset, rest = _rest(bones, position, turn)
    back = conjugate(BONE_TO_WEBXR)
    valid = poses.valid[..., None]
    return SkeletonMotion(
        joints,
        rotate(back, offset),
        multiply(back, multiply(rest, BONE_TO_WEBXR)),
        multiply(back, multiply(neutral_rotations(source.layout, origin.hand, joints), BONE_TO_WEBXR)),
        rotate(back, axis),
        poses.frame,
        poses.time_s,
        nominal_rate_hz(poses.frame, poses.time_s),
        position,
        continuous(multiply(turn, BONE_TO_WEBXR)),
        Receivers(
            poses.segments,
            np.where(valid, poses.position_mm, np.nan),
            continuous(np.where(valid, poses.quaternion, np.nan)),
            poses.valid,
        ),
        origin,
        notes,
    )


def _rest(bones: Sequence[_Bone], position: Array, turn: Array) -> tuple[Array, Array]:
    """Rest offsets (J, 3) and rotations (J, 4) in our bone frames, from lengths and the mean over frames."""
    offset, rest = np.zeros((len(bones), 3)), np.tile(IDENTITY, (len(bones), 1))
    for index, bone in enumerate(bones[1:], 1):
        above = bone.joint.parent
        if bone.offset_mm is not None:
            offset[index] = bone.offset_mm
            continue
        back = conjugate(turn[:, above])
        seen = rotate(back, position[:, index] - position[:, above])
        seen = seen[np.isfinite(seen).all(-1)]
        offset[index] = seen.mean(0) if len(seen) else 0.0
        rest[index] = _mean_rotation(multiply(back, turn[:, index]))
    return offset, rest


def _mean_rotation(quaternion: Array) -> Array:
    """The rotation (4,) nearest to all of those (n, 4), signs and NaN aside; identity where there is none."""
    known = quaternion[np.isfinite(quaternion).all(-1)]
    if not len(known):
        return IDENTITY.copy()
    mean = np.linalg.eigh(known.T @ known)[1][:, -1]
    return np.asarray(-mean if mean[0] < 0 else mean)


def _placed(table: pa.Table, key: str, value: str, columns: Sequence[str], poses: Poses) -> Array:
    """Columns (T, n) of one segment or digit at the frames of the poses, NaN where the table has no row."""
    rows = table.filter(pc.equal(table[key], value))
    out = np.full((len(poses.frame), len(columns)), np.nan)
    _, here, there = np.intersect1d(poses.frame, column_array(rows, "frame"), return_indices=True)
    out[here] = np.stack([column_array(rows, name).astype(float) for name in columns], -1)[there]
    return out


def _carried(poses: Poses, segment: str, point_mm: Array) -> Array:
    """Positions (T, 3) of a point of a receiver's frame, NaN where the receiver is not valid."""
    return np.where(poses.valid[:, poses.index(segment), None], ride(poses, segment, point_mm), np.nan)


def _turned(poses: Poses, segment: str, align: Array) -> Array:
    """Rotations (T, 4) of a frame that a receiver carries, NaN where it is not valid."""
    index = poses.index(segment)
    turn = multiply(poses.quaternion[:, index], align)
    return np.where(poses.valid[:, index, None], turn, np.nan)


def _length(source: _Source, row: Mapping[str, Any], column: str) -> float:
    """A bone's length; InputError where it has none."""
    length = row[column]
    if length is None or not length > 0:
        raise InputError(
            f"{source.paths.hand_table(source.model.name, source.recording.hand, 'bone_lengths')}: bone "
            f"{row['bone']} is {length} mm long; expected a length above 0, so look at its joints' status"
        )
    return float(length)


def _dof(source: _Source, name: str) -> int:
    row = source.joints.get(name)
    return 0 if row is None else int(row["dof"])


def _origin(source: _Source, licence: str) -> Origin:
    paths, recording, model = source.paths, source.recording, source.model
    names = ["joint_centres", "bone_lengths"]
    names += ["metacarpals"] if model.fitting is None else ["bone_poses", "posed_tips"]
    files = [paths.hand_table(model.name, recording.hand, name) for name in names]
    inputs = {
        file.relative_to(paths.folder).as_posix(): file_sha256(file)
        for file in [paths.poses(recording), *files]
        if file.is_file()
    }
    hand = recording.hand
    return Origin(
        hand.subject,
        hand.hand,
        recording.task,
        recording.trial,
        model.name,
        source.layout.name,
        inputs,
        licence,
    )
