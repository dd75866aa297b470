"""A recording's skeleton and motion from a study's tables, whatever the skeleton model.

A fitted hand moves as its bones were posed with all receivers (bone_poses, posed_tips). Of every other
skeleton each bone rides on the receiver that drives it, turned against it by the constant rotation that lays
the frame along the bone; its joint is where the child half of the centre is, that of a digit's base at the
parent half or the wrist, and the digit ends at its distal receiver. Metacarpals turn as the metacarpals
table says.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from kinematics.rotations import Array, conjugate, from_matrix, multiply, rotate
from kinematics.skeleton import DigitChain, Rows, digit_chain, ride
from schemas.catalogue import BONE_LENGTHS, BONE_POSES, JOINT_CENTRES, METACARPALS, POSED_TIPS
from schemas.errors import InputError
from schemas.files import file_sha256
from schemas.layout import Digit, Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses, pose_blocks
from schemas.results import Results
from schemas.study import Recording
from schemas.tables import Table, column_array, open_table, read_table, rows_of
from stages.capture.spool import Spool
from stages.estimate_metacarpals.posture import bone_frame
from stages.export.anatomy import mean_rotation, neutral_rotations, relative_rotations, to_nail_side
from stages.export.frames import BLOCK_FRAMES, Growing, release, slices
from stages.export.motion import (
    BONE_TO_WEBXR,
    Joint,
    Origin,
    Receivers,
    Signs,
    SkeletonMotion,
    nominal_rate_hz,
)

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
_XYZ = ("x_mm", "y_mm", "z_mm")
_TIP = ("tip_x_mm", "tip_y_mm", "tip_z_mm")
_Q = ("qw", "qx", "qy", "qz")
_MOVED_DEG = 1.0
_BATCH_ROWS = 1 << 15
_READ_BYTES = 1 << 20
"""How much of a table's column is read ahead; without a limit pyarrow reads the whole file."""


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
    posed: tuple[_Posed, ...]


class _Posed:
    """Rows of one recording in a table of the hand, key by key (segment or digit), followed frame by frame.

    keys : what there are rows of.
    """

    def __init__(
        self,
        paths: Results,
        recording: Recording,
        model: SkeletonModel,
        table: Table,
        key: str,
        columns: Sequence[str],
    ) -> None:
        self._path = paths.hand_table(model.name, recording.hand, table.name)
        self._columns = columns
        self._spool = Spool(Path(tempfile.gettempdir()))
        open_table(self._path, table).close()
        with pq.ParquetFile(self._path, buffer_size=_READ_BYTES, pre_buffer=False) as file:
            for batch in file.iter_batches(_BATCH_ROWS, columns=["task", "trial", key, "frame", *columns]):
                self._add(batch, key, recording)
        self.keys = set(self._spool.keys())
        self._cursors = {name: _Cursor(self._spool.take(name)) for name in self.keys}

    def _add(self, batch: pa.RecordBatch, key: str, recording: Recording) -> None:
        ours = pc.and_(pc.equal(batch["task"], recording.task), pc.equal(batch["trial"], recording.trial))
        rows = pa.Table.from_batches([batch]).filter(ours)
        if not rows.num_rows:
            return
        names = rows[key].combine_chunks().dictionary_encode()
        codes = names.indices.to_numpy()
        frame = column_array(rows, "frame")
        values = np.stack([column_array(rows, name).astype(float) for name in self._columns], -1)
        for code, name in enumerate(names.dictionary.to_pylist()):
            mine = codes == code
            self._spool.add(name, (frame[mine], values[mine]))

    def refuse_none(self, recording: Recording) -> None:
        """Raise InputError where there is no row."""
        if not self.keys:
            raise InputError(
                f"{self._path}: has no row of {recording.name}; only recordings of role evaluation or both "
                "are posed, so give it one of these roles in the recordings sheet and run the study again"
            )

    def at(self, name: str, frames: npt.NDArray[np.int64]) -> Array:
        """Columns (n, columns) in the next frames, NaN where the table has no row."""
        out = np.full((len(frames), len(self._columns)), np.nan)
        if name in self._cursors and len(frames):
            there, values = self._cursors[name].up_to(int(frames[-1]))
            _, here, of = np.intersect1d(frames, there, return_indices=True)
            out[here] = values[of]
        return out


