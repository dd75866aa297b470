"""The skin: how far it moves a receiver, what moves it, and when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from shukotsu.hand.drawn_hands import SLIDE_SD_MM, TILT_SD
from shukotsu.hand.rotations import Array
from shukotsu.simulate import random_hand
from shukotsu.simulate.moving_skin import Skin, saturating, skin_of
from shukotsu.simulate.random_hand import BONES, FLEXION, JOINTS

hand_of = cache(random_hand.hand_of)
SEGMENTS = ("hand", "thumb_metacarpal", "index_proximal", "middle_proximal", "middle_middle", "middle_distal")


def many_receivers(count: int = 100) -> Skin:
    """Of the index's middle phalanx, with nothing but its own joint."""
    joint = np.full((count, 2), JOINTS.index("index_pip"))
    present = np.tile([True, False], (count, 1))
    return Skin(np.full(count, BONES.index("index_middle")), joint, present, np.ones(count), 1.0, 0.2, 0.3)


def bent(joint: str, flexion_rad: Sequence[float] | Array) -> Array:
    """Joint angles (T, J, 3) with that joint bent, all others straight."""
    angles = np.zeros((len(flexion_rad), len(JOINTS), 3))
    angles[:, JOINTS.index(joint), FLEXION] = flexion_rad
    return angles


def moved(angles: Array, skin: Skin) -> Array:
    """Slide and turn without the wander of the recording."""
    bent, still = (
        np.array(saturating(turned, skin, np.random.default_rng(0), np.random.default_rng(1)))
        for turned in (angles, np.zeros_like(angles))
    )
    return np.asarray(bent - still)


def test_skin_saturates_beyond_a_radian_and_is_moved_by_its_own_joints_alone() -> None:
    """Of the size that its numbers say at one radian."""
    share = 0.9 * math.tanh(1 / 0.9)
    slow = np.concatenate(
        [np.linspace(0.0, 1.0, 600), np.ones(300), np.linspace(1.0, 2.0, 600), np.full(300, 2.0)]
    )
    slide, turn = moved(bent("index_pip", slow), many_receivers(300))
    np.testing.assert_allclose(slide[899].std(0), share * np.array(SLIDE_SD_MM), rtol=0.15)
    np.testing.assert_allclose(turn[899].std(0), share * np.array(TILT_SD), rtol=0.15)
    assert slide[-1].std() < 1.4 * slide[899].std()
    worn = skin_of("01", "right", 3, SEGMENTS, 1.0)
    slide, _ = moved(bent("index_mcp", np.linspace(0.0, 1.0, 240)), worn)
    far = dict(zip(SEGMENTS, np.abs(slide).max((0, 2)), strict=True))
    assert {segment for segment, mm in far.items() if mm > 1e-3} == {"index_proximal"}
