"""The simulated hand's anatomy and motion."""

from functools import cache

import numpy as np
import pytest

from shukotsu.hand import rotations
from shukotsu.hand.drawn_hands import ANATOMIES, SOURCES
from shukotsu.simulate import random_hand
from shukotsu.simulate.forward import poses_in_hand
from shukotsu.simulate.random_hand import BONES, DIGITS, JOINTS, TIP_BONES
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import Simulated, simulate
from shukotsu.tables.poses import RecordingName

hand_of = cache(random_hand.hand_of)


def pad_distances_mm(simulated: Simulated) -> np.ndarray:
    """Return the distances (T, 4) in mm of the thumb's pad to each finger's."""
    truth = simulated.truth
    quaternion = truth.bone_quaternion[:, TIP_BONES]
    pads = truth.bone_position_mm[:, TIP_BONES] + rotations.rotate(quaternion, truth.hand.pad_mm)
    return np.linalg.norm(pads[:, 1:] - pads[:, :1], axis=-1)


@pytest.mark.slow
@pytest.mark.parametrize("anatomy", ANATOMIES)
def test_simulated_people_vary_about_their_anatomical_source(anatomy: str) -> None:
    """Mean lengths over 35 people are those of their source, or within the range of all sources; sds are 5 to
    14 %.
    """
    realism = Realism(anatomy=anatomy)
    lengths = np.array([hand_of(f"{i:02d}", "right", 3, realism).length_mm for i in range(35)])
    hands = [SOURCES[anatomy]] if anatomy in SOURCES else SOURCES.values()
    for digit in DIGITS:
        bones = [b for b, bone in enumerate(BONES) if bone.startswith(f"{digit}_")]
        means = np.array([hand[digit].lengths_mm for hand in hands])
        off = lengths[:, bones].mean(0)
        assert (off > 0.96 * means.min(0)).all()
        assert (off < 1.04 * means.max(0)).all()
        spread = lengths[:, bones].std(0) / off
        assert spread.min() > 0.05
        assert spread.max() < 0.14


def test_the_left_hand_is_the_mirror_image_of_the_right() -> None:
    angles = 0.3 * np.random.default_rng(0).standard_normal((20, len(JOINTS), 3))
    right, left = (hand_of("01", side, 3, Realism()) for side in ("right", "left"))
    right_mm, right_turn = poses_in_hand(right, angles)
    left_mm, left_turn = poses_in_hand(left, angles)
    mirror = np.array([1.0, -1.0, 1.0])
    assert np.abs(left_mm - right_mm * mirror).max() < 1.0  # 0.5 % of the hand
    mirrored = np.diag(mirror) @ rotations.matrix(right_turn) @ np.diag(mirror)
    np.testing.assert_allclose(rotations.matrix(left_turn), mirrored, atol=1e-12)


@pytest.mark.parametrize(("subject", "side"), [("01", "right"), ("02", "left"), ("03", "right")])
def test_in_opposition_the_thumb_meets_each_finger_in_turn(subject: str, side: str) -> None:
    apart_mm = pad_distances_mm(
        simulate(RecordingName(subject, side, "opposition"), 20090601, Realism(), 960)
    )
    assert apart_mm.min(0).max() < 10
    assert (apart_mm.max(0) > 30).all()
    assert (np.diff(apart_mm.argmin(0)) > 0).all()
