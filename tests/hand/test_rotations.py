"""Rotations against scipy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from jaxtyping import TypeCheckError
from scipy.spatial.transform import Rotation

from shukotsu.hand import rotations

SEEDS = st.integers(0, 2**32 - 1)


def some(seed: int, n: int = 20) -> Rotation:
    return Rotation.random(n, random_state=np.random.default_rng(seed))


@given(SEEDS)
def test_quaternions_and_matrices_are_the_same_rotations(seed: int) -> None:
    """Matrices equal scipy's, and their quaternions are the same rotations with w >= 0."""
    turn = some(seed)
    q = turn.as_quat(scalar_first=True)
    np.testing.assert_allclose(rotations.matrix(q), turn.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(rotations.matrix(-q), turn.as_matrix(), atol=1e-14)
    back = rotations.from_matrix(turn.as_matrix())
    assert (back[:, 0] >= 0).all()
    np.testing.assert_allclose(np.abs(np.sum(back * q, -1)), 1, atol=1e-12)


@pytest.mark.parametrize("axis", np.eye(3))
def test_half_turns_have_quaternions(axis: np.ndarray) -> None:
    """The matrix of a half turn has trace -1, where the textbook formula divides by zero."""
    q = rotations.from_matrix(Rotation.from_rotvec(np.pi * axis).as_matrix())
    np.testing.assert_allclose(np.abs(q), [0, *axis], atol=1e-15)


@given(SEEDS, SEEDS)
def test_product_rotates_second_first(first: int, second: int) -> None:
    a, b = some(first), some(second)
    p, q = (turn.as_quat(scalar_first=True) for turn in (a, b))
    vectors = np.random.default_rng(first).normal(size=(20, 3))
    both, back = rotations.multiply(p, q), rotations.conjugate(p)
    np.testing.assert_allclose(rotations.rotate(both, vectors), (a * b).apply(vectors), atol=1e-12)
    np.testing.assert_allclose(rotations.rotate(back, vectors), a.inv().apply(vectors), atol=1e-12)


@given(SEEDS, arrays(float, 20, elements=st.floats(-3.1, 3.1)))
def test_about_axis_turns_by_the_right_hand_rule(seed: int, angle: np.ndarray) -> None:
    """The result equals scipy's for the rotation vector, and has the same angle."""
    axis = rotations.unit(np.random.default_rng(seed).normal(size=(20, 3)))
    q = rotations.about_axis(axis, angle)
    expected = Rotation.from_rotvec(axis * angle[:, None]).as_matrix()
    np.testing.assert_allclose(rotations.matrix(q), expected, atol=1e-14)
    np.testing.assert_allclose(rotations.angle(q), np.abs(angle), atol=1e-12)


@given(SEEDS)
def test_nearest_rotation_undoes_a_small_stretch(seed: int) -> None:
    """The nearest rotation to a rotation times a symmetric stretch is that rotation; it is never a
    reflection.
    """
    turn = some(seed).as_matrix()
    stretch = np.eye(3) + 0.1 * np.diag(np.random.default_rng(seed).uniform(-1, 1, 3))
    np.testing.assert_allclose(rotations.nearest_rotation(turn @ stretch), turn, atol=1e-12)
    assert np.linalg.det(rotations.nearest_rotation(-np.eye(3)[None])).item() == pytest.approx(1)


def test_bone_frame_is_x_distal_z_dorsal() -> None:
    frame = rotations.bone_frame(np.array([10.0, 0, 0]), np.array([1.0, 0.5, 2.0]))
    np.testing.assert_allclose(frame[:, 0], [1, 0, 0])
    assert np.linalg.det(frame) == pytest.approx(1)
    assert frame[:, 2] @ [1, 0.5, 2] > 0


@given(SEEDS)
def test_the_mean_of_symmetric_rotations_is_their_centre(seed: int) -> None:
    """Opposite turns from a rotation, with random signs of the quaternions, have it as their mean."""
    rng = np.random.default_rng(seed)
    middle = some(seed, 1).as_quat(scalar_first=True)[0]
    small = rng.normal(size=(30, 3)) * 0.1
    sides = Rotation.from_rotvec(np.concatenate([small, -small])).as_quat(scalar_first=True)
    turns = rotations.multiply(middle, sides) * rng.choice([-1.0, 1.0], 60)[:, None]
    mean = rotations.mean_rotation(turns)
    assert mean[0] >= 0
    assert rotations.angle(rotations.multiply(rotations.conjugate(middle), mean)) < 1e-7
    np.testing.assert_array_equal(rotations.mean_rotation(turns[:0]), [1, 0, 0, 0])


@pytest.mark.parametrize("quaternions", [np.zeros((2, 3)), np.zeros(4, int)])
def test_arrays_of_the_wrong_shape_or_type_fail_in_tests(quaternions: np.ndarray) -> None:
    with pytest.raises(TypeCheckError, match="quaternion"):
        rotations.matrix(quaternions)
