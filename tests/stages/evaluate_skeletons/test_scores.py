"""Scores of a digit with numbers that can be checked by hand."""

import numpy as np
import pytest
from chains import as_poses
from hypothesis import given
from hypothesis import strategies as st

from schemas.layout import read_layout
from skeleton.rotations import about_axis
from stages.evaluate_skeletons.scores import (
    metacarpal_deg,
    tip_numbers,
    true_tip_numbers,
    wrist_mcp_sd,
)
from stages.evaluate_skeletons.truth import DISTAL, TrueDigit, at_frames, directions

LAYOUT = read_layout("liberty16")
NAN = float("nan")
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def turned(*degrees: float) -> np.ndarray:
    return np.stack([about_axis(np.eye(3)[2], np.radians(angle)) for angle in degrees])


def true_digit(frame: list[int], tip_mm: list[list[float]]) -> TrueDigit:
    n = len(frame)
    return TrueDigit(np.array(frame), np.array(tip_mm), np.zeros(n), np.tile(DISTAL, (n, 1)), 60.0)


def test_a_replay_is_its_own_left_out_error() -> None:
    replayed = np.array([[1.0], [3.0], [NAN]])
    found = tip_numbers(replayed, replayed)
    assert (found["replay_mean_mm"], found["left_out_mean_mm"]) == (2.0, 2.0)
    assert (found["posed_mean_mm"], found["n_frames"]) == (None, 2)
    assert found["replay_p95_mm"] == pytest.approx(2.9)
    nothing = np.array([[NAN]])
    assert tip_numbers(nothing, nothing) == {"posed_mean_mm": None, "n_frames": 0}


def test_a_whole_hand_has_a_left_out_error_of_its_own() -> None:
    """It is that of the frames tried; where the hand could not be posed the replay does not stand in."""
    replayed = np.array([[1.0], [3.0], [5.0]])
    posed = np.array([[0.5, NAN], [0.5, 4.0], [2.0, NAN]])
    found = tip_numbers(replayed, posed)
    assert found["replay_mean_mm"] == 3.0
    assert found["posed_mean_mm"] == 1.0
    assert (found["left_out_mean_mm"], found["left_out_p95_mm"], found["n_frames"]) == (4.0, 4.0, 3)
    assert "left_out_mean_mm" not in tip_numbers(replayed, None)


def test_truth_is_compared_frame_by_frame() -> None:
    """Frames 6 and 7 are shared: 5 mm and 1 mm; 30 deg and 90 deg, whatever the bone's own twist."""
    true, frame = true_digit([5, 6, 7], [[9, 9, 9], [0, 0, 0], [0, 0, 1]]), np.array([6, 7, 8])
    found = true_tip_numbers(np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), frame, true)
    assert found["true_tip_mean_mm"] == pytest.approx(3.0)
    assert found["true_tip_p95_mm"] == pytest.approx(4.8)
    assert metacarpal_deg(directions(turned(30, 90, 0)), frame, true) == pytest.approx(60.0)


def test_opposite_directions_are_180_deg() -> None:
    true = true_digit([1], [[0, 0, 0]])
    assert metacarpal_deg(np.array([[-1.0, 0.0, 0.0]]), np.array([1]), true) == pytest.approx(180.0)
    assert metacarpal_deg(np.array([[1.0, 0.0, 0.0]]), np.array([2]), true) is None


def test_wrist_to_mcp_is_measured_between_child_halves() -> None:
    """Wrist (-30, 0, 0) on the hand, MCP joint (-20, 0, 0) on a proximal phalanx at 50, then 54 mm: 60 and 64
    mm apart, an SD of 2; a third frame, 500 mm away, is not valid.
    """
    position = np.array([[[0, 0, 0], [50, 0, 0]], [[0, 0, 0], [54, 0, 0]], [[0, 0, 0], [500, 0, 0]]], float)
    poses = as_poses(("hand", "index_proximal"), position, np.tile(UPRIGHT, (3, 2, 1)))
    poses.valid[2, 1] = False
    wrist = {"status": "ok", "child_x_mm": -30.0, "child_y_mm": 0.0, "child_z_mm": 0.0}
    joints = {"wrist": wrist, "index_mcp": {**wrist, "child_x_mm": -20.0}}
    index = LAYOUT.digits["index"]
    assert wrist_mcp_sd(poses, index, LAYOUT, joints) == pytest.approx(2.0)
    assert wrist_mcp_sd(poses, index, LAYOUT, {}) is None
    for joint in joints:
        failed = joints | {joint: {**joints[joint], "status": "failed"}}
        assert wrist_mcp_sd(poses, index, LAYOUT, failed) is None
    assert wrist_mcp_sd(poses.take(slice(0, 1)), index, LAYOUT, joints) is None
    assert wrist_mcp_sd(None, index, LAYOUT, joints) is None
    arm = read_layout("arm")
    assert wrist_mcp_sd(poses, arm.digits["arm"], arm, joints) is None


@given(st.lists(st.integers(0, 60), unique=True, min_size=1), st.lists(st.integers(-5, 65)))
def test_values_are_found_by_their_frames(known: list[int], wanted: list[int]) -> None:
    known = sorted(known)
    found = at_frames(np.array(known, float)[:, None], np.array(known), np.array(wanted, int))
    expected = [[float(frame) if frame in known else NAN] for frame in wanted]
    np.testing.assert_array_equal(found, np.array(expected).reshape(-1, 1))
