"""Where the receivers truly are, cycle by cycle: a motion computed from its number, or a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from kinematics import rotations
from schemas.errors import InputError
from schemas.layout import Layout

Array = npt.NDArray[np.float64]
Wholes = npt.NDArray[np.int64]

MAX_STATION = 16
PERIOD_CYCLES = 960
"""The built-in motion repeats after so many cycles: 4 s at 240 Hz."""

CROSSING_CYCLES = 1920
"""A hand that crosses the transmitter goes over and comes back in so many cycles: 8 s at 240 Hz."""

_CROSSING_BEYOND_MM = 100.0
_MAX_STRETCH = 10
"""Frame numbers that span more than so many times their count are no count, and are numbered anew."""


class PoseSource(Protocol):
    """Gives true poses; the same number gives the same pose, in whatever blocks it is asked."""

    def poses(self, count: Wholes, stations: Sequence[int]) -> tuple[Array, Array]:
        """Positions in mm (T, S, 3) and quaternions (T, S, 4) of cycles numbered from 0, shape (T,).

        Both are NaN where the source has no pose.
        """
        ...


class BuiltInMotion:
    """Sixteen receivers that sway and bend smoothly, 0.15-0.45 m in front of the transmitter."""

    cycles = PERIOD_CYCLES
    stations = tuple(range(1, MAX_STATION + 1))

    def __init__(self) -> None:
        phase = 2 * np.pi * np.arange(PERIOD_CYCLES)[:, None] / PERIOD_CYCLES
        index = np.arange(MAX_STATION)
        finger, bone = index // 4, index % 4
        bend = np.sin(phase + 0.4 * finger) * (0.35 + 0.15 * bone)  # farther out it bends more
        position = np.empty((PERIOD_CYCLES, MAX_STATION, 3))
        position[..., 0] = 250 + 30 * bone + 40 * np.sin(phase)
        position[..., 1] = -45 + 30 * finger + 15 * np.cos(phase)
        position[..., 2] = -120 + 25 * bend + 20 * np.sin(2 * phase)
        about_y = rotations.about_axis(np.array([0.0, 1.0, 0.0]), bend)
        about_z = rotations.about_axis(np.array([0.0, 0.0, 1.0]), 0.5 * np.cos(phase) + 0.1 * finger)
        self._position, self._quaternion = position, rotations.multiply(about_z, about_y)

    def poses(self, count: Wholes, stations: Sequence[int]) -> tuple[Array, Array]:
        """Give the motion at those cycles."""
        rows, columns = np.ix_(count % PERIOD_CYCLES, np.array(stations, np.int64) - 1)
        return self._position[rows, columns], self._quaternion[rows, columns]


@dataclass(frozen=True)
class RecordedMotion:
    """A recording played one frame a cycle.

    position_mm, quaternion : (T, S, 3) and (T, S, 4), NaN where the recording has no pose. loop : begin
    again after the last frame; otherwise no receiver has a pose from there on. notes : what of the file
    cannot be played, a sentence each.
    """

    stations: tuple[int, ...]
    position_mm: Array
    quaternion: Array
    loop: bool = False
    notes: tuple[str, ...] = ()

    @property
    def cycles(self) -> int:
        """Frames of the recording, those that it leaves out among them."""
        return len(self.position_mm)

    def poses(self, count: Wholes, stations: Sequence[int]) -> tuple[Array, Array]:
        """Give the recording's frames at those cycles."""
        position = np.full((len(count), len(stations), 3), np.nan)
        quaternion = np.full((len(count), len(stations), 4), np.nan)
        rows = count % self.cycles if self.loop else count
        inside = (rows >= 0) & (rows < self.cycles)
        for place, station in enumerate(stations):
            if station in self.stations:
                column = self.stations.index(station)
                position[inside, place] = self.position_mm[rows[inside], column]
                quaternion[inside, place] = self.quaternion[rows[inside], column]
        return position, quaternion


@dataclass(frozen=True)
class Crossing:
    """Another motion, carried so far against X that it passes the transmitter's plane X = 0, and back."""

    motion: BuiltInMotion | RecordedMotion
    reach_mm: float

    @property
    def cycles(self) -> int:
        """Length of the motion."""
        return self.motion.cycles

    @property
    def stations(self) -> tuple[int, ...]:
        """Stations that have a receiver in it."""
        return self.motion.stations

    def poses(self, count: Wholes, stations: Sequence[int]) -> tuple[Array, Array]:
        """Give the carried motion."""
        position, quaternion = self.motion.poses(count, stations)
        carried = self.reach_mm * (1 - np.cos(2 * np.pi * (count % CROSSING_CYCLES) / CROSSING_CYCLES)) / 2
        position[..., 0] -= carried[:, None]
        return position, quaternion


def crossing(motion: BuiltInMotion | RecordedMotion) -> Crossing:
    """Carry the motion so far that every receiver comes to the other side of X = 0."""
    x = motion.poses(np.arange(motion.cycles), motion.stations)[0][..., 0]
    x = x[np.isfinite(x)]
    if not len(x):
        return Crossing(motion, 0.0)
    farthest = float(x.max() if x.mean() >= 0 else x.min())
    return Crossing(motion, farthest + np.copysign(_CROSSING_BEYOND_MM, farthest))


def read_motion(path: Path, layout: Layout, *, loop: bool = False, last_station: int = 16) -> RecordedMotion:
    """Read a recording in any format that needs no mapping; each segment plays on its receiver's station.

    Frame numbers are divided by their usual step and counted from the first; numbers that are left out
    stay gaps. Segments whose receiver number is beyond `last_station` are left out and noted.
    Raises InputError where the file is no recording, or where none of its segments has a station.
    """
    from stages.capture.formats.readers import AUTO, find_reader
    from stages.capture.samples import ReadingOptions

    samples = find_reader(path, AUTO)(path, layout, ReadingOptions())
    receivers = [layout.segments[name].receiver or 0 for name in samples.segments]
    present = sorted(set(np.unique(samples.segment).tolist()), key=lambda index: receivers[index])
    playable = [index for index in present if 1 <= receivers[index] <= last_station]
    if not playable:
        raise InputError(
            f"{path}: none of its segments has a station from 1 to {last_station} in layout {layout.name}; "
            "give the layout's segments such `receiver:` numbers"
        )
    rows, notes = _numbered(samples.frame)
    position = np.full((int(rows.max()) + 1, len(playable), 3), np.nan)
    quaternion = np.full((len(position), len(playable), 4), np.nan)
    for column, index in enumerate(playable):
        mine = samples.segment == index
        position[rows[mine], column] = samples.numbers[mine, :3]
        quaternion[rows[mine], column] = samples.numbers[mine, 3:]
    for index in sorted(set(present) - set(playable)):
        notes += (f"segment {samples.segments[index]} has no station from 1 to {last_station}; not played",)
    return RecordedMotion(tuple(receivers[index] for index in playable), position, quaternion, loop, notes)


def _numbered(frame: Wholes) -> tuple[Wholes, tuple[str, ...]]:
    """Number frames from 0 in the recording's usual step, gaps kept where they are believable."""
    known, rows = np.unique(frame, return_inverse=True)
    if len(known) < 2:
        return rows, ()
    step = max(1, int(np.median(np.diff(known))))
    counted = np.rint((known - known[0]) / step).astype(np.int64)
    if counted[-1] >= _MAX_STRETCH * len(known) or len(np.unique(counted)) < len(known):
        return rows, ("its frame numbers are no count; its frames are played one after the other",)
    return counted[rows], ()
