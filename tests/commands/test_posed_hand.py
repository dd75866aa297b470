"""A hand at joint angles that are asked for."""

from __future__ import annotations

import numpy as np
import pytest
from export_samples.known_hands import make_hand

import shukotsu
from shukotsu.errors import InputError
from shukotsu.hand.joint_angles import joint_angles

ANGLES = {"index_mcp": (60.0, 8.0, -5.0), "index_pip": (80.0, 0.0, 0.0), "thumb_mcp": (20.0, -6.0, 4.0)}


@pytest.fixture(scope="module", params=["right", "left"])
def posed(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> shukotsu.PosedRecording:
    known = make_hand(tmp_path_factory.mktemp("study"), request.param)
    return shukotsu.pose(known.plan.folder.parent, "01", request.param, "opposition")


def angles_in(posed: shukotsu.PosedRecording, joint: str) -> np.ndarray:
    """Joint angles (T, 3) of a posed hand."""
    child = posed.index(joint)
    bones = posed.quaternion[:, posed.parents[child]], posed.quaternion[:, child]
    return joint_angles(*bones, posed.hand, posed.neutral[child])


def test_a_bent_hand_has_the_angles_that_were_asked_for(posed: shukotsu.PosedRecording) -> None:
    bent = shukotsu.bend(posed, ANGLES)
    for joint in ("index_mcp", "index_pip", "thumb_mcp", "ring_pip"):
        expected = ANGLES.get(joint, (0.0, 0.0, 0.0))
        np.testing.assert_allclose(angles_in(bent, joint), [expected], atol=1e-6)


def test_a_flexed_finger_goes_to_the_palm(posed: shukotsu.PosedRecording) -> None:
    tip = posed.index("index_tip")
    straight, flexed = (shukotsu.bend(posed, {"index_mcp": angle}).position_mm[0, tip] for angle in (0, 80))
    assert flexed[2] < straight[2] - 40  # dorsal
    assert flexed[0] < straight[0] - 40  # distal


def test_the_recordings_own_angles_give_its_own_fingers_back(posed: shukotsu.PosedRecording) -> None:
    moving = ("index_mcp", "index_pip", "index_dip")
    bent = shukotsu.bend(posed, {joint: angles_in(posed, joint) for joint in moving})
    base = posed.index("index_mcp")
    for joint in ("index_pip", "index_dip", "index_tip"):
        index = posed.index(joint)
        own, again = (
            np.linalg.norm(h.position_mm[:, index] - h.position_mm[:, base], axis=-1) for h in (posed, bent)
        )
        np.testing.assert_allclose(again, own, atol=0.05)  # its joints glide as they bend
    assert len(bent.frame) == len(posed.frame)
    assert np.isnan(bent.time_s).all()


@pytest.mark.parametrize(
    ("angles", "message"),
    [
        ({"index_mpc": 5}, "the hand has no joint 'index_mpc'; did you mean 'index_mcp'"),
        ({"index_mcp": (1, 2)}, "index_mcp: angles of shape"),
        ({"index_mcp": np.zeros((3, 3)), "ring_mcp": np.zeros((4, 3))}, "angles over 3 and 4 frames"),
    ],
)
def test_angles_that_no_hand_can_have_are_told(
    posed: shukotsu.PosedRecording, angles: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        shukotsu.bend(posed, angles)
