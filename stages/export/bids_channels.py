"""The columns of a motion.tsv for an export: a hand's receivers, or its skeleton and joint angles.

Positions in metres, orientations as quaternions, joint angles in degrees, as BIDS has them. Receivers keep
every digit that their table has; of joints, which are computed, nanometres and nine decimals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from schemas.bids.channels import FRAME_OF_REFERENCE, Column, channels_json, frame_column, time_columns
from schemas.bids.decimals import text_of
from skeleton.posing import SkeletonJoint
from skeleton.rotations import Array
from stages.export.file_facts import BONE_FRAME
from stages.export.motion import RECEIVER_TIP, SKIN_TIP, SkeletonMotion
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
    receivers = motion.receivers
    columns = [frame_column(motion.frame), *time_columns(motion.time_s, start_s)]
    position, turn = _texts(receivers.position_mm, _MM_TO_M), _texts(receivers.quaternion)
    for index, segment in enumerate(receivers.segments):
        columns += _place_columns(segment, "receiver", position[index])
        columns += _turn_columns(segment, "receiver", turn[index])
    return System(tuple(columns), receivers.segments, bones=False)


def skeleton_system(motion: SkeletonMotion, start_s: float) -> System:
    """Every joint's position, the rotation of the bone that starts there, and the angles of known anatomy.

    start_s : as of `receiver_system`.
    """
    columns = [frame_column(motion.frame), *time_columns(motion.time_s, start_s)]
    position = _texts((motion.position_mm / 1000).round(9))
    turn = _texts(motion.quaternion.round(9))
    for index, joint in enumerate(motion.joints):
        columns += _place_columns(joint.name, _kind(joint), position[index])
        if not joint.tip:
            columns += _turn_columns(joint.name, "bone", turn[index])
    names, angles = bone_angles_deg(motion)
    degrees = _texts(angles.round(6))
    for index, joint_name in enumerate(names):
        for name, text in zip(ANGLES, degrees[index], strict=True):
            what = f"{name} of the joint, signed as reference_frame says"
            columns.append(Column(text, f"{joint_name}_{name}", "n/a", "JNTANG", joint_name, "deg", what))
    return System(tuple(columns), motion.names, bones=True)


def _kind(joint: SkeletonJoint) -> str:
    """What a point of the skeleton is, in words."""
    if not joint.tip:
        return "joint"
    if joint.name.endswith(SKIN_TIP):
        return "end of the digit, skin and all"
    if joint.name.endswith(RECEIVER_TIP):
        return "distal receiver's origin, taken for the tip"
    return "end of the last bone"


def _place_columns(point: str, kind: str, texts: Sequence[pa.Array]) -> list[Column]:
    return [
        Column(text, f"{point}_pos_{name}", name, "POS", point, "m", f"position of the {kind}, {name}")
        for name, text in zip(_XYZ, texts, strict=True)
    ]


def _turn_columns(point: str, kind: str, texts: Sequence[pa.Array]) -> list[Column]:
    return [
        Column(text, f"{point}_{name}", name, "ORNT", point, "n/a", f"{kind} to transmitter frame, {name}")
        for name, text in zip(_WXYZ, texts, strict=True)
    ]


def rows(system: System, rate_hz: str) -> list[list[str]]:
    """Header and rows of channels.tsv; rate_hz as text."""
    table = []
    for column in system.columns:
        row = column.row | {"sampling_frequency": rate_hz}
        if column.type == "JNTANG":
            row["reference_frame"] = PARENT_BONE
        table.append(row)
    return [list(table[0]), *(list(row.values()) for row in table)]


def reference_frames(system: System) -> dict[str, Any]:
    """The content of channels.json."""
    content = channels_json()
    levels = content["reference_frame"]["Levels"]
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
    return content


def _texts(values: Array, shift: int = 0) -> list[list[pa.Array]]:
    """Columns of (T, K, n) as text, K lists of n: numbers times 10**shift, null where NaN."""
    frames, points, parts = values.shape
    flat = text_of(np.ascontiguousarray(np.moveaxis(values, 0, -1)).ravel() + 0.0, shift)
    return [
        [flat.slice((point * parts + part) * frames, frames) for part in range(parts)]
        for point in range(points)
    ]
