"""A recording through the emulated device into a raw capture, as a recorder would have kept its stream.

Time is made up: the device's cycles at their exact period, pieces that arrive about every 10 ms,
cut anywhere. The same input gives the same bytes.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.trackers.archive import ArchiveWriter
from shukotsu.trackers.emulate.device import FOLLOWING, EmulatedLiberty
from shukotsu.trackers.emulate.pose_sources import Motion
from shukotsu.trackers.emulate.server import SECOND_NS, Emulator
from shukotsu.trackers.liberty.replies import FULL_LIST
from shukotsu.trackers.protocols.stream_settings import StreamSettings

BEGINNING_NS = 3_360_000_000
"""The made-up clock's reading when the recorder starts the stream."""

PIECE_NS, MOST_JITTER_NS, _MOST_HELD_BACK_BYTES = 10_000_000, 1_000_000, 80


def write_archive(device: EmulatedLiberty, out: Path, about: Mapping[str, Any]) -> None:
    """Record the device from the first to the last frame of its motion.

    Positions pass through float32 centimetres: they come back within 1e-4 mm up to 1 m from the transmitter.
    about : kept with the recording. The hemisphere is one that no receiver leaves, or following. Raises
    InputError where `out` exists.
    """
    archive = ArchiveWriter(out, {"emulated": True, **about}, utc_offset_ns=lambda: 0)
    vector, items = home_hemisphere(device.motion), ",".join(map(str, FULL_LIST))
    begin = b"F1\rU1\rO*,%s\rH*,%g,%g,%g\rQ0\rC\r" % (items.encode(), *vector)
    settings = StreamSettings(
        device.family,
        "binary",
        "cm",
        float(device.rate),
        device.active(),
        dict.fromkeys(device.stations, FULL_LIST),
        dict.fromkeys(device.stations, vector),
        {"whoami": device.whoami},
    )
    archive.settings(settings.to_json(), BEGINNING_NS)
    archive.sent(begin, BEGINNING_NS)
    emulator = Emulator(device, lambda _: 0, BEGINNING_NS)  # what it sends waits until a piece takes it
    device.receive(begin)
    begun_ns = emulator.due_ns
    end_ns = begun_ns + len(device.motion.position_mm) * SECOND_NS // int(device.rate) - 1
    ticks_ns = [*range(begun_ns + PIECE_NS, end_ns, PIECE_NS), end_ns]
    for pieces, due_ns in enumerate(ticks_ns, 1):
        emulator.run(due_ns)
        draw = random.Random(pieces)
        now_ns = due_ns + draw.randrange(MOST_JITTER_NS)
        held_back = 0 if due_ns == end_ns else draw.randrange(_MOST_HELD_BACK_BYTES)
        count = len(emulator.waiting) - held_back  # the others come with the next piece
        if count > 0:
            archive.received(bytes(emulator.waiting[:count]), now_ns)
            del emulator.waiting[:count]
        if pieces % (SECOND_NS // PIECE_NS) == 0:
            archive.flush()
    archive.sent(b"P", now_ns)
    archive.received(device.receive(b"P"), now_ns)
    archive.close({"reason": "duration", "duration_s": (end_ns + 1 - begun_ns) / SECOND_NS}, now_ns)


def home_hemisphere(motion: Motion) -> tuple[float, float, float]:
    """The axis on whose side all receivers stay, nearest to where they are; FOLLOWING where there is none."""
    positions = motion.position_mm.reshape(-1, 3)
    positions = positions[np.isfinite(positions).all(-1)]
    mean = positions.mean(0) if len(positions) else np.zeros(3)
    axis = int(np.argmax(np.abs(mean)))
    if not (positions[:, axis] * np.sign(mean[axis]) > 0).all():
        return FOLLOWING
    x, y, z = np.where(np.arange(3) == axis, np.sign(mean), 0.0).tolist()
    return (x, y, z)
