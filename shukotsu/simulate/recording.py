"""Write a simulated recording as a laboratory would provide it, and its exact truth beside it.

The recording is a tidy table in CSV or Parquet; the truth is tables of model "truth".

`joint_centres`: the mean over the recording of the centre in the frame of the receiver, which moves on the
skin; axes likewise. The centre is the origin of the child's bone frame, which glides on the parent's bone.
Centres do not depend on tracker errors; `gap_rms_mm` is the gap of these centres in the recording as written.

`bone_lengths`: joint to joint in the relaxed posture; a digit's last bone ends at the tip of the bone, not at
a receiver.

`metacarpals`: length_mm is from CMC to MCP joint; swing and twist are defined only for estimates and are
null.

`tips`: the tip of the bone and, in additional columns, of the digit with skin and pulp. error_mm is the
distance from the bone's tip to the distal receiver as recorded, null if the receiver's pose was lost;
error_first_frame_mm is null.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from shukotsu.arrays import Array
from shukotsu.errors import InputError
from shukotsu.simulate.random_hand import BONES, DIGITS, JOINTS, PARENT, TIP_BONES
from shukotsu.simulate.simulation import Simulated
from shukotsu.study.verdict import UNJUDGED
from shukotsu.tables import digests, whole_files
from shukotsu.tables.catalogue import BONE_LENGTHS, BONE_TIP, JOINT_CENTRES, METACARPALS, TIPS
from shukotsu.tables.poses import Poses
from shukotsu.tables.typed_table import Column, Provenance, columns_from_rows, vector_columns, write_table

if TYPE_CHECKING:
    from shukotsu.tables.rows import BoneLengthsRow, JointCentresRow

ENDINGS = (".parquet", ".csv")


def check_ending(path: Path) -> None:
    """Raise InputError unless the file name ends in a format that can be written."""
    if path.suffix not in ENDINGS:
        raise InputError(f"{path}: the file's ending determines the format; expected {' or '.join(ENDINGS)}")


def tidy(recording: Poses) -> pa.Table:
    """Convert a recording to a tidy table, by frame, segments in the layout's order.

    Parameters
    ----------
    recording : Poses
        T frames of S receivers.

    Returns
    -------
    pyarrow.Table
        A row per frame and segment: frame, time_s, segment, x_mm to z_mm, qw to qz.

    """
    n_frames, n_segments = recording.position_mm.shape[:2]
    columns = {
        "frame": pa.array(np.repeat(recording.frame, n_segments)),
        "time_s": pa.array(np.repeat(recording.time_s, n_segments)),
        "segment": pa.array(list(recording.segments) * n_frames, pa.string()),
    }
    for i, axis in enumerate("xyz"):
        columns[f"{axis}_mm"] = pa.array(recording.position_mm[..., i].ravel())
    for i, part in enumerate("wxyz"):
        columns[f"q{part}"] = pa.array(recording.quaternion[..., i].ravel())
    return pa.table(columns)


def write_recording(path: Path, recording: Poses) -> None:
    """Write a recording atomically as CSV or Parquet; numbers in CSV have full precision.

    Parameters
    ----------
    path : Path
        File to write; its ending determines the format.
    recording : Poses
        Recording to write.

    Raises
    ------
    InputError
        If the ending is neither .parquet nor .csv.

    """
    check_ending(path)
    with whole_files.replacing(path) as temporary:
        if path.suffix == ".csv":
            options = pyarrow.csv.WriteOptions(quoting_style="needed")
            pyarrow.csv.write_csv(tidy(recording), temporary, options)
        else:
            options = {"compression": "zstd", "write_page_checksum": True}
            pq.write_table(
                tidy(recording), temporary, use_dictionary=["frame", "time_s", "segment"], **options
            )
            digests.store_digest(temporary)


MODEL_NAME = "truth"

_SKIN_TIP = tuple(
    Column(
        f"skin_tip_{axis}_mm",
        TIPS.column(f"tip_{axis}_mm").type,
        "mm",
        f"end of the digit, skin and pulp included, in the transmitter frame, {axis}",
    )
    for axis in "xyz"
)
TRUE_TIPS = replace(TIPS, columns=(*TIPS.columns, *_SKIN_TIP))
"""The table tips with additional columns for the tip of the digit."""


def write_truth(folder: Path, simulated: Simulated, provenance: Provenance) -> None:
    """Write the four truth tables into a folder, each to a file with the table's name."""
    for table, columns in (
        (JOINT_CENTRES, columns_from_rows(JOINT_CENTRES, _joint_rows(simulated))),
        (BONE_LENGTHS, columns_from_rows(BONE_LENGTHS, _bone_rows(simulated))),
        (METACARPALS, _metacarpal_columns(simulated)),
        (TRUE_TIPS, _tip_columns(simulated)),
    ):
        write_table(folder / f"{table.name}.parquet", table, columns, provenance)