class _Cursor:
    """Chunks of frames that ascend and their values, of which those up to a frame are taken in turn."""

    def __init__(self, chunks: Iterator[tuple[npt.NDArray[Any], ...]]) -> None:
        self._chunks = chunks
        self._held: tuple[npt.NDArray[Any], ...] | None = None

    def up_to(self, last: int) -> tuple[npt.NDArray[Any], ...]:
        """The frames not above `last` that were not taken yet, and their values."""
        held = [] if self._held is None else [self._held]
        while not held or not len(held[-1][0]) or held[-1][0][-1] <= last:
            chunk = next(self._chunks, None)
            if chunk is None:
                break
            held.append(chunk)
        frame, values = (np.concatenate(parts) for parts in zip(*held, strict=True))
        cut = int(np.searchsorted(frame, last, "right"))
        self._held = frame[cut:], values[cut:]
        return frame[:cut], values[:cut]


def read_motion(
    paths: Results, recording: Recording, layout: Layout, model: SkeletonModel, licence: str = ""
) -> SkeletonMotion:
    """Read one hand's skeleton under one model and its motion in one recording.

    licence : words to go into every file. Digits whose joints failed, or that have no pose in any frame, are
    left out, and a note says so. Raises InputError where a table is absent or its making failed, where no
    digit is left, or where the layout's digits do not hang together.
    """
    hand = recording.hand

    def rows(table: Table) -> list[dict[str, Any]]:
        return list(rows_of(read_table(paths.hand_table(model.name, hand, table.name), table)))

    def posed(table: Table, key: str, columns: Sequence[str]) -> _Posed:
        return _Posed(paths, recording, model, table, key, columns)

    fitted = model.fitting is not None
    blocks = pose_blocks(paths.poses(recording), layout.measured, BLOCK_FRAMES)
    source = _Source(
        paths,
        recording,
        layout,
        model,
        next(blocks),
        {row["joint"]: row for row in rows(JOINT_CENTRES)},
        {row["bone"]: row for row in rows(BONE_LENGTHS)},
        _tables(fitted, layout, posed),
    )
    if len(source.poses.frame):
        for table in source.posed:
            table.refuse_none(recording)
    track = _Track()
    bones: list[_Bone] = []
    notes: list[str] = []
    for poses in itertools.chain([source.poses], blocks):
        block = replace(source, poses=poses)
        bones, notes = _fitted(block) if fitted else _ridden(block)
        track.append(poses, bones)
    bones = track.bones(bones)
    if fitted:
        bones = [_with_fitted_axis(bone, bones) for bone in bones]
    bones, unseen = _seen_digits(bones)
    notes += unseen
    if len(bones) < 2:
        raise InputError(
            f"{paths.skeleton(model.name, hand)}: no digit of {recording.name} can be exported: "
            f"{'; '.join(notes) or 'the layout has none'}"
        )
    return _motion(source, track, bones, _origin(source, licence), tuple(notes))


def _tables(
    fitted: bool, layout: Layout, posed: Callable[[Table, str, Sequence[str]], _Posed]
) -> tuple[_Posed, ...]:
    """Tables that have a row a frame: of a fitted hand bones and tips, else metacarpals if there are any."""
    if fitted:
        return posed(BONE_POSES, "segment", (*_XYZ, *_Q)), posed(POSED_TIPS, "digit", _TIP)
    if any(digit.metacarpal for digit in layout.digits.values()):
        return (posed(METACARPALS, "digit", _Q),)
    return ()


