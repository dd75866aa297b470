"""Hemisphere flips: a receiver that crosses the plane of its hemisphere is reported on the other side.

A magnetic tracker knows a position only up to its sign. It reports the one in the hemisphere it was told to
use, so a receiver that leaves it jumps from p to -p, its orientation unmoved; the tracker's position filter
smears the jump over some frames, through the transmitter's own origin, where no receiver can be.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from trackers.protocols.records import Array, Wholes

LONGEST_SMEAR = 12
"""Frames that a jump may take: the default filter takes 5 to 8."""
MIRRORED = 0.15
"""|p + p'| of two positions that are each other's mirror image, as a part of |p|: a hand moves meanwhile."""
SAME_DIRECTION_COS = np.cos(np.radians(20))
"""Half the rotation, as the scalar part of a quaternion, that an orientation turns during the jump."""
SETTLED = 0.02
"""A jump has begun or ended where the position is this near (as a part of |p|) to where it stays."""
AT_THE_PLANE = 0.05
"""Height over the hemisphere's plane just before, as a part of |p|; the filter may hide the lowest."""


@dataclass(frozen=True)
class Flip:
    """One jump of a station: the last frame before it, and the first that is wholly on the other side."""

    station: int
    before: int
    after: int


@dataclass
class FlipFinder:
    """Looks for the flips of one station, piece by piece; keeps the last frames of the piece before.

    hemisphere : the vector of its half of space; None where it is not known or the tracker follows the
    receiver, so that the height over the plane is not looked at.
    """

    station: int
    hemisphere: tuple[float, float, float] | None
    flips: list[Flip] = field(default_factory=list)
    _seen: int = 0  # rows at the start of what is kept that were looked at
    _frame: Wholes = field(default_factory=lambda: np.empty(0, np.int64))
    _position: Array = field(default_factory=lambda: np.empty((0, 3)))
    _quaternion: Array = field(default_factory=lambda: np.empty((0, 4)))

    def feed(self, frame: Wholes, position: Array, quaternion: Array, *, final: bool = False) -> None:
        """Look through the next N frames: frame (N,), position (N, 3) any unit, quaternion (N, 4) unit."""
        frame = np.concatenate([self._frame, frame])
        position = np.concatenate([self._position, position])
        quaternion = np.concatenate([self._quaternion, quaternion])
        end = len(frame) if final else max(self._seen, len(frame) - LONGEST_SMEAR)
        for row in _facing_away(position, self._seen, end):
            if not self.flips or frame[row] > self.flips[-1].after:
                self._judge(int(row), frame, position, quaternion)
        start = max(0, end - 2 * LONGEST_SMEAR)
        self._seen = end - start
        self._frame = frame[start:].copy()
        self._position = position[start:].copy()
        self._quaternion = quaternion[start:].copy()

    def _judge(self, row: int, frame: Wholes, position: Array, quaternion: Array) -> None:
        """Keep a flip if the position of the row is an earlier one's mirror image."""
        norm = float(np.linalg.norm(position[row]))
        earlier = np.arange(max(0, row - LONGEST_SMEAR), row)
        since = self.flips[-1].after if self.flips else frame[0]
        earlier = earlier[(frame[earlier] >= since) & (frame[row] - frame[earlier] <= 4 * LONGEST_SMEAR)]
        unturned = np.abs(quaternion[earlier] @ quaternion[row]) > SAME_DIRECTION_COS
        earlier = earlier[unturned]
        if not len(earlier):
            return
        apart = np.linalg.norm(position[earlier] + position[row], axis=1)
        if not apart.min() < MIRRORED * norm:
            return
        before = int(earlier[np.flatnonzero(apart <= apart.min() + SETTLED * norm)[-1]])
        later = np.arange(row, min(len(frame), row + LONGEST_SMEAR))
        apart = np.linalg.norm(position[later] + position[before], axis=1)
        after = int(later[np.flatnonzero(apart <= apart.min() + SETTLED * norm)[0]])
        if self._was_at_the_plane(position[before : after + 1]):
            self.flips.append(Flip(self.station, int(frame[before]), int(frame[after])))

    def _was_at_the_plane(self, positions: Array) -> bool:
        if self.hemisphere is None or not any(self.hemisphere):
            return True
        h = np.array(self.hemisphere) / np.linalg.norm(self.hemisphere)
        height = positions @ h / np.maximum(np.linalg.norm(positions, axis=1), 1e-9)
        return bool(height.min() < AT_THE_PLANE)


def _facing_away(position: Array, first: int, end: int) -> Wholes:
    """Rows first..end whose position points away from an earlier one's, as after a flip."""
    away = np.zeros(len(position), bool)
    for lag in (1, LONGEST_SMEAR // 2, LONGEST_SMEAR):
        if len(position) > lag:
            away[lag:] |= np.einsum("ij,ij->i", position[lag:], position[:-lag]) < 0
    return np.flatnonzero(away[first:end]) + first


def flip_states(flips: list[Flip], frame: Wholes) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Say of one station's frames, (N,), which lie within a jump and which on the other side.

    The first frames are taken to be on the right side. Both arrays are (N,).
    """
    before = np.array([flip.before for flip in flips], np.int64)
    after = np.array([flip.after for flip in flips], np.int64)
    begun = np.searchsorted(before, frame)  # flips whose last frame before lies before this one
    ended = np.searchsorted(after, frame, side="right")
    return np.asarray(begun > ended), np.asarray(ended % 2 == 1)
