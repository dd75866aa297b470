"""How many axes a motion shows, and that less than the skin's own motion shows nothing."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from shukotsu.stages.solve_joints.degrees_of_freedom import degrees_of_freedom, joint_motion


@pytest.mark.parametrize(
    ("spread_deg", "anatomical", "expected"),
    [
        ((30.0, 3.0, 1.0), 1, 1),
        ((30.0, 5.0, 1.0), 1, 1),  # 5 deg is less than a fifth of 30
        ((30.0, 8.0, 2.0), 1, 2),
        ((30.0, 3.0, 1.0), 2, 1),
        ((20.0, 12.0, 3.0), 1, 2),
        ((20.0, 15.0, 10.0), 2, 3),
        ((3.0, 2.9, 2.8), 1, 1),  # too little to tell
        ((3.0, 0.1, 0.1), 2, 2),
        ((3.0, 0.1, 0.1), 0, 1),
    ],
)
def test_degrees_of_freedom(spread_deg: tuple[float, ...], anatomical: int, expected: int) -> None:
    assert degrees_of_freedom(np.radians(spread_deg), anatomical) == expected


def test_motion_of_a_hinge_that_wobbles() -> None:
    """The axis comes back in both frames, on the hint's side, with angle and spread."""
    rng = np.random.default_rng(0)
    axis = np.array([0.1, 0.9, 0.3]) / np.linalg.norm([0.1, 0.9, 0.3])
    angle = np.radians(40) * np.sin(np.linspace(0, 12, 2000))
    rest = Rotation.random(random_state=3)
    turn = (
        rest
        * Rotation.from_rotvec(angle[:, None] * axis)
        * Rotation.from_rotvec(rng.normal(size=(2000, 3)) * 0.01)
    )
    quaternion = np.roll(turn.as_quat(), 1, -1)
    found = joint_motion(quaternion, np.ones(2000), -axis)
    np.testing.assert_allclose(found.axis_child, -axis, atol=5e-3)
    np.testing.assert_allclose(found.axis_parent, -rest.apply(axis), atol=5e-3)
    assert found.range_deg == pytest.approx(80, abs=1.5)
    assert np.degrees(found.spread_rad[0]) == pytest.approx(np.degrees(angle.std()), rel=0.03)
    assert np.degrees(found.spread_rad[1]) < 1