class _Track:
    """What is read block by block: the frames, the receivers, and of every bone where it is."""

    def __init__(self) -> None:
        self._grown = {
            name: Growing() for name in ("position", "turn", "receiver_mm", "receiver_turn", "valid")
        }
        self._frame: list[npt.NDArray[np.int64]] = []
        self._time_s: list[Array] = []
        self._signs = Signs()
        self.segments: tuple[str, ...] = ()

    def append(self, poses: Poses, bones: Sequence[_Bone]) -> None:
        """The next frames."""
        valid = poses.valid[..., None]
        self._grown["position"].append(np.stack([bone.position_mm for bone in bones], 1))
        self._grown["turn"].append(np.stack([bone.quaternion for bone in bones], 1))
        self._grown["receiver_mm"].append(np.where(valid, poses.position_mm, np.nan))
        turn = np.where(valid, poses.quaternion, np.nan)
        self._grown["receiver_turn"].append(self._signs.continuous(turn))
        self._grown["valid"].append(poses.valid)
        self._frame.append(poses.frame)
        self._time_s.append(poses.time_s)
        self.segments = poses.segments

    @property
    def frame(self) -> npt.NDArray[np.int64]:
        """Frame numbers (T,)."""
        return np.concatenate(self._frame)

    @property
    def time_s(self) -> Array:
        """Times (T,)."""
        return np.concatenate(self._time_s)

    def bones(self, last: Sequence[_Bone]) -> list[_Bone]:
        """The bones of the block before over all frames."""
        position, turn = self._grown["position"].finished(), self._grown["turn"].finished()
        return [
            replace(bone, position_mm=position[:, index], quaternion=turn[:, index])
            for index, bone in enumerate(last)
        ]

    def receivers(self) -> Receivers:
        """The receivers over all frames."""
        names = ("receiver_mm", "receiver_turn", "valid")
        position, turn, valid = (self._grown[name].finished() for name in names)
        return Receivers(self.segments, position, turn, valid)


def _ridden(source: _Source) -> tuple[list[_Bone], list[str]]:
    """The bones of a skeleton whose joints were solved one by one, and why digits are missing."""
    layout = source.layout
    bones, notes = [_ridden_root(source)], []
    for digit in layout.digits.values():
        chain = digit_chain(digit, layout, source.model, source.joints)
        if isinstance(chain, str):
            notes.append(f"{digit.name} left out: {chain}")
            continue
        turn = source.posed[0].at(digit.name, source.poses.frame) if source.posed else None
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
    table, tips = source.posed
    posed = table.keys

    def pose(segment: str) -> tuple[Array, Array]:
        both = table.at(segment, poses.frame)
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
        end = tips.at(digit.name, poses.frame)
        parent, first, offset = _parent(bones, digit), len(bones), None
        for index, (name, segment) in enumerate(zip(digit.joints, digit.segments, strict=True)):
            above = first + index - 1 if index else parent
            joint = Joint(name, above, segment, digit.name, dof=_dof(source, name))
            bones.append(_Bone(joint, *pose(segment), offset))
            offset = np.array([_length(source, source.lengths[segment], "bone_mm"), 0.0, 0.0])
        tip = Joint(f"{digit.name}_tip", len(bones) - 1, digit.tip, digit.name, tip=True)
        bones.append(_Bone(tip, end, bones[-1].quaternion, offset))
    return bones, notes


def _with_fitted_axis(bone: _Bone, bones: Sequence[_Bone]) -> _Bone:
    """The bone with the axis that a joint of one degree of freedom turns about, as the posed bones show it.

    The fit turns such a joint about one constant axis, which the bones' own rotations hold without the
    receivers' skin. NaN where it hardly moves.
    """
    if bone.joint.dof != 1:
        return bone
    above = bones[bone.joint.parent]
    if next(relative_rotations(above.quaternion, bone.quaternion), None) is None:
        return bone
    mean = mean_rotation(above.quaternion, bone.quaternion)

    def vectors() -> Iterator[Array]:
        for relative in relative_rotations(above.quaternion, bone.quaternion):
            change = multiply(conjugate(mean), relative)
            yield change[:, 1:] * np.where(change[:, :1] < 0, -1.0, 1.0)

    _, directions = np.linalg.eigh(sum(vector.T @ vector for vector in vectors()))
    axis = directions[:, -1]
    angles = [np.arcsin(np.clip(vector @ axis, -1, 1)) for vector in vectors()]
    range_rad = 2 * (max(angle.max() for angle in angles) - min(angle.min() for angle in angles))
    if range_rad < np.radians(_MOVED_DEG):
        return bone
    return replace(bone, axis=axis * np.sign(axis[np.argmax(np.abs(axis))]))


