"""The columns of a poses table made of samples, as its file would hold them; a joint solved from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa

from shukotsu.paper.closed import JointSolution, solve_closed
from shukotsu.paper.moments import JointMoments, relative_poses
from shukotsu.readers.poses_table import PosesTable, poses_table
from shukotsu.readers.samples import NUMBERS, Samples


def poses_columns(samples: Samples, parents: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Make the table and give its columns, all segments after each other."""
    return columns_of(poses_table([samples], parents or {}))


def columns_of(table: PosesTable, row_group_frames: int = 1000) -> dict[str, Any]:
    groups = list(table.row_groups(row_group_frames))
    return {name: _joined([group[name] for group in groups]) for name in groups[0]}


def _joined(parts: list[Any]) -> Any:
    if isinstance(parts[0], np.ndarray):
        return np.concatenate(parts)
    return pa.concat_arrays([part.cast(pa.string()) for part in parts])


def solved(samples: Samples, parent: str, child: str) -> JointSolution:
    """The joint between two segments, all six unknowns free."""
    columns = poses_columns(samples)
    segment = np.array(columns["segment"].to_pylist())
    of_both = [segment == one for one in (parent, child)]
    poses = np.stack([np.stack([columns[name][rows] for name in NUMBERS], -1) for rows in of_both], 1)
    valid = np.stack([columns["valid"][rows] for rows in of_both], 1)
    moments = JointMoments(1)
    moments.add(relative_poses(poses[..., 3:], poses[..., :3], valid, np.array([0]), np.array([1])))
    return solve_closed(moments, 0, 6)