def _joint_rows(simulated: Simulated) -> list[JointCentresRow]:
    """Build the rows of joint_centres."""
    rows = []
    for joint in simulated.truth.joints.values():
        row: JointCentresRow = {
            "joint": joint.name,
            "parent_segment": joint.parent_segment,
            "child_segment": joint.child_segment,
            "dof": joint.dof,
            "sd_mm": 0.0,
            "gap_rms_mm": float(np.sqrt(np.mean(joint.gap_mm**2))),
            "range_deg": joint.range_deg,
            "n_frames": len(simulated.frame),
            "source": "simulation",
            "status": "ok",
            "message": "" if joint.parent_segment else "no parent receiver",
        }
        row |= _keys(simulated) | UNJUDGED
        row |= vector_columns("parent_", joint.parent_mm, "_mm")
        row |= vector_columns("child_", joint.child_mm, "_mm")
        row |= vector_columns("axis_parent_", joint.axis_parent)
        row |= vector_columns("axis_child_", joint.axis_child)
        rows.append(row)
    return rows


def _keys(simulated: Simulated) -> Any:
    """Return the key columns of the truth's rows."""
    name = simulated.name
    whose = {"subject": name.subject, "session": name.session, "hand": name.hand}
    return {**whose, "model": MODEL_NAME, "made_without": ""}


def _bone_rows(simulated: Simulated) -> list[BoneLengthsRow]:
    """Build the rows of bone_lengths; the vector of a bone with a receiver is in that receiver's frame."""
    rows = []
    for bone in range(BONES.index("thumb_metacarpal"), len(BONES)):
        name, length_mm = BONES[bone], float(simulated.truth.hand.length_mm[bone])
        row: BoneLengthsRow = {
            "digit": name.split("_")[0],
            "bone": name,
            "starts_at": JOINTS[bone - 1],
            "ends_at": BONE_TIP if bone in TIP_BONES else JOINTS[list(PARENT).index(bone)],
            "length_mm": length_mm,
            "sd_mm": 0.0,
            "message": "",
            "driven_by": name if name in simulated.truth.mounts.segments else "",
        }
        row |= _keys(simulated) | UNJUDGED
        if row["driven_by"]:
            along = simulated.truth.along[simulated.truth.mounts.segments.index(name)]
            row |= vector_columns("", length_mm * along, "_mm")
        rows.append(row)
    return rows


def _digit_columns(simulated: Simulated) -> dict[str, Any]:
    """Build the key columns of a table with a row per digit and frame."""
    n_rows = len(DIGITS) * len(simulated.frame)
    keys = {**_keys(simulated), "task": simulated.name.task, "trial": ""}
    return {
        **{name: [value] * n_rows for name, value in keys.items()},
        "digit": np.repeat(DIGITS, len(simulated.frame)).tolist(),
        "frame": np.tile(simulated.frame, len(DIGITS)),
    }


def _by_digit(values: Array) -> Array:
    """Reorder (T, 5, ...) to (5 T, ...), digit after digit."""
    return np.swapaxes(values, 0, 1).reshape(-1, *values.shape[2:])


def _metacarpal_columns(simulated: Simulated) -> dict[str, Any]:
    """Build the columns of metacarpals."""
    metacarpals = [BONES.index(f"{digit}_metacarpal") for digit in DIGITS]
    quaternion = _by_digit(simulated.truth.bone_quaternion[:, metacarpals])
    unknown = np.full(len(quaternion), np.nan)
    return {
        **_digit_columns(simulated),
        **{f"q{part}": quaternion[:, i] for i, part in enumerate("wxyz")},
        "swing_deg": unknown,
        "twist_deg": unknown,
        "length_mm": np.repeat(simulated.truth.hand.length_mm[metacarpals], len(simulated.frame)),
        "flags": [""] * len(quaternion),
    }


def _tip_columns(simulated: Simulated) -> dict[str, Any]:
    """Build the columns of tips, including the additional ones."""
    tip, skin_tip = _by_digit(simulated.truth.tip_mm), _by_digit(simulated.truth.skin_tip_mm)
    receivers = [simulated.segments.index(f"{digit}_distal") for digit in DIGITS]
    return {
        **_digit_columns(simulated),
        "time_s": np.tile(simulated.time_s, len(DIGITS)),
        **{f"tip_{axis}_mm": tip[:, i] for i, axis in enumerate("xyz")},
        "error_mm": np.linalg.norm(tip - _by_digit(simulated.position_mm[:, receivers]), axis=-1),
        "error_first_frame_mm": np.full(len(tip), np.nan),
        **{f"skin_tip_{axis}_mm": skin_tip[:, i] for i, axis in enumerate("xyz")},
    }
