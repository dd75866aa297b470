"""Eq. 8-11 against scipy's rotations and simulated palms with known metacarpals; the wrist point."""

import numpy as np
from chains import smooth
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from shukotsu.hand.rotations import Array, about_axis, angle, conjugate, multiply, rotate, unit
from shukotsu.paper.posture import Reference, estimate_posture, swing, twist
from shukotsu.paper.wrist import estimate_wrist

SEEDS = st.integers(0, 2**32 - 1)
X, Y, Z = np.eye(3)


@given(SEEDS)
def test_swing_rotates_one_vector_onto_the_other(seed: int) -> None:
    """Eq. 10 rotates v(1) onto v(k) about their common normal by the angle of Eq. 9."""
    rng = np.random.default_rng(seed)
    start, vectors = rng.normal(size=3), rng.normal(size=(10, 3))
    q, theta = swing(start, vectors)
    np.testing.assert_allclose(rotate(q, unit(start)), unit(vectors), atol=1e-12)
    np.testing.assert_allclose(theta, np.arccos(unit(vectors) @ unit(start)), atol=1e-7)
    axis = np.cross(start, vectors)
    np.testing.assert_allclose(rotate(q, axis), axis, atol=1e-10)


def test_twist_is_signed_about_the_bone() -> None:
    """A turn of the normal from z towards -y is positive about x; flexion only shortens its component
    across.
    """
    theta = np.radians(30.0)
    turned = np.array([0.0, -np.sin(theta), np.cos(theta)])
    flexed = np.cos(0.4) * turned + np.sin(0.4) * X
    angles, across = twist(np.tile(X, (2, 1)), np.tile(Z, (2, 1)), np.array([turned, flexed]))
    np.testing.assert_allclose(angles, theta, atol=1e-12)
    np.testing.assert_allclose(across, [1.0, np.cos(0.4)], atol=1e-12)


def palm(seed: int, n: int = 120) -> tuple[Rotation, np.ndarray, np.ndarray]:
    """Return a freely moving metacarpal's rotations, its vectors (mm) and the normals of a flexing
    phalanx.
    """
    rng = np.random.default_rng(seed)
    bone = Rotation.from_rotvec(0.3 * smooth(rng, n, 3)) * Rotation.random(random_state=rng)
    flexion = 0.5 + 0.3 * smooth(rng, n, 1)[:, 0].clip(-1.4, 1.4)
    phalanx = bone * Rotation.from_rotvec(flexion[:, None] * Y)
    return bone, 65 * bone.apply(X), phalanx.apply(Z)


def first(vector: Array, normal: Array, normal_reference: Array, frame: int = 0) -> Reference:
    return Reference.of(vector[frame], normal_reference, normal[frame])


@given(SEEDS)
@settings(max_examples=40)
def test_the_estimated_posture_equals_the_bones_true_change(seed: int) -> None:
    """Swing, then twist with factor 1 equals the metacarpal's change of posture to 1e-6 deg."""
    bone, vector, normal = palm(seed)
    posture = estimate_posture(vector, normal, first(vector, normal, bone[7].apply(Z), 7), 1.0)
    true = (bone * bone[7].inv()).as_quat(scalar_first=True)
    error = angle(multiply(conjugate(posture.change), true))
    assert np.degrees(error).max() < 1e-6
    assert posture.swing_rad[7] == posture.twist_rad[7] == 0


@given(SEEDS)
@settings(max_examples=20)
def test_hand_and_transmitter_frames_give_the_same_posture(seed: int) -> None:
    """With twist factor 1 the estimate is the same in the frame of a turning hand and in the
    transmitter's.
    """
    bone, vector, normal = palm(seed)
    hand = Rotation.from_rotvec(smooth(np.random.default_rng(seed + 1), 120, 3))
    in_hand = hand.inv().apply(vector), hand.inv().apply(normal)
    seen = estimate_posture(*in_hand, first(*in_hand, hand[0].inv().apply(bone[0].apply(Z))), 1.0)
    world = estimate_posture(vector, normal, first(vector, normal, bone[0].apply(Z)), 1.0)
    q = hand.as_quat(scalar_first=True)
    back = multiply(multiply(q, seen.change), conjugate(q[0]))
    assert np.degrees(angle(multiply(conjugate(back), world.change))).max() < 1e-6


def test_the_twist_factor_scales_only_the_twist() -> None:
    """Eq. 11, theta_meta = c theta_pro: c = 0 is swing alone, c = 1/2 half the twist."""
    bone, vector, normal = palm(3)
    reference = first(vector, normal, bone[0].apply(Z))
    whole, half, none = (estimate_posture(vector, normal, reference, c) for c in (1.0, 0.5, 0.0))
    np.testing.assert_allclose(half.twist_rad, whole.twist_rad / 2, atol=1e-12)
    np.testing.assert_allclose(none.change, swing(vector[0], vector)[0], atol=1e-12)
    for posture in (whole, half, none):
        np.testing.assert_allclose(
            rotate(posture.change, unit(vector[0])), unit(vector), atol=1e-12, err_msg="twist moved the bone"
        )
    assert np.ptp(whole.twist_rad) > 0.1


def test_singularities_are_flagged() -> None:
    """Twist is singular for a phalanx flexed by 85 deg, not by 60 deg; swing is for a reversed bone."""
    vector = np.array([X, X, X, -X + 1e-6 * Y])
    flexed = np.array([Z, *(np.cos(a) * Z + np.sin(a) * X for a in np.radians([60, 85])), Z])
    posture = estimate_posture(vector, flexed, first(vector, flexed, Z), 1.0)
    assert posture.twist_singular.tolist() == [False, False, True, False]
    assert posture.swing_singular.tolist() == [False, False, False, True]


def test_the_wrist_of_a_rigid_palm_is_the_nominal_point() -> None:
    """A rigid palm does not determine the point, so that of the average hand is returned."""
    still = [np.tile(mcp, (50, 1)) for mcp in ([60.0, 20, 0], [60.0, -20, 0])]
    nominal = np.array([-35.0, 0, -14])
    np.testing.assert_allclose(estimate_wrist(still, nominal).point_mm, nominal, atol=1e-9)
    np.testing.assert_allclose(estimate_wrist([], nominal).point_mm, nominal)


def test_the_wrist_of_a_cupping_palm_is_located() -> None:
    """With MCP joints on spheres about one point, it is found to 0.5 mm from a nominal point 12 mm away."""
    rng = np.random.default_rng(0)
    true = np.array([-40.0, 3.0, -20.0])
    arms = [np.array([95.0, y, 10.0]) for y in (25.0, 8.0, -8.0, -25.0)]
    turns = [about_axis(unit(rng.normal(size=3)), 0.5 * smooth(rng, 400, 1)[:, 0]) for _ in arms]
    moving = [true + rotate(turn, arm) for turn, arm in zip(turns, arms, strict=True)]
    nominal = true + np.array([8.0, -5.0, 7.0])
    wrist = estimate_wrist(moving, nominal)
    assert np.linalg.norm(wrist.point_mm - true) < 0.5
    assert np.sqrt(np.trace(wrist.covariance_mm2)) < np.sqrt(3) * 15
