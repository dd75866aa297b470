"""See what was done of a request: which joints moved, and how far."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from shukotsu.coach.estimate import Estimate
from shukotsu.coach.movements import Movement
from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.fitted_motion import pose_hand

POSED_HZ = 30.0
_TAILS = (2.0, 98.0)
"""Percentiles between which a range is taken: a single frame that is off is none."""

LARGE_DEG = 25.0
"""Another joint that moved so far moved on purpose."""


@dataclass
class Progress:
    """What joints did since a request began: angles in degrees, by (joint, kind)."""

    _angles: dict[tuple[str, str], list[Array]] = field(default_factory=dict)

    def add(self, known: Estimate, poses: Poses) -> None:
        """Pose frames with the hand as it is known, and keep its angles."""
        if not len(poses.frame):
            return
        posed = pose_hand(known.fit, poses)
        for column, key in enumerate(posed.angle_names):
            own = np.degrees(posed.angles_rad[posed.posed, column])
            self._angles.setdefault(key, []).append(own)

    def range_deg(self, key: tuple[str, str]) -> float:
        """Range of an angle; 0 where nothing is known of it."""
        parts = self._angles.get(key, [])
        values = np.concatenate(parts) if parts else np.zeros(0)
        if len(values) < 2:
            return 0.0
        low, high = np.percentile(values, _TAILS)
        return float(high - low)

    def is_done(self, movement: Movement) -> bool:
        """Say whether every joint moved as far as the movement asks."""
        return all(self.range_deg(key) >= wanted for key, wanted in movement.shown.items())

    def least(self, movement: Movement) -> tuple[str, float, float]:
        """Give the joint that lags most, the range that it moved through and the one asked for, deg."""
        key = min(movement.shown, key=lambda own: self.range_deg(own) / movement.shown[own])
        return key[0], self.range_deg(key), movement.shown[key]

    def instead(self, movement: Movement) -> str:
        """Name the joint that moved most instead of the movement's own; empty where none did."""
        _, moved, wanted = self.least(movement)
        others = {
            key[0]: self.range_deg(key)
            for key in self._angles
            if key[0] not in movement.joints and key[1] == "flexion"
        }
        most = max(others, key=lambda name: others[name], default="")
        return most if most and moved < wanted / 2 and others[most] > LARGE_DEG else ""
