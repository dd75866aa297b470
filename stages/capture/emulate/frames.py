"""Reference frames that a client may set: mounting, alignment, boresight, tip offset; and the hemisphere.

Sources: LIBERTY User Manual URM03PH156, commands A, B, G, H, N; FASTRAK User Manual, the same letters.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from kinematics import rotations

Array = npt.NDArray[np.float64]

DEFAULT_ALIGNMENT = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
DEFAULT_HEMISPHERE = (1.0, 0.0, 0.0)
FOLLOWING = (0.0, 0.0, 0.0)
"""The hemisphere that stands for "keep track of the receiver": no position flips."""

_STRAIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def _straight() -> Array:
    return _STRAIGHT.copy()


@dataclass
class StationFrames:
    """The frames of one station.

    origin_mm (3,) and turn (4,) of the alignment in the transmitter's frame; boresight (4,) is put behind
    the orientation; tip_mm is in the receiver's frame.
    """

    origin_mm: Array = field(default_factory=lambda: np.zeros(3))
    turn: Array = field(default_factory=_straight)
    boresight: Array = field(default_factory=_straight)
    boresight_deg: tuple[float, ...] = (0.0, 0.0, 0.0)
    tip_mm: Array = field(default_factory=lambda: np.zeros(3))

    def align(self, points_mm: Array) -> bool:
        """Take the frame of an origin, a point on X and a point on Y, (3, 3), on top of the present one.

        Gives False, and changes nothing, where the three points span no frame.
        """
        x = rotations.unit(points_mm[1] - points_mm[0])
        z = rotations.unit(np.cross(x, points_mm[2] - points_mm[0]))
        if not (np.any(x) and np.any(z)):
            return False
        turn = rotations.from_matrix(np.stack([x, np.cross(z, x), z], -1))
        self.origin_mm = self.origin_mm + rotations.rotate(self.turn, points_mm[0])
        self.turn = rotations.multiply(self.turn, turn)
        return True

    def alignment_mm(self, unit_mm: float) -> Array:
        """Origin, a point on X and one on Y, each a unit away, (3, 3) in mm: what a query answers."""
        return self.origin_mm + unit_mm * np.stack([np.zeros(3), *rotations.rotate(self.turn, np.eye(3)[:2])])

    def reset_alignment(self) -> None:
        """Take the transmitter's frame again."""
        self.origin_mm, self.turn = np.zeros(3), _straight()

    def point(self, quaternion: Array, target_deg: tuple[float, ...], target: Array) -> None:
        """Let the station report `target` (4,) where it reports `quaternion` (4,) without a boresight."""
        self.boresight = rotations.multiply(rotations.conjugate(quaternion), target)
        self.boresight_deg = target_deg

    def reset_boresight(self) -> None:
        """Report the orientation as it is."""
        self.boresight, self.boresight_deg = _straight(), (0.0, 0.0, 0.0)

    def seen(self, position_mm: Array, quaternion: Array, mounting: Array) -> tuple[Array, Array]:
        """Positions (T, 3) and orientations (T, 4) in these frames, the transmitter mounted so (4,)."""
        if np.any(self.tip_mm):
            position_mm = position_mm + rotations.rotate(quaternion, self.tip_mm)
        turn = rotations.multiply(rotations.conjugate(self.turn), mounting)
        if np.any(self.origin_mm) or not np.array_equal(turn, _STRAIGHT):
            position_mm = rotations.rotate(mounting, position_mm) - self.origin_mm
            position_mm = rotations.rotate(rotations.conjugate(self.turn), position_mm)
            quaternion = rotations.multiply(turn, quaternion)
        if not np.array_equal(self.boresight, _STRAIGHT):
            quaternion = rotations.multiply(quaternion, self.boresight)
        return position_mm, quaternion


def side(position_mm: Array, hemisphere: tuple[float, ...]) -> Array:
    """1 where a receiver (T, 3) is taken to be where it is, -1 where it is reported at the other side."""
    if tuple(hemisphere) == FOLLOWING:
        return np.ones(len(position_mm))
    return np.where(position_mm @ np.array(hemisphere) < 0, -1.0, 1.0)


def smeared(side_now: Array, before: Array, share: float) -> Array:
    """Sides (T, S) behind a filter that takes in `share` of every new sample, from `before` (S,)."""
    if (side_now == before).all():
        return side_now
    out, last = np.empty_like(side_now), before
    for t, now in enumerate(side_now):
        last = last + share * (now - last)
        last = np.where(np.abs(now - last) < 1e-4, now, last)
        out[t] = last
    return out
