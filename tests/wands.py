"""Bars that are moved about in a room with steel on one side, for the tests of wands."""

from __future__ import annotations

import numpy as np

from benchmarks.wand import recorded_bar
from shukotsu.checks.rigid_bar import Bar
from shukotsu.skeleton.rotations import Array, about_axis, multiply
from shukotsu.stages.fit_hand.field_test import Field

BOX_MM = np.array([[200.0, -120.0, -80.0], [440.0, 120.0, 80.0]])
STEEL = Field(np.array([540.0, 0.0, 0.0]), np.array([440.0, 0.0, 0.0]), np.array([6.0, 4.0, 4.0, 0, 0, 0]))
TURN_DEG = 5.0


def with_steel(place: Array, turn: Array) -> tuple[Array, Array]:
    """What the tracker says there."""
    off = about_axis(np.array([0.0, 0.0, 1.0]), np.radians(TURN_DEG) * STEEL.share(place))
    return place + STEEL.at(place)[..., :3], multiply(off, turn)


def bar(*, steel: bool = False) -> Bar:
    """A minute of it."""
    return recorded_bar(with_steel if steel else lambda *own: own, BOX_MM, np.random.default_rng(3))
