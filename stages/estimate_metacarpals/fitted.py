"""What a fit of the whole hand says of bones and metacarpals, for models that have one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc

from kinematics.rotations import Array
from schemas.catalogue import BONE_LENGTHS, BONE_POSES
from schemas.tables import column_array, open_table, read_table, rows_of


@dataclass(frozen=True)
class Fitted:
    """bones : rows of the fit's bone_lengths by segment; poses : the bone_poses table that it wrote."""

    bones: Mapping[str, Mapping[str, Any]]
    poses: Path

    def metacarpal(self, task: str, trial: str, segment: str) -> Array:
        """Posture (T, 4) of one bone over a recording, bone to transmitter frame; NaN in gaps."""
        wanted = {"task": task, "trial": trial, "segment": segment}
        columns = [*wanted, *(f"q{part}" for part in "wxyz")]
        parts = []
        with open_table(self.poses, BONE_POSES) as file:
            for group in range(file.metadata.num_row_groups):
                table = file.read_row_group(group, columns=columns)
                for name, word in wanted.items():
                    table = table.filter(pc.equal(table.column(name), word))
                parts.append(np.stack([column_array(table, f"q{part}") for part in "wxyz"], -1))
        return np.concatenate(parts) if parts else np.empty((0, 4))


def read_fitted(bones: Path, poses: Path) -> Fitted:
    """Read what stages.fit_hand wrote. Raises InputError where a table is not what it should be."""
    open_table(poses, BONE_POSES).close()
    return Fitted({row["bone"]: row for row in rows_of(read_table(bones, BONE_LENGTHS))}, poses)
