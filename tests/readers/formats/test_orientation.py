"""Converting orientations to quaternions: conventions, missing numbers and invalid matrices."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from shukotsu.errors import InputError
from shukotsu.hand.rotations import angle, conjugate, from_matrix, matrix, multiply, unit
from shukotsu.readers.formats.mapped import proper_rotations, quaternions

FORWARD = "receiver-to-transmitter"
BACK = "transmitter-to-receiver"


def locate(row: int) -> str:
    return f"rom.csv: line {row + 1}"


def translated(kind: str, rotates: str = FORWARD, **keys: str) -> dict[str, Any]:
    return {"kind": kind, "rotates": rotates, **keys}


def rotation(quaternion: np.ndarray) -> Rotation:
    return Rotation.from_quat(quaternion, scalar_first=True)


def same(first: np.ndarray, second: np.ndarray) -> None:
    assert angle(multiply(conjugate(first), second)).max() < 1e-7


def test_a_trakstars_angles_and_matrices_are_inverse_rotations() -> None:
    """The matrix is written out as in the Flock of Birds guide."""
    angles = np.array([[30.0, -20.0, 50.0], [-170.0, 80.0, 5.0]])
    (ca, ce, cr), (sa, se, sr) = np.cos(np.radians(angles)).T, np.sin(np.radians(angles)).T
    guide = [ce * ca, ce * sa, -se, sr * se * ca - cr * sa, cr * ca + sr * se * sa, sr * ce]
    guide += [sr * sa + cr * se * ca, cr * se * sa - sr * ca, cr * ce]
    same(
        quaternions(np.stack(guide, axis=-1), translated("matrix", BACK), locate),
        quaternions(angles, translated("euler", FORWARD, axes="ZYX", unit="deg"), locate),
    )


@pytest.mark.parametrize(
    ("kind", "keys", "numbers_of"),
    [
        ("quaternion", {"order": "wxyz"}, lambda q: q),
        ("quaternion", {"order": "xyzw"}, lambda q: q[:, [1, 2, 3, 0]]),
        ("matrix", {}, lambda q: matrix(q).reshape(-1, 9)),
        ("rotation-vector", {"unit": "deg"}, lambda q: rotation(q).as_rotvec(True)),
        ("rotation-vector", {"unit": "rad"}, lambda q: rotation(q).as_rotvec()),
        *(
            ("euler", {"axes": axes, "unit": "rad"}, lambda q, axes=axes: rotation(q).as_euler(axes))
            for axes in ("ZYX", "XYZ", "ZXZ", "YXZ")
        ),
    ],
)
def test_every_kind_of_orientation_is_converted_exactly(
    kind: str, keys: dict[str, str], numbers_of: Callable[[np.ndarray], np.ndarray]
) -> None:
    q = unit(np.random.default_rng(6).normal(size=(200, 4)))
    same(quaternions(numbers_of(q), translated(kind, FORWARD, **keys), locate), q)
    same(quaternions(numbers_of(conjugate(q)), translated(kind, BACK, **keys), locate), q)


def test_a_missing_number_stays_missing_and_an_infinite_one_infinite() -> None:
    angles = np.array([[1, np.nan, 2], [np.nan] * 3, [1, np.inf, 2], [1, 2, 3]])
    for kind, keys in (("euler", {"axes": "ZYX"}), ("rotation-vector", {})):
        turned = quaternions(angles, translated(kind, unit="deg", **keys), locate)
        assert np.isnan(turned[:2]).all()
        assert np.isinf(turned[2]).any()
        assert np.isfinite(turned[3]).all()
    nine = np.stack([np.full(9, np.nan), np.eye(3).ravel()])
    turned = quaternions(nine, translated("matrix"), locate)
    assert np.isnan(turned[0]).all()
    np.testing.assert_array_equal(turned[1], [1, 0, 0, 0])
    some = np.array([[1.0, 0, np.nan, 0]])
    np.testing.assert_array_equal(
        quaternions(some, translated("quaternion", order="xyzw"), locate), [[0, 1, 0, np.nan]]
    )


def test_a_rounded_matrix_gives_the_nearest_rotation() -> None:
    rng = np.random.default_rng(5)
    q = unit(rng.normal(size=(50, 4)))
    turned = proper_rotations(np.round(matrix(q), 3), locate)
    np.testing.assert_allclose(np.swapaxes(turned, 1, 2) @ turned, np.tile(np.eye(3), (50, 1, 1)), atol=1e-12)
    assert angle(multiply(conjugate(q), from_matrix(turned))).max() < 2e-3


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (np.diag([1.0, 1, -1]), "rotation is mirrored (determinant -1)"),
        (np.zeros((3, 3)), "rotation is all zeros; zeros that stand for missing values must be written as"),
        (1.02 * np.eye(3), "matrix is not a rotation: its columns are off unit length and right angles by"),
        (np.diag([30.0, -20, 50]), "matrix is not a rotation"),
    ],
)
def test_an_invalid_matrix_is_refused_with_its_line(bad: np.ndarray, message: str) -> None:
    three = np.stack([np.eye(3), np.full((3, 3), np.nan), bad])
    with pytest.raises(InputError, match=re.escape(f"rom.csv: line 3: the {message}")):
        proper_rotations(three, locate)
