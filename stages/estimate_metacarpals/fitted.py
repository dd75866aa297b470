"""What a fit of the whole hand says of bones and metacarpals, for models that have one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from schemas.catalogue import BONE_LENGTHS, BONE_POSES
from schemas.table_rows import TableRows
from schemas.tables import read_table, rows_of


@dataclass(frozen=True)
class Fitted:
    """bones : rows of the fit's bone_lengths by segment; poses : quaternions in the bone_poses table that it
    wrote, by task, trial and segment.
    """

    bones: Mapping[str, Mapping[str, Any]]
    poses: TableRows


def read_fitted(bones: Path, poses: Path) -> Fitted:
    """Read what stages.fit_hand wrote. Raises InputError where a table is not what it should be."""
    turns = TableRows(poses, BONE_POSES, ("task", "trial", "segment"), [f"q{part}" for part in "wxyz"])
    return Fitted({row["bone"]: row for row in rows_of(read_table(bones, BONE_LENGTHS))}, turns)
