"""The room's field, which turns receivers: alike everywhere and growing with place, as unknowns of the fit.

Metal near a magnetic tracker bends its field. Over the volume of a hand that is smooth: a turn that all
receivers have in common and one that grows linearly with place, both static in the transmitter's frame. As
the hand turns in the room they show, since joints hold bones together and a field does not know of joints.
Left out they are taken for anatomy: a degree is a millimetre at the knuckles, seen from the back of the hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.fit.chain_builder import Unknowns
from shukotsu.fit.operations import Index
from shukotsu.hand import average_hand as prior
from shukotsu.hand.rotations import Array, exp_rotation

_FAR, _TIMES_WITHOUT_FAR = 2.5, 4
"""Times the median distance from the middle beyond which a place is none of the hand's: a flip, a spike."""


@dataclass(frozen=True)
class RoomField:
    """The unknowns (12,) of a room's field: a turn about three axes, and how it grows along three more each.

    centre_mm : (3,) where the turn is that which all have in common; reach_mm : how far from there it grows,
    which is where receivers were.
    """

    unknowns: Index
    centre_mm: Array
    reach_mm: float

    @classmethod
    def among(cls, unknowns: Unknowns, places_mm: Array) -> RoomField:
        """Add the field's unknowns to a hand's; places_mm : (N, 3) where receivers were."""
        turns = [unknowns.add("field turn", axis) for axis in "xyz"]
        slopes = [unknowns.add("field slope", f"{axis} by {along}") for axis in "xyz" for along in "xyz"]
        near = places_mm
        for _ in range(_TIMES_WITHOUT_FAR):  # without those that a tracker put elsewhere
            off_mm = np.linalg.norm(places_mm - near.mean(0), axis=1)
            near = places_mm[off_mm <= _FAR * np.median(off_mm)]
        reach_mm = float(np.linalg.norm(near - near.mean(0), axis=1).max())
        return cls(np.array(turns + slopes), near.mean(0), reach_mm)

    def by_unknown(self, position_mm: Array) -> Array:
        """Derivative (..., 3, 12) of the turn, a rotation vector in the transmitter's frame, at places."""
        out = np.zeros((*position_mm.shape[:-1], 3, len(self.unknowns)))
        off_mm = position_mm - self.centre_mm
        far = np.linalg.norm(off_mm, axis=-1, keepdims=True) / max(self.reach_mm, 1.0)
        slope = prior.FIELD_SLOPE_SD_RAD_PER_MM * off_mm / np.maximum(far, 1.0)
        for axis in range(3):
            out[..., axis, axis] = prior.FIELD_TURN_SD_RAD
            out[..., axis, 3 + 3 * axis : 6 + 3 * axis] = slope
        return out

    def turn(self, position_mm: Array, x: Array) -> Array:
        """Return the field's rotations (..., 3, 3) of what is measured at places (..., 3); x : (G,)."""
        return exp_rotation(self.by_unknown(position_mm) @ x[self.unknowns])

    def undone(self, rotation: Array, position_mm: Array, x: Array) -> Array:
        """Rotations (..., 3, 3) of receivers as they would be measured without the field; x : (G,)."""
        return np.asarray(self.turn(position_mm, x).swapaxes(-1, -2) @ rotation)
