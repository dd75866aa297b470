"""Joint angles against Grood and Suntay's definition, scipy's Euler angles and named postures."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from simulated_poses import recorded

from shukotsu.hand.average_hand import DIGITS
from shukotsu.hand.joint_angles import joint_angles, joint_rotation, mirror_rotations
from shukotsu.hand.rotations import Array, conjugate, from_matrix, matrix, multiply, rotate
from shukotsu.simulate.random_hand import JOINTS, PARENT

SEEDS = st.integers(0, 2**32 - 1)
HANDS = st.sampled_from(["right", "left"])
SIDES = pytest.mark.parametrize("hand", ["right", "left"])
STRAIGHT = np.array([1.0, 0.0, 0.0, 0.0])
DISTAL, LATERAL, DORSAL = np.eye(3)
RADIAL = {"right": LATERAL, "left": -LATERAL}


def some(seed: int, n: int = 20) -> Array:
    return Rotation.random(n, random_state=np.random.default_rng(seed)).as_quat(scalar_first=True)


def some_angles(seed: int) -> Array:
    """Return angles (20, 3) in deg of poses away from the singularity."""
    limit = np.array([179.9, 80.0, 179.9])
    return np.random.default_rng(seed).uniform(-limit, limit, (20, 3))


def turned_by(angles: Any, hand: str, rest: Array = STRAIGHT) -> Array:
    """Return, with scipy, the child-to-parent quaternions of angles (..., 3): turns about y, z, x of our
    frames.
    """
    sign = -1.0 if hand == "right" else 1.0
    turn = Rotation.from_euler("YZX", np.array(angles) * [1.0, sign, sign], degrees=True)
    return multiply(rest, turn.as_quat(scalar_first=True))


def same_rotation(first: Array, other: Array, atol: float = 1e-9) -> None:
    np.testing.assert_allclose(matrix(first), matrix(other), atol=atol)


@given(SEEDS, HANDS)
def test_angles_equal_those_of_grood_and_suntay(seed: int, hand: str) -> None:
    """Each angle is computed between directions; the floating axis e2 is perpendicular to e1 and e3."""
    parent, child = matrix(some(seed)), matrix(some(seed + 1))
    e1, e3 = parent[..., 1], child[..., 0]
    e2 = np.cross(e3, e1)
    e2 /= np.linalg.norm(e2, axis=-1, keepdims=True)  # dorsal for both bones of a straight digit

    def from_to(first: Array, second: Array, about: Array) -> Array:
        sine = np.einsum("ti,ti->t", np.cross(first, second), about)
        return np.degrees(np.arctan2(sine, np.einsum("ti,ti->t", first, second)))

    flexion = from_to(parent[..., 2], e2, e1)
    radial = np.degrees(np.arcsin(np.einsum("ti,ti->t", e3, e1)))
    supination = from_to(e2, child[..., 2], e3)
    sign = -1.0 if hand == "right" else 1.0
    got = joint_angles(from_matrix(parent), from_matrix(child), hand)
    np.testing.assert_allclose(got, np.stack([flexion, sign * radial, sign * supination], -1), atol=1e-6)


@given(SEEDS, HANDS, st.booleans())
def test_a_rotation_composed_from_angles_has_these_angles(seed: int, hand: str, with_rest: bool) -> None:
    parent, angles = some(seed), some_angles(seed)
    rest, axes = some(seed + 1, 2) if with_rest else (STRAIGHT, STRAIGHT)
    turn = multiply(turned_by(angles, hand, multiply(rest, axes)), conjugate(axes))
    same_rotation(joint_rotation(angles, hand, rest, axes), turn)
    child = multiply(parent, turn)
    np.testing.assert_allclose(joint_angles(parent, child, hand, rest, axes), angles, atol=1e-8)


@given(SEEDS)
def test_mirrored_movements_have_the_same_angles(seed: int) -> None:
    """A right hand's bones reflected in any plane, with x distal and z dorsal, are a left hand's."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    mirror = np.eye(3) - 2 * np.outer(normal, normal) / (normal @ normal)
    lateral_back = np.diag([1.0, -1.0, 1.0])
    parent, child, rest = some(seed), some(seed + 1), some(seed + 2, 1)[0]
    left = [from_matrix(mirror @ matrix(bone) @ lateral_back) for bone in (parent, child)]
    expected = joint_angles(parent, child, "right", rest)
    np.testing.assert_allclose(joint_angles(*left, "left", mirror_rotations(rest)), expected, atol=1e-6)
    same_rotation(turned_by(expected, "left"), mirror_rotations(turned_by(expected, "right")))


