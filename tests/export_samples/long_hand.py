"""A hand in a recording of any length, for tests of what long recordings cost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from long_poses import long_poses

from export_samples.known_hands import FITTED, REPLAYED, KnownHand, make_hand
from shukotsu.schemas.catalogue import BONE_POSES, METACARPALS, POSED_TIPS
from shukotsu.schemas.parts import parts_writer, read_part
from shukotsu.schemas.tables import Provenance, Table


def long_hand(folder: Path, n_frames: int) -> KnownHand:
    """Ten seconds of a hand over and over, under a model that rides on receivers and one that is fitted."""
    known = make_hand(folder, "right", 2400)
    poses = known.plan.poses(known.recording)
    poses.unlink()
    long_poses(poses, n_frames)
    for model, table, by in (
        (REPLAYED, METACARPALS, "digit"),
        (FITTED, BONE_POSES, "segment"),
        (FITTED, POSED_TIPS, "digit"),
    ):
        _lengthen(known, model, table, by, n_frames)
    return known


def _lengthen(known: KnownHand, model: str, table: Table, by: str, n_frames: int) -> None:
    """Write a frame-by-frame table again, of one model and longer; a row group a name."""
    path, part = known.path(model, table), known.plan.part("right", model)
    short = read_part(path, table, part)
    names = short.column(by).to_numpy()
    with parts_writer(path, table, Provenance()) as writer:
        for name in dict.fromkeys(names):
            own = short.filter(names == name)
            rows = np.arange(n_frames) % own.num_rows
            columns = {column: own.column(column).take(rows) for column in own.column_names}
            writer.columns(part, columns | {"frame": np.arange(n_frames)})
