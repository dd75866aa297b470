"""What `viewer.js` reads of a packed motion, in Python."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shukotsu.stages.report.hand_motion import Array


def unpacked(data: bytes, parts: Sequence[Mapping[str, Any]]) -> dict[str, Array]:
    """What `viewer.packed` wrote, by block: (T, N, W), NaN in gaps."""
    raw = np.frombuffer(zlib.decompress(data), np.uint8)
    blocks, at = {}, 0
    for part in parts:
        n_frames, count, width, planes = (part[key] for key in ("frames", "count", "width", "planes"))
        code = np.zeros((count, width, n_frames), np.int64)
        for plane in range(planes):
            code |= raw[at : at + code.size].reshape(code.shape).astype(np.int64) << (8 * plane)
            at += code.size
        change = np.where(code > 0, ((code - 1) >> 1) ^ -((code - 1) & 1), 0)
        values = np.where(code > 0, np.cumsum(change, axis=-1) * part["step"], np.nan)
        blocks[part["name"]] = values.transpose(2, 0, 1)
    return blocks
