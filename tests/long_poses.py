"""Poses tables of any length, made a row group at a time, for tests of what long recordings cost."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import simulate
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.typed_table import ROW_GROUP_ROWS, Provenance, write_table_in_parts

_FRAMES = 2400
_NUMBERS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")


def long_poses(path: Path, n_frames: int) -> Path:
    """Ten seconds of a hand over and over, with new noise, in longer row groups than an import writes."""
    hand = simulate("01", "right", "rom", 1, Realism.full(), _FRAMES)
    noise = np.random.default_rng(0)
    names = {"subject": "01", "hand": "right", "task": "rom", "trial": ""}

    def parts() -> Iterator[dict[str, Any]]:
        for column, segment in enumerate(hand.segments):
            for start in range(0, n_frames, ROW_GROUP_ROWS):
                frame = np.arange(start, min(start + ROW_GROUP_ROWS, n_frames))
                rows = frame % _FRAMES
                position_mm = hand.position_mm[rows, column] + noise.normal(0, 0.1, (len(frame), 3))
                numbers = np.concatenate([position_mm, hand.quaternion[rows, column]], 1)
                yield {
                    "segment": _repeated(segment, len(frame)),
                    "frame": frame,
                    "time_s": frame / 240.0,
                    **dict(zip(_NUMBERS, numbers.T, strict=True)),
                    "valid": np.ones(len(frame), bool),
                    "flags": _repeated("", len(frame)),
                }

    write_table_in_parts(path, POSES, parts(), Provenance(parameters=names))
    return path


def _repeated(word: str, count: int) -> pa.Array:
    return pa.DictionaryArray.from_arrays(pa.array(np.zeros(count, np.int32)), pa.array([word]))