def _seen_digits(bones: Sequence[_Bone]) -> tuple[list[_Bone], list[str]]:
    """The bones without the digits of which a joint has no pose in any frame, and notes on these.

    What hangs from such a digit goes with it.
    """
    blind: dict[str, str] = {}
    for bone in bones[1:]:
        lost = bones[bone.joint.parent].joint.digit in blind
        if len(bone.position_mm) and (lost or not _ever_known(bone)):
            blind.setdefault(bone.joint.digit, bone.joint.name)
    kept = [index for index, bone in enumerate(bones) if bone.joint.digit not in blind]
    place = {-1: -1} | {old: new for new, old in enumerate(kept)}
    left = [
        replace(bones[index], joint=replace(bones[index].joint, parent=place[bones[index].joint.parent]))
        for index in kept
    ]
    return left, [f"{digit} left out: {joint} has no pose in any frame" for digit, joint in blind.items()]


def _ever_known(bone: _Bone) -> bool:
    for rows in slices(len(bone.position_mm)):
        position, turn = bone.position_mm[rows], bone.quaternion[rows]
        if (np.isfinite(position).all(-1) & np.isfinite(turn).all(-1)).any():
            return True
        release(position, turn)
    return False


def _motion(
    source: _Source, track: _Track, bones: Sequence[_Bone], origin: Origin, notes: tuple[str, ...]
) -> SkeletonMotion:
    frame, time_s = track.frame, track.time_s
    joints = tuple(bone.joint for bone in bones)
    to_nail = to_nail_side(source.layout, origin.hand, joints, [bone.quaternion for bone in bones])
    axis = np.stack([bone.axis for bone in bones])
    position, raw, turn, signs = Growing(), Growing(), Growing(), Signs()
    for rows in slices(len(frame)) if len(frame) else [slice(0)]:
        position.append(np.stack([bone.position_mm[rows] for bone in bones], 1))
        part = np.stack([bone.quaternion[rows] for bone in bones], 1)
        for index, back in to_nail.items():
            part[:, index] = multiply(part[:, index], back)
        raw.append(part)
        turn.append(signs.continuous(multiply(part, BONE_TO_WEBXR)))
        release(bones[0].position_mm, bones[0].quaternion)  # all of them are parts of these
    for index, back in to_nail.items():
        axis[index] = rotate(conjugate(back), axis[index])
    position_mm = position.finished()
    offset, rest = _rest(bones, position_mm, raw.finished())
    back = conjugate(BONE_TO_WEBXR)
    return SkeletonMotion(
        joints,
        rotate(back, offset),
        multiply(back, multiply(rest, BONE_TO_WEBXR)),
        multiply(back, multiply(neutral_rotations(source.layout, origin.hand, joints), BONE_TO_WEBXR)),
        rotate(back, axis),
        frame,
        time_s,
        nominal_rate_hz(frame, time_s),
        position_mm,
        turn.finished(),
        track.receivers(),
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
        offset[index] = _mean_offset_mm(position, turn, above, index)
        rest[index] = mean_rotation(turn[:, above], turn[:, index])
    return offset, rest


def _mean_offset_mm(position: Array, turn: Array, above: int, index: int) -> Array:
    """Where a joint is on average in the frame of the bone above (3,); zeros where it is never known."""
    total, count = np.zeros((0, 3)), 0
    for rows in slices(len(position)):
        back = conjugate(turn[rows, above])
        seen = rotate(back, position[rows, index] - position[rows, above])
        seen = seen[np.isfinite(seen).all(-1)]
        # one after the other, as one sum over all frames adds them
        total = np.add.reduce(np.concatenate([total, seen]), axis=0, keepdims=True) if len(seen) else total
        count += len(seen)
        release(position, turn)
    return total[0] / count if count else np.zeros(3)


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
