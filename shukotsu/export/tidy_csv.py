"""Tidy CSV: a table of poses and one of angles, each with a row per frame and joint, and a JSON description.

Empty cells are gaps, or angles that the model assumes instead of measuring them. Positions are in mm in the
transmitter's frame, rounded to a nanometre; quaternions (w, x, y, z), from the bone's frame to the
transmitter's, are rounded to 9 decimals.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from shukotsu.export.delimited_text import write_rows
from shukotsu.export.exported_motion import BONE_TO_WEBXR, blocks, facts
from shukotsu.hand.joint_angles import joint_angles
from shukotsu.hand.neutral_bones import angle_axes
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import Array, conjugate, multiply
from shukotsu.study.config_files import export_constants
from shukotsu.tables.poses import NUMBERS
from shukotsu.tables.whole_files import write_text

_ANGLES = ("flexion_deg", "abduction_deg", "rotation_deg")


def write(motion: PosedRecording, path: Path) -> tuple[str, ...]:
    """Write `path` (poses), `<stem>_angles.csv` and `<stem>.json`; return sentences on what they lack (none).

    Angles are computed from the poses that are written; for a fitted hand they equal those of the
    joint_angles table. Joints of unknown anatomy have no angles; if there are no others, the file of angles
    is not written.
    """
    _write_long(
        path, motion, motion.names, NUMBERS,
        lambda block: np.concatenate([block.position_mm.round(6), block.quaternion.round(9)], -1),
    )  # fmt: skip
    if names := tuple(bone_angles_deg(motion.take(slice(0)))):
        angles = path.with_name(f"{path.stem}_angles.csv")
        _write_long(
            angles, motion, names, _ANGLES,
            lambda block: np.stack([*bone_angles_deg(block).values()], 1).round(6),
        )  # fmt: skip
    tree = {joint.name: motion.names[joint.parent] for joint in motion.joints[1:]}
    rest = dict(zip(motion.names, motion.rest_offset_mm.round(6).tolist(), strict=True))
    columns = export_constants()["csv_columns"]
    described = facts(motion, "mm", "") | {"columns": columns, "parent": tree, "rest_offset_mm": rest}
    write_text(path.with_suffix(".json"), json.dumps(described, ensure_ascii=False, indent=1) + "\n")
    return ()


def bone_angles_deg(motion: PosedRecording) -> dict[str, Array]:
    """Return flexion, deviation and rotation (T, 3), deg, of each joint of known anatomy; NaN if assumed."""
    hand, turn = motion.hand, multiply(motion.quaternion, conjugate(BONE_TO_WEBXR))
    rests = multiply(BONE_TO_WEBXR, multiply(motion.neutral, conjugate(BONE_TO_WEBXR)))
    angles_deg = {
        joint.name: joint_angles(turn[:, joint.parent], turn[:, i], hand, rests[i], angle_axes(joint, hand))
        for i, joint in enumerate(motion.joints)
        if not joint.tip and np.isfinite(rests[i]).all()
    }
    unmeasured = np.full((len(turn), len(_ANGLES)), np.nan)
    return angles_deg | {j.name: unmeasured for j in motion.joints if j.assumed and j.name in angles_deg}


def _write_long(
    path: Path,
    motion: PosedRecording,
    joints: Sequence[str],
    columns: Sequence[str],
    values: Callable[[PosedRecording], Array],
) -> None:
    """Write a row for each frame and joint, frame by frame.

    values : function that returns the (n, N, columns) values of a block of n frames.
    """

    def tables() -> Iterator[pa.Table]:
        for block in blocks(motion):
            count = len(block.frame)
            flat = values(block).reshape(count * len(joints), -1)
            cells = {
                "frame": np.repeat(block.frame, len(joints)),
                "time_s": pa.array(np.repeat(block.time_s, len(joints)), from_pandas=True),
                "joint": pa.array(joints).take(pa.array(np.tile(np.arange(len(joints)), count))),
            }
            cells |= {name: pa.array(flat[:, i], from_pandas=True) for i, name in enumerate(columns)}
            yield pa.table(cells)

    write_rows(path, ",".join(("frame", "time_s", "joint", *columns)) + "\n", tables())
