"""The exact truth beside a simulated recording, in the tables of the contract (model "truth").

`joint_centres`: the centre is the origin of the child's bone frame. In the child's receiver frame, and in the
parent's where the two bones share the joint, it is a constant; else (MCP joints seen from a hand whose palm
moves, the thumb's skew CMC axes) the mean over the frames. Frames are those of the receivers as mounted,
without skin artefact; `gap_rms_mm` is the gap that these centres have in the recording as written.
`bone_lengths`: joint to joint; the last bone of a digit ends at the tip of the BONE, not at a receiver.
`metacarpals`: length_mm is CMC to MCP; swing and twist are estimators' words and stay null.
`tips`: the tip of the bone; error_mm is its distance to the distal receiver as recorded, and a true skeleton
has no first-frame error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from schemas.catalogue import BONE_LENGTHS, FINGERTIP, JOINT_CENTRES, METACARPALS, TIPS
from schemas.layout import Layout
from schemas.tables import Provenance, Table, columns_from_rows, write_table
from skeleton import rotations
from skeleton.rotations import Array
from stages.simulate.mounts import Mounts
from stages.simulate.random_hand import BONES, DIGITS, FLEXION, JOINTS, PARENT, TIP_BONES, Hand
from stages.simulate.realism import Realism

MODEL_NAME = "truth"
TRUTH_TABLES: tuple[Table, ...] = (JOINT_CENTRES, BONE_LENGTHS, METACARPALS, TIPS)


@dataclass(frozen=True)
class TrueJoint:
    """A joint between two receivers.

    parent_mm, child_mm : the centre in the parent's and the child's receiver frame; axis_parent, axis_child :
    the unit flexion axis there; parent values are NaN where the parent carries no receiver. range_deg : of
    flexion. gap_mm : (T,) distance between the two centres in the recording.
    """

    name: str
    parent_segment: str
    child_segment: str
    dof: int
    parent_mm: Array
    child_mm: Array
    axis_parent: Array
    axis_child: Array
    range_deg: float
    gap_mm: Array


@dataclass(frozen=True)
class Truth:
    """Everything that the simulation knows.

    hand, mounts : the hand and where its receivers sit. angles_rad : (T, J, 3). bone_position_mm (T, B, 3)
    and bone_quaternion (T, B, 4) : bone frames in the transmitter frame. tip_mm : (T, 5, 3) tips of the
    bones, digits in the order of DIGITS. joints : by name.
    """

    hand: Hand
    mounts: Mounts
    angles_rad: Array
    bone_position_mm: Array
    bone_quaternion: Array
    tip_mm: Array
    joints: Mapping[str, TrueJoint]

    def wrist_to_mcp_mm(self) -> Array:
        """Distance (T, 5) from the wrist centre to each digit's MCP joint: the paper's Fig. 3 metacarpal."""
        wrist = self.bone_position_mm[:, BONES.index("hand")]
        mcp = [BONES.index(f"{digit}_proximal") for digit in DIGITS]
        return np.asarray(np.linalg.norm(self.bone_position_mm[:, mcp] - wrist[:, None], axis=-1))


def true_tips_mm(hand: Hand, bone_position_mm: Array, bone_quaternion: Array) -> Array:
    """Tips of the bones (T, 5, 3) in the transmitter frame."""
    along = np.zeros((len(DIGITS), 3))
    along[:, 0] = hand.length_mm[TIP_BONES]
    return bone_position_mm[:, TIP_BONES] + rotations.rotate(bone_quaternion[:, TIP_BONES], along)


def true_joints(
    layout: Layout,
    hand: Hand,
    mounts: Mounts,
    angles_rad: Array,
    bones: tuple[Array, Array],
    recorded: tuple[Array, Array],
    realism: Realism,
) -> dict[str, TrueJoint]:
    """Give the true joints of a layout; bones and recorded are positions in mm and quaternions over time."""
    riding = mounts.poses(*bones)
    joints = {}
    for joint in layout.solvable:
        index = JOINTS.index(joint.name)
        centre_mm = bones[0][:, index + 1]
        axis = rotations.rotate(bones[1][:, PARENT[index]], hand.axes[index, FLEXION])
        child = mounts.segments.index(joint.child)
        child_mm, axis_child = _in_receiver(riding, child, centre_mm, axis)
        parent_mm, axis_parent, gap_mm = np.full(3, np.nan), np.full(3, np.nan), np.full(len(axis), np.nan)
        worn = joint.parent_receiver in mounts.segments
        if worn:
            parent = mounts.segments.index(joint.parent_receiver)
            parent_mm, axis_parent = _in_receiver(riding, parent, centre_mm, axis)
            apart = _to_transmitter(recorded, parent, parent_mm) - _to_transmitter(recorded, child, child_mm)
            gap_mm = np.linalg.norm(apart, axis=-1)
        joints[joint.name] = TrueJoint(
            joint.name,
            joint.parent_receiver if worn else "",
            joint.child,
            1 if realism.hinges_only else joint.dof,
            parent_mm,
            child_mm,
            axis_parent,
            axis_child,
            float(np.degrees(np.ptp(angles_rad[:, index, FLEXION]))),
            gap_mm,
        )
    return joints


def _in_receiver(
    poses: tuple[Array, Array], receiver: int, point_mm: Array, axis: Array
) -> tuple[Array, Array]:
    """Mean over the frames of points and axes (T, 3) seen from a receiver."""
    back = rotations.conjugate(poses[1][:, receiver])
    place = rotations.rotate(back, point_mm - poses[0][:, receiver]).mean(0)
    return place, rotations.unit(rotations.rotate(back, axis).mean(0))


def _to_transmitter(poses: tuple[Array, Array], receiver: int, point_mm: Array) -> Array:
    return np.asarray(poses[0][:, receiver] + rotations.rotate(poses[1][:, receiver], point_mm))


@dataclass(frozen=True)
class Written:
    """What the truth tables say of the recording beside them; distal_mm (T, 5, 3) is as recorded."""

    subject: str
    hand: str
    task: str
    frame: npt.NDArray[np.int64]
    time_s: Array
    distal_mm: Array


def write_truth(folder: Path, truth: Truth, written: Written, provenance: Provenance) -> None:
    """Write the four truth tables into a folder, named as in the contract."""
    columns = {
        JOINT_CENTRES.name: columns_from_rows(JOINT_CENTRES, _joint_rows(truth, written)),
        BONE_LENGTHS.name: columns_from_rows(BONE_LENGTHS, _bone_rows(truth, written)),
        METACARPALS.name: _metacarpal_columns(truth, written),
        TIPS.name: _tip_columns(truth, written),
    }
    for table in TRUTH_TABLES:
        write_table(folder / f"{table.name}.parquet", table, columns[table.name], provenance)


def _joint_rows(truth: Truth, written: Written) -> list[dict[str, Any]]:
    return [
        {
            **_keys(written),
            "joint": joint.name,
            "parent_segment": joint.parent_segment,
            "child_segment": joint.child_segment,
            "dof": joint.dof,
            **_by_axis("parent_", joint.parent_mm, "_mm"),
            **_by_axis("child_", joint.child_mm, "_mm"),
            **_by_axis("axis_parent_", joint.axis_parent),
            **_by_axis("axis_child_", joint.axis_child),
            "sd_mm": 0.0,
            "gap_rms_mm": float(np.sqrt(np.mean(joint.gap_mm**2))),
            "range_deg": joint.range_deg,
            "n_frames": len(written.frame),
            "source": "simulation",
            "status": "ok",
            "message": "" if joint.parent_segment else "no parent receiver",
        }
        for joint in truth.joints.values()
    ]


def _keys(written: Written) -> dict[str, str]:
    return {"subject": written.subject, "hand": written.hand, "model": MODEL_NAME, "made_without": ""}


def _by_axis(prefix: str, vector: Array, suffix: str = "") -> dict[str, Any]:
    return {f"{prefix}{axis}{suffix}": value for axis, value in zip("xyz", vector, strict=True)}


def _bone_rows(truth: Truth, written: Written) -> list[dict[str, Any]]:
    """Rows of the bones; the vector of one that carries a receiver is in that receiver's frame."""
    rows = []
    for bone in range(BONES.index("thumb_metacarpal"), len(BONES)):
        name, length_mm = BONES[bone], float(truth.hand.length_mm[bone])
        row = {
            **_keys(written),
            "digit": name.split("_")[0],
            "bone": name,
            "starts_at": JOINTS[bone - 1],
            "ends_at": FINGERTIP if bone in TIP_BONES else JOINTS[list(PARENT).index(bone)],
            "length_mm": length_mm,
            "sd_mm": 0.0,
            "message": "",
            "driven_by": name if name in truth.mounts.segments else "",
        }
        if row["driven_by"]:
            to_bone = truth.mounts.quaternion[truth.mounts.segments.index(name)]
            along = rotations.rotate(rotations.conjugate(to_bone), np.array([length_mm, 0.0, 0.0]))
            row |= _by_axis("", along, "_mm")
        rows.append(row)
    return rows


