"""Joint angles and fingertips of a recording under a model, joint by joint, read block by block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from shukotsu.arrays import Array, Index
from shukotsu.errors import join_reasons
from shukotsu.hand.neutral_bones import bone_angles_deg, to_nail_side
from shukotsu.hand.posed_recording import BLOCK_FRAMES, RecordingReader
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import conjugate, rotate
from shukotsu.study.layout import Digit
from shukotsu.tables.catalogue import JOINT_ANGLES, POSED_TIPS
from shukotsu.tables.poses import Poses

ANGLES = ("flexion", "abduction", "rotation")

ERRORS = ("sd_deg", "change_sd_deg", "session_sd_deg", "session_change_sd_deg")
"""Suffixes of error columns of joint_angles, which follow the angle's name."""

LONG_FRAMES = 1 << 18
"""Number of frames (18 minutes at 240 Hz) above which values are stored in single precision, whose rounding
is far below their noise."""

_TOGETHER = 1 << 19
"""Number of frames, times joints, that are read together: a row group has all joints and is read as a
whole."""

_FACING_FRAMES = 512
"""Number of evenly spaced frames from which it is determined which way a thumb's receiver faces."""


@dataclass(frozen=True)
class AngleSeries:
    """An angle of a joint over T frames, NaN in gaps.

    errors_deg : (T, E, 1) in the order of `ERRORS`, or None. status, message : reliability of the angle.
    """

    joint: str
    angle: str
    angle_deg: Array
    errors_deg: Array | None
    status: str
    message: str


@dataclass
class FingertipPath:
    """Path of a digit's end in the frame of the digit's base.

    Attributes
    ----------
    place_mm : array, shape (T, 3, 1)
        Position of the end.
    pointing : array, shape (T, 3, 1)
        Unit vector of the distal receiver's distal axis.
    sd_mm : array, shape (T, 1, 1)
        Error in 3-D; NaN if none is stated.
    skin : bool
        Whether it is the end of the skin rather than of the bone.
    message : str
        Why it is not believed, or empty.

    """

    place_mm: Array
    pointing: Array
    sd_mm: Array
    skin: bool
    message: str = ""


