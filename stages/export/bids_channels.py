"""The columns of a motion.tsv for an export: a hand's receivers, or its skeleton and joint angles.

Positions in metres, orientations as quaternions, joint angles in degrees, as BIDS has them. Receivers keep
every digit that their table has; of joints, which are computed, nanometres and nine decimals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from kinematics.rotations import Array
from stages.capture.bids.decimals import text_of
from stages.capture.bids.recording import FRAME_OF_REFERENCE, Column, channels_json
from stages.export.motion import SkeletonMotion
from stages.export.note import BONE_FRAME
from stages.export.tidy_csv import bone_angles_deg

ANGLES = ("flexion", "abduction", "rotation")
PARENT_BONE = "parent_bone"
"""Reference frame of joint angles."""

_MM_TO_M = -3
_XYZ = ("x", "y", "z")
_WXYZ = ("quat_w", "quat_x", "quat_y", "quat_z")


@dataclass(frozen=True)
class System:
    """A tracking system of BIDS: what one motion.tsv holds.

    columns : in order. points : names of what is tracked. bones : whether they are joints, else receivers.
    """

    columns: tuple[Column, ...]
    points: tuple[str, ...]
    bones: bool

    @property
    def timed(self) -> bool:
        """Whether there is a channel `time`, of the device."""
        return any(column.name == "time" for column in self.columns)


def receiver_system(motion: SkeletonMotion, start_s: float) -> System:
    """Every receiver's pose, tracked points being the segments that they ride on; n/a where not valid.

    start_s : the recording's first time, from which LATENCY counts; NaN where it has none.
    """
    there = motion.receivers
    columns = list(_frame_and_time(motion, start_s))
    position = _texts(there.position_mm, _MM_TO_M)
    turn = _texts(there.quaternion)
    for index, segment in enumerate(there.segments):
        for name, text in zip(_XYZ, position[index], strict=True):
            what = f"position of the receiver, {name}"
            columns.append(Column(text, f"{segment}_pos_{name}", name, "POS", segment, "m", what))
        for name, text in zip(_WXYZ, turn[index], strict=True):
            what = f"receiver to transmitter frame, {name}"
            columns.append(Column(text, f"{segment}_{name}", name, "ORNT", segment, "n/a", what))
    return System(tuple(columns), there.segments, bones=False)


def skeleton_system(motion: SkeletonMotion, start_s: float) -> System:
    """Every joint's position, the rotation of the bone that starts there, and the angles of known anatomy.

    start_s : as of `receiver_system`.
    """
    columns = list(_frame_and_time(motion, start_s))
    position = _texts((motion.position_mm / 1000).round(9))
    turn = _texts(motion.quaternion.round(9))
    for index, joint in enumerate(motion.joints):
        for name, text in zip(_XYZ, position[index], strict=True):
            what = f"position of the {'tip' if joint.tip else 'joint'}, {name}"
            columns.append(Column(text, f"{joint.name}_pos_{name}", name, "POS", joint.name, "m", what))
        for name, text in zip(_WXYZ, turn[index], strict=True):
            if not joint.tip:
                what = f"bone to transmitter frame, {name}"
                columns.append(Column(text, f"{joint.name}_{name}", name, "ORNT", joint.name, "n/a", what))
    names, angles = bone_angles_deg(motion)
    degrees = _texts(angles.round(6))
    for index, joint_name in enumerate(names):
        for name, text in zip(ANGLES, degrees[index], strict=True):
            what = f"{name} of the joint, signed as reference_frame says"
            columns.append(Column(text, f"{joint_name}_{name}", "n/a", "JNTANG", joint_name, "deg", what))
    return System(tuple(columns), motion.names, bones=True)


def rows(system: System, rate_hz: str) -> list[list[str]]:
    """Header and rows of channels.tsv; rate_hz as text."""
    found = []
    for column in system.columns:
        row = column.row | {"sampling_frequency": rate_hz}
        if column.type == "JNTANG":
            row["reference_frame"] = PARENT_BONE
        found.append(row)
    return [list(found[0]), *(list(row.values()) for row in found)]


def reference_frames(system: System) -> dict[str, Any]:
    """The content of channels.json."""
    made = channels_json()
    levels = made["reference_frame"]["Levels"]
    if system.bones:
        levels[FRAME_OF_REFERENCE]["Description"] = (
            "The transmitter's own frame, right-handed. Orientations are unit quaternions that take "
            f"coordinates of the bone to this frame. A bone's own frame: {BONE_FRAME}. How the transmitter "
            "lies in the room or to the subject is not recorded."
        )
    if any(column.type == "JNTANG" for column in system.columns):
        levels[PARENT_BONE] = {
            "SpatialAxes": "n/a",
            "RotationRule": "n/a",
            "RotationOrder": "n/a",
            "Description": "Angles of a bone against the bone before it by the joint coordinate system (Wu "
            "et al. 2005, J Biomech 38:981): flexion about the lateral axis of the bone before, abduction "
            "about the floating axis, rotation about the bone's own long axis. Flexion, ulnar deviation and "
            "pronation are positive, in right and left hands. Zero is the straight digit.",
        }
    return made


def _texts(values: Array, shift: int = 0) -> list[list[pa.Array]]:
    """Columns of (T, K, n) as text, K lists of n: numbers times 10**shift, null where NaN."""
    frames, points, parts = values.shape
    flat = text_of(np.ascontiguousarray(np.moveaxis(values, 0, -1)).ravel() + 0.0, shift)
    return [
        [flat.slice((point * parts + part) * frames, frames) for part in range(parts)]
        for point in range(points)
    ]


def _frame_and_time(motion: SkeletonMotion, start_s: float) -> Iterator[Column]:
    """Frame number, LATENCY to a microsecond as BIDS wants it, and the device's own time in all digits."""
    number = pa.array(motion.frame).cast(pa.string())
    yield Column(number, "frame", "n/a", "MISC", "n/a", "n/a", "frame number of the tracker")
    if not np.isfinite(start_s):
        return
    since = [f"{value:.6f}" if np.isfinite(value) else None for value in motion.time_s - start_s]
    told = "time since the first sample"
    yield Column(pa.array(since, pa.string()), "latency", "n/a", "LATENCY", "n/a", "s", told)
    yield Column(text_of(motion.time_s), "time", "n/a", "MISC", "n/a", "s", "time of the tracker")


def counts(columns: Sequence[Column]) -> dict[str, int]:
    """Channels in all and of each type, as motion.json counts them."""
    kinds = ("ACCEL", "ANGACCEL", "GYRO", "JNTANG", "LATENCY", "MAGN", "MISC", "ORNT", "POS", "VEL")
    types = [column.type for column in columns]
    return {"MotionChannelCount": len(types)} | {f"{kind}ChannelCount": types.count(kind) for kind in kinds}