@SIDES
@pytest.mark.parametrize(
    ("angles", "part", "expected"),
    [
        ((90.0, 0.0, 0.0), "distal", {"dorsal": -1.0}),  # bent to the palm
        ((-30.0, 0.0, 0.0), "distal", {"distal": np.sqrt(0.75), "dorsal": 0.5}),  # extended
        ((0.0, -90.0, 0.0), "distal", {"radial": 1.0}),  # towards the thumb
        ((0.0, 90.0, 0.0), "distal", {"radial": -1.0}),  # towards the little finger
        ((0.0, 0.0, 90.0), "radial", {"dorsal": -1.0}),  # pronated: the radial edge goes to the palm
        ((0.0, 0.0, 90.0), "dorsal", {"radial": 1.0}),
    ],
)
def test_signs_of_named_postures(
    hand: str, angles: tuple[float, ...], part: str, expected: dict[str, float]
) -> None:
    """At the given angles a direction of the bone points as expected in the parent's frame."""
    directions = {"distal": DISTAL, "dorsal": DORSAL, "radial": RADIAL[hand]}
    child = turned_by(angles, hand)
    points_to = sum(much * directions[name] for name, much in expected.items())
    np.testing.assert_allclose(rotate(child, directions[part]), points_to, atol=1e-12)
    if abs(angles[1]) < 90:
        np.testing.assert_allclose(joint_angles(STRAIGHT, child, hand), angles, atol=1e-9)


@SIDES
def test_a_resting_thumb_has_zero_angles_and_moves_in_its_own_planes(hand: str) -> None:
    """Flexion sweeps along the palm and palmar abduction leaves it, although the metacarpal, which faces as
    its phalanx does, is turned almost across the hand.
    """
    _, proximal, _ = DIGITS["thumb"].frames()
    x = DIGITS["thumb"].frames()[0, :, 0]
    y = proximal[:, 1] - (proximal[:, 1] @ x) * x
    y /= np.linalg.norm(y)
    right = from_matrix(np.stack([x, y, np.cross(x, y)], -1))
    rest = right if hand == "right" else mirror_rotations(right)
    np.testing.assert_allclose(joint_angles(STRAIGHT, rest, hand, rest), np.zeros(3), atol=1e-9)
    start = rotate(rest, DISTAL)
    towards = {
        name: rotate(turned_by(angles, hand, rest), DISTAL) - start
        for name, angles in {"flexed": (20.0, 0.0, 0.0), "abducted": (0.0, -20.0, 0.0)}.items()
    }
    assert towards["flexed"] @ -RADIAL[hand] > 0.25
    assert abs(towards["flexed"] @ DORSAL) < 0.1
    assert towards["abducted"] @ -DORSAL > 0.25


@SIDES
def test_angles_of_a_simulated_hand_equal_the_simulated_ones(hand: str) -> None:
    """They agree within the effect of the simulator's tilted axes; its radial deviation and supination are
    positive. The skew axes of the thumb's CMC joint are not comparable.
    """
    truth = recorded(hand, seed=3, n_frames=60)[0].truth
    bones, got = truth.bone_quaternion, {}
    for joint in set(JOINTS) - {"wrist", "thumb_cmc", "index_cmc", "middle_cmc"}:
        index = JOINTS.index(joint)
        ends = bones[:, PARENT[index]], bones[:, index + 1]
        got[joint] = joint_angles(*ends, hand, truth.hand.rest[index])
        bent = np.degrees(truth.angles_rad[:, index]) * [1.0, -1.0, -1.0]
        across = rotate(conjugate(truth.hand.rest[index]), truth.hand.axes[index, 0])
        tilt_deg = np.degrees(np.arccos(across[1]))
        np.testing.assert_allclose(got[joint][:, 0], bent[:, 0], atol=4.0, err_msg=joint)
        np.testing.assert_allclose(got[joint][:, 1:], bent[:, 1:], atol=1.5 * tilt_deg + 1, err_msg=joint)
    for joint in ("index_mcp", "little_mcp"):
        bent = -np.degrees(truth.angles_rad[:, JOINTS.index(joint), 1])
        assert np.ptp(bent) > 20.0
        assert np.corrcoef(got[joint][:, 1], bent)[0, 1] > 0.85