@dataclass
class RecordedMovement:
    """Result of one pass over a recording.

    Attributes
    ----------
    reader : RecordingReader
        Reader of the recording.
    frame, time_s : array, shape (T,)
        Frame numbers and times.
    fingertips : mapping of str to FingertipPath
        Fingertips by digit.
    left_out : mapping of str to str
        Joints that the model cannot pose, and why.
    bases : mapping of str to array, shape (T, 7, 1)
        Poses (mm, then quaternion), by segment, of the bases in whose frames fingertips are expressed.
    pathless : mapping of str to str
        Digits without a fingertip, and why.

    """

    reader: RecordingReader
    frame: Index
    time_s: Array
    fingertips: Mapping[str, FingertipPath]
    left_out: Mapping[str, str]
    bases: Mapping[str, Array] = field(default_factory=dict)
    _angles_deg: Mapping[str, Array] = field(default_factory=dict)
    pathless: Mapping[str, str] = field(default_factory=dict)

    def joints(self) -> Iterator[AngleSeries]:
        """Yield the angles of each joint, from the table of a fitted hand, otherwise from the bones."""
        digits = self.reader.layout.digits.values()
        pairs = [(digit, joint) for digit in digits for joint in digit.joints]
        at_once = max(1, _TOGETHER // max(1, len(self.frame)))
        columns_of = self._angles_deg
        for number, (digit, joint) in enumerate(pairs):
            if self.reader.is_fitted and number % at_once == 0:
                columns_of = self._of_table([name for _, name in pairs[number : number + at_once]])
            columns = columns_of.get(joint)
            if columns is None:
                continue
            status, each = _reliability(self.reader, digit, joint), columns.shape[1] // len(ANGLES)
            for index, angle in enumerate(ANGLES):
                angle_deg = running_on(columns[:, index * each].astype(np.float64))[:, 0]
                errors = columns[:, index * each + 1 : (index + 1) * each]
                yield AngleSeries(joint, angle, angle_deg, errors if each > 1 else None, *status)

    def _of_table(self, joints: Sequence[str]) -> dict[str, Array]:
        """Read columns (T, 3 (1 + E), 1), each angle with its errors, of the joints that are in the table."""
        names = [f"{angle}_{what}" for angle in ANGLES for what in ("deg", *ERRORS)]
        columns_of: dict[str, Array] = {}
        for start in range(0, len(self.frame), BLOCK_FRAMES):
            rows = slice(start, start + BLOCK_FRAMES)
            only = joints[0] if len(joints) == 1 else ""
            for joint, read in self.reader.numbers(JOINT_ANGLES, names, self.frame[rows], only).items():
                if joint in joints:
                    columns = columns_of.setdefault(joint, _columns(len(self.frame), len(names)))
                    columns[rows] = read[..., None]
        return columns_of


def _reliability(reader: RecordingReader, digit: Digit, joint: str) -> tuple[str, str]:
    """Return the status of a joint's centre, and what the centre and the model imply for its angles."""
    if reason := reader.unmeasured(joint):
        return "failed", reason
    row = reader.skeleton.joints.get(joint)
    status = "failed" if row is None else row["status"]
    reasons = ["the joint was not solved" if row is None else row["message"]]
    if status == "weak":
        reasons = ["its centre is not believed"]
    if moved := reader.unbelieved("joints", joint):
        status, reasons = "failed" if status == "failed" else "weak", [*reasons, moved]
    if not reader.is_fitted:
        reasons.append(
            "the model states no errors of its angles, which include the mounting of the receivers"
        )
        if joint in digit.joints[1:2] and _pose_of_metacarpal(reader, digit) == "rigid":
            reasons.append(f"{_FIXED}, so the MCP joint's angles include the CMC joint's motion")
    return status, join_reasons(reasons)


_FIXED = "the model keeps the metacarpal fixed in the hand"

_NO_ANGLES = {
    "rigid": (1, _FIXED),
    "rest": (
        2,
        "the model keeps the metacarpal's direction in the transmitter frame, so its joints' angles would "
        "include the hand's rotation",
    ),
}
"""By the pose that a model assumes for metacarpals without a receiver: the number of joints of such a digit,
from the base, whose angles are assumed instead of measured, and the reason."""


def _pose_of_metacarpal(reader: RecordingReader, digit: Digit) -> str:
    """Return how the model poses the digit's metacarpal; "" if there is none, or it is measured or fitted."""
    if reader.is_fitted or not digit.metacarpal or reader.layout.segments[digit.segments[0]].measured:
        return ""
    return reader.model.metacarpals.unmeasured


def assumed_angles(reader: RecordingReader) -> dict[str, str]:
    """Return the joints whose angles the model assumes instead of measuring them, and why."""
    assumed: dict[str, str] = {}
    for digit in reader.layout.digits.values():
        count_of_joints, reason = _NO_ANGLES.get(_pose_of_metacarpal(reader, digit), (0, ""))
        assumed |= dict.fromkeys(digit.joints[:count_of_joints], reason)
    return assumed


def unsolved_joints(reader: RecordingReader) -> Mapping[str, str]:
    """Return why each joint failed if no joint of any digit was solved; otherwise return nothing."""
    in_digits = {joint for digit in reader.layout.digits.values() for joint in digit.joints}
    rows = {joint: row for joint, row in reader.skeleton.joints.items() if joint in in_digits}
    solved = any(row["status"] != "failed" for row in rows.values())
    return {} if solved else {joint: row["message"] for joint, row in rows.items()}


def read_movement(reader: RecordingReader) -> RecordedMovement:
    """Read the movement of a recording in one pass; raise InputError if a table cannot be read."""
    layout, hand = reader.layout, reader.part.hand
    facing: dict[int, Array] | None = None
    count, start = reader.n_frames, 0
    every = max(1, count // _FACING_FRAMES)
    frame, time_s = np.empty(count, np.int64), np.empty(count)
    angles: dict[str, Array] = {}
    tips: dict[str, Array] = {}
    bases: dict[str, Array] = {}
    left_out: Mapping[str, str] = {}
    for poses in reader.pose_blocks():
        rows = slice(start, start + len(poses.frame))
        frame[rows], time_s[rows], start = poses.frame, poses.time_s, rows.stop
        bones = reader.bones(poses)
        block_tips = _fingertips(reader, poses, bones)
        by_base = {layout.digits[name].base: layout.digits[name] for name in block_tips}
        block_bases = {
            base: np.concatenate(_base(reader, digit, poses, bones), -1) for base, digit in by_base.items()
        }
        blocks = [(tips, block_tips), (bases, block_bases)]
        if not reader.is_fitted:
            left_out = bones.left_out
            if facing is None:
                whole = count == len(poses.frame)
                some = bones.take(slice(None, None, every)) if whole else reader.bones(reader.poses(every))
                facing = to_nail_side(layout, hand, some.joints, some.quaternion)
            blocks.append((angles, bone_angles_deg(layout, hand, bones, facing)))
        for series, block in blocks:
            for name, values in block.items():
                if name not in series:
                    series[name] = _columns(count, values.shape[-1])
                series[name][rows] = values[..., None]
    paths = {}
    for name, columns in tips.items():  # the end of the skin if any frame has it, otherwise of the bone
        skin = any(np.isfinite(columns[:, column]).any() for column in range(8, columns.shape[1]))
        sd, first = (7, 8) if skin else (3, 4)
        place_mm, pointing, sd_mm = columns[:, first : first + 3], columns[:, :3], columns[:, sd : sd + 1]
        why = reader.unmeasured(layout.digits[name].joints[-1]) or reader.unbelieved("digits", name)
        paths[name] = FingertipPath(place_mm, pointing, sd_mm, skin, why)
    unposed = {
        joint: reader.unmeasured(joint) or left_out[name]
        for name in left_out
        for joint in layout.digits[name].joints
    }
    assumed = assumed_angles(reader).items()
    unposed |= {joint: reason for joint, reason in assumed if angles.pop(joint, None) is not None}
    pathless = {
        name: reader.unmeasured(digit.joints[-1]) or left_out.get(name, "")
        for name, digit in layout.digits.items()
        if name not in paths
    }
    return RecordedMovement(reader, frame, time_s, paths, unposed, bases, angles, pathless)


def _fingertips(reader: RecordingReader, poses: Poses, bones: PosedRecording) -> dict[str, Array]:
    """Return pointing direction, then sd_mm and position of each end in a block, (T, 7 or 11), by digit."""
    sd_mm: Mapping[str, Array] = {}
    if reader.is_fitted:
        sd_mm = reader.numbers(POSED_TIPS, ["tip_sd_mm", "skin_tip_sd_mm"], poses.frame)
    unknown = np.full((len(poses.frame), 2), np.nan)
    columns_of = {}
    for name, digit in reader.layout.digits.items():
        if f"{name}_tip" not in bones.names or (reader.is_fitted and name not in sd_mm):
            continue
        base_mm, turn = _base(reader, digit, poses, bones)
        back = conjugate(turn)
        distal = np.array(reader.layout.segments[digit.tip].distal, float)
        columns = [rotate(back, rotate(poses.rotation(digit.tip), distal))]
        ends = [end for end in (f"{name}_tip", f"{name}_skin_tip") if end in bones.names]
        for end, end_sd in zip(ends, sd_mm.get(name, unknown).T, strict=False):
            columns += [end_sd[:, None], rotate(back, bones.position_mm[:, bones.index(end)] - base_mm)]
        columns_of[name] = np.concatenate(columns, -1)
    return columns_of


def _columns(count: int, width: int) -> Array:
    """Allocate columns (T, C, 1) of NaN, each contiguous in memory."""
    kind = np.float32 if count > LONG_FRAMES else np.float64
    return np.full((width, count), np.nan, kind).T[..., None]


def _base(reader: RecordingReader, digit: Digit, poses: Poses, bones: PosedRecording) -> tuple[Array, Array]:
    """Return the pose, (T, 3) and (T, 4), of a digit's base bone if fitted, otherwise of its receiver."""
    if reader.is_fitted:
        index = next(i for i, joint in enumerate(bones.joints) if joint.segment == digit.base)
        return bones.position_mm[:, index], bones.quaternion[:, index]
    return poses.position_mm[:, poses.index(digit.base)], poses.rotation(digit.base)


def running_on(angle_deg: Array) -> Array:
    """Wrap angles in the widest gap between their values instead of at 180 deg.

    Parameters
    ----------
    angle_deg : array, shape (T, K)
        K angles in (-180, 180]; NaN is kept.

    Returns
    -------
    array, shape (T, K)
        The same angles; those on the side of the gap with fewer values are changed by 360 deg.

    """
    out = angle_deg
    if not len(angle_deg):
        return out
    spread_deg = np.fmax.reduce(angle_deg, 0) - np.fmin.reduce(angle_deg, 0)
    for column in np.flatnonzero(spread_deg > 180.0):
        ascending = np.sort(angle_deg[~np.isnan(angle_deg[:, column]), column])
        arcs = np.diff(ascending, append=ascending[0] + 360.0)
        widest = int(np.argmax(arcs))
        if widest + 1 < len(ascending):
            below = 2 * (widest + 1) < len(ascending)  # change the smaller part, to keep the median
            turned = angle_deg[:, column] <= ascending[widest]
            out = out.copy() if out is angle_deg else out
            out[turned if below else ~turned, column] += 360.0 if below else -360.0
    return out
