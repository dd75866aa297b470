"""The receivers' true poses, cycle by cycle: the built-in motion, or a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.hand import rotations
from shukotsu.tracker.protocols.records import Array, Wholes

MAX_STATION = 16
PERIOD_CYCLES = 960
"""The built-in motion repeats after so many cycles: 4 s at 240 Hz."""


@dataclass(frozen=True)
class Motion:
    """Poses of receivers, a frame a cycle.

    position_mm, quaternion : (T, S, 3) and (T, S, 4), NaN where the recording has no pose. loop : begin
    again after the last frame; otherwise no receiver has a pose from there on. notes : what of the file
    cannot be played, a sentence each.
    """

    stations: tuple[int, ...]
    position_mm: Array
    quaternion: Array
    loop: bool = False
    notes: tuple[str, ...] = ()

    def poses(self, count: Wholes, stations: Sequence[int]) -> tuple[Array, Array]:
        """Return positions in mm (T, S, 3) and quaternions (T, S, 4) of cycles numbered from 0, shape (T,).

        Both are NaN where there is no pose.
        """
        position = np.full((len(count), len(stations), 3), np.nan)
        quaternion = np.full((len(count), len(stations), 4), np.nan)
        rows = count % len(self.position_mm) if self.loop else count
        inside = (rows >= 0) & (rows < len(self.position_mm))
        for target, station in enumerate(stations):
            if station in self.stations:
                column = self.stations.index(station)
                position[inside, target] = self.position_mm[rows[inside], column]
                quaternion[inside, target] = self.quaternion[rows[inside], column]
        return position, quaternion


def built_in_motion() -> Motion:
    """Return sixteen receivers that sway and bend smoothly, 0.15-0.45 m before the transmitter, in a loop."""
    phase = 2 * np.pi * np.arange(PERIOD_CYCLES)[:, None] / PERIOD_CYCLES
    index = np.arange(MAX_STATION)
    finger, bone = index // 4, index % 4
    bend = np.sin(phase + 0.4 * finger) * (0.35 + 0.15 * bone)  # farther out it bends more
    x = 250 + 30 * bone + 40 * np.sin(phase)
    y = -45 + 30 * finger + 15 * np.cos(phase)
    position = np.stack([x, y, -120 + 25 * bend + 20 * np.sin(2 * phase)], -1)
    about_y = rotations.about_axis(np.array([0.0, 1.0, 0.0]), bend)
    about_z = rotations.about_axis(np.array([0.0, 0.0, 1.0]), 0.5 * np.cos(phase) + 0.1 * finger)
    return Motion(tuple(range(1, MAX_STATION + 1)), position, rotations.multiply(about_z, about_y), loop=True)


def recorded_motion(
    frame: Wholes,
    station: Wholes,
    position_mm: Array,
    quaternion: Array,
    *,
    loop: bool = False,
    notes: Sequence[str] = (),
) -> Motion:
    """Return the motion of N poses: frame, station (N,), position_mm (N, 3), quaternion (N, 4).

    A pose of station 0 is not played, but its frame counts. Frame numbers are divided by their usual step and
    counted from the first; numbers that are left out stay gaps.
    """
    numbers, rows = np.unique(frame, return_inverse=True)
    remark: list[str] = []
    if len(numbers) > 1:
        step = max(1, int(np.median(np.diff(numbers))))
        counted = np.rint((numbers - numbers[0]) / step).astype(np.int64)
        if counted[-1] >= 10 * len(numbers) or (np.diff(counted) == 0).any():
            remark = ["its frame numbers are no count; its frames are played one after the other"]
        else:
            rows = counted[rows]
    played = station > 0
    stations = sorted(set(station[played].tolist()))
    position = np.full((int(rows.max()) + 1, len(stations), 3), np.nan)
    turned = np.full((len(position), len(stations), 4), np.nan)
    columns = np.searchsorted(stations, station[played])
    position[rows[played], columns] = position_mm[played]
    turned[rows[played], columns] = quaternion[played]
    return Motion(tuple(stations), position, turned, loop, (*remark, *notes))
