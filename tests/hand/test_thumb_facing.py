"""Detecting whether a thumb metacarpal's receiver faces the nail or the back of the hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from shukotsu.hand.joint_angles import mirror_rotations
from shukotsu.hand.neutral_bones import faces_nail
from shukotsu.hand.rotations import Array, about_axis, conjugate, matrix, multiply, unit

SEEDS = st.integers(0, 2**32 - 1)
AT_NAIL = Rotation.from_euler("YZ", [5.0, -3.0], degrees=True).as_quat(scalar_first=True)
AT_HAND = multiply(about_axis(np.array([1.0, 0.0, 0.0]), -1.75), AT_NAIL)


def some(rng: np.random.Generator, n_frames: int, most_rad: float) -> Array:
    return about_axis(unit(rng.normal(size=(n_frames, 3))), most_rad * rng.random(n_frames))


def seen(seed: int, facing: Array) -> tuple[Array, Array]:
    """Return quaternions (30, 4) of the metacarpal's and phalanx's receivers on a right hand: random postures
    of the MCP joint, with both receivers mounted up to 12 deg off.
    """
    rng = np.random.default_rng(seed)
    angles_deg = rng.uniform([-30.0, -25.0, -12.0], [80.0, 25.0, 12.0], (30, 3))
    posture = Rotation.from_euler("YZX", angles_deg, degrees=True).as_quat(scalar_first=True)
    metacarpal = some(rng, 30, np.pi)
    on, under = (some(rng, 1, np.radians(12.0)) for _ in range(2))
    relative = multiply(multiply(multiply(on, facing), posture), under)
    return metacarpal, multiply(metacarpal, relative)


def decided(metacarpal: Array, phalanx: Array, at_nail: Array = AT_NAIL, at_hand: Array = AT_HAND) -> bool:
    relative = multiply(conjugate(metacarpal), phalanx)
    return faces_nail(matrix(relative), matrix(at_nail), matrix(at_hand))


@given(SEEDS, st.booleans())
def test_the_facing_is_found_with_roughly_mounted_receivers(seed: int, nail: bool) -> None:
    """The sign of quaternions, the transmitter's orientation and mirroring make no difference."""
    metacarpal, phalanx = seen(seed, AT_NAIL if nail else AT_HAND)
    elsewhere = some(np.random.default_rng(seed), 1, np.pi)
    assert decided(metacarpal, phalanx) == nail
    assert decided(multiply(elsewhere, metacarpal), -multiply(elsewhere, phalanx)) == nail
    left = [mirror_rotations(quaternion) for quaternion in (metacarpal, phalanx, AT_NAIL, AT_HAND)]
    assert decided(*left) == nail


@pytest.mark.parametrize(
    ("twist_deg", "nail"),
    [(0, True), (-45, True), (-60, False), (-100, False), (-179, False), (179, False), (60, True)],
)
def test_the_nearer_facing_about_the_bone_is_chosen(twist_deg: float, nail: bool) -> None:
    """The facings are at 0 and -100 deg; the limits between them are at -50 and 130 deg."""
    about_x = [about_axis(np.array([1.0, 0.0, 0.0]), np.radians(a)) for a in (twist_deg, 0.0, -100.0)]
    relative, at_nail, at_hand = matrix(np.stack(about_x))
    assert faces_nail(relative[None], at_nail, at_hand) == nail


@given(SEEDS)
def test_a_minority_of_wrong_readings_is_ignored(seed: int) -> None:
    metacarpal, phalanx = seen(seed, AT_NAIL)
    phalanx[:10] = some(np.random.default_rng(seed), 10, np.pi)
    assert decided(metacarpal, phalanx)
