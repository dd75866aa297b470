"""The skin: how far it moves a receiver, what moves it, and when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from shukotsu.hand.drawn_hands import SLIDE_SD_MM, TILT_SD, WANDER_MM
from shukotsu.hand.rotations import Array, conjugate, rotate
from shukotsu.simulate import random_hand
from shukotsu.simulate.forward import relaxed_angles
from shukotsu.simulate.moving_skin import Skin, saturating, skin_of
from shukotsu.simulate.random_hand import BONES, FINGERS, FLEXION, JOINTS
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import simulate

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


def test_on_the_relaxed_hand_receivers_are_where_they_were_put() -> None:
    """But for their wander: off by as much as that along the bones, and by far more on straight fingers."""
    realism = replace(Realism.full(), noise=0.0, field_distortion=0.0)
    spread = {}
    for posture, people in (("relaxed", 20), ("straight", 4)):
        along = []
        for i in range(people):
            own = relaxed_angles(hand_of(f"{i:02d}", "right", 3, Realism()), realism)
            still = np.tile(own if posture == "relaxed" else np.zeros_like(own), (2, 1, 1))
            change = partial(lambda at, motion: replace(motion, angles_rad=at), still)
            made = simulate(f"{i:02d}", "right", "rom", 3, realism, 2, change=change)
            truth, middles = made.truth, [made.segments.index(f"{digit}_middle") for digit in FINGERS[:3]]
            put = truth.mounts.poses(truth.bone_position_mm, truth.bone_quaternion)
            off = rotate(conjugate(put[1]), made.position_mm - put[0])[0, middles]
            along.append(off[:, 0])
        spread[posture] = np.std(along)
    assert spread["relaxed"] == pytest.approx(WANDER_MM, rel=0.25)
    assert spread["straight"] > 1.5 * WANDER_MM
