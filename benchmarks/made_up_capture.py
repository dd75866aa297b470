"""A made-up raw capture of any length, fast: every record the protocol's, the poses smooth and random."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stages.capture.archive import ArchiveWriter
from stages.capture.trackers.liberty.body import record_type
from stages.capture.trackers.liberty.items import HEADER_BYTES
from stages.capture.trackers.settings import StreamSettings

STATIONS = tuple(range(1, 17))
RATE_HZ = 240.0
ITEMS = (8, 9, 11, 3, 7)
"""48 bytes a record, the list that the field's drivers ask for."""

CHUNK_FRAMES = 3
"""Frames in what one read returns: 12.5 ms."""


def write_capture(path: Path, seconds: float, seed: int = 0) -> int:
    """Write a capture of 16 receivers at 240 Hz; gives the number of bytes that the tracker sent."""
    lists = dict.fromkeys(STATIONS, ITEMS)
    settings = StreamSettings("liberty", "binary", "cm", RATE_HZ, STATIONS, lists, {}, {})
    writer = ArchiveWriter(path, {"made_up": True, "seed": seed}, utc_offset_ns=lambda: 0)
    writer.settings(settings.to_json(), 0)
    random = np.random.default_rng(seed)
    period_ns = 1e9 / RATE_HZ
    sent = 0
    for first in range(0, int(seconds * RATE_HZ), 240):
        rows = _second(first, random)
        for start in range(0, 240, CHUNK_FRAMES):
            piece = rows[start : start + CHUNK_FRAMES].tobytes()
            late_ns = int(random.integers(0, 2_000_000))
            writer.received(piece, int((first + start + CHUNK_FRAMES) * period_ns) + late_ns)
            sent += len(piece)
        writer.flush()
    writer.close({"reason": "duration"}, int(seconds * 1e9))
    return sent


def _second(first: int, random: np.random.Generator) -> np.ndarray:
    """Records of 240 frames, (240, 16)."""
    rows = np.zeros((240, len(STATIONS)), record_type(ITEMS))
    raw = rows.view(np.uint8).reshape(240, len(STATIONS), -1)
    raw[..., :2] = np.frombuffer(b"LY", np.uint8)
    rows["station"] = STATIONS
    rows["command"] = ord("C")
    rows["size"] = rows.dtype.itemsize - HEADER_BYTES
    frame = np.arange(first, first + 240)[:, None]
    rows["frame"] = frame
    rows["device_ms"] = frame * 1000 // 240
    phase = frame / 240 + np.arange(len(STATIONS)) / 3
    for index, axis in enumerate("xyz"):
        rows[axis] = 25 + 5 * np.sin(phase + index) + random.normal(0, 0.005, phase.shape)
    half = 0.5 * np.sin(phase) + random.normal(0, 0.001, phase.shape)
    rows["qw"], rows["qx"] = np.cos(half), np.sin(half) * 0.6
    rows["qy"] = np.sin(half) * 0.8
    return rows