def _digit_columns(written: Written) -> dict[str, Any]:
    """Key columns of a table with a row per digit and frame."""
    n_rows = len(DIGITS) * len(written.frame)
    keys = {**_keys(written), "task": written.task, "trial": ""}
    return {
        **{name: [value] * n_rows for name, value in keys.items()},
        "digit": np.repeat(DIGITS, len(written.frame)).tolist(),
        "frame": np.tile(written.frame, len(DIGITS)),
    }


def _by_digit(values: Array) -> Array:
    """(T, 5, ...) -> (5 T, ...), digit after digit."""
    return np.swapaxes(values, 0, 1).reshape(-1, *values.shape[2:])


def _metacarpal_columns(truth: Truth, written: Written) -> dict[str, Any]:
    metacarpals = [BONES.index(f"{digit}_metacarpal") for digit in DIGITS]
    quaternion = _by_digit(truth.bone_quaternion[:, metacarpals])
    unknown = np.full(len(quaternion), np.nan)
    return {
        **_digit_columns(written),
        **{f"q{part}": quaternion[:, i] for i, part in enumerate("wxyz")},
        "swing_deg": unknown,
        "twist_deg": unknown,
        "length_mm": np.repeat(truth.hand.length_mm[metacarpals], len(written.frame)),
        "flags": [""] * len(quaternion),
    }


def _tip_columns(truth: Truth, written: Written) -> dict[str, Any]:
    tip = _by_digit(truth.tip_mm)
    return {
        **_digit_columns(written),
        "time_s": np.tile(written.time_s, len(DIGITS)),
        **{f"tip_{axis}_mm": tip[:, i] for i, axis in enumerate("xyz")},
        "error_mm": np.linalg.norm(tip - _by_digit(written.distal_mm), axis=-1),
        "error_first_frame_mm": np.full(len(tip), np.nan),
    }
