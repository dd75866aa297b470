"""Scores of a digit with numbers that can be checked by hand."""

import numpy as np
import pytest

from shukotsu.skeleton.rotations import about_axis
from shukotsu.stages.evaluate_skeletons.scores import metacarpal_deg, tip_numbers, true_tip_numbers
from shukotsu.stages.evaluate_skeletons.truth import DISTAL, TrueDigit, directions

NAN = float("nan")


def turned(*degrees: float) -> np.ndarray:
    return np.stack([about_axis(np.eye(3)[2], np.radians(angle)) for angle in degrees])


def true_digit(frame: list[int], tip_mm: list[list[float]]) -> TrueDigit:
    n = len(frame)
    return TrueDigit(np.array(frame), np.array(tip_mm), np.zeros(n), np.tile(DISTAL, (n, 1)), 60.0)


def test_a_replay_is_its_own_left_out_error() -> None:
    replayed = np.array([[1.0], [3.0], [NAN]])
    found = tip_numbers(replayed, replayed, fitted=False)
    assert (found["replay_mean_mm"], found["left_out_mean_mm"]) == (2.0, 2.0)
    assert (found["posed_mean_mm"], found["n_frames"]) == (None, 2)
    assert found["replay_p95_mm"] == pytest.approx(2.9)
    nothing = np.array([[NAN]])
    assert tip_numbers(nothing, nothing, fitted=False) == {"posed_mean_mm": None, "n_frames": 0}


def test_a_whole_hand_has_a_left_out_error_of_its_own() -> None:
    """It is that of the frames tried; where the hand could not be posed the replay does not stand in."""
    replayed = np.array([[1.0], [3.0], [5.0]])
    posed = np.array([[0.5, NAN], [0.5, 4.0], [2.0, NAN]])
    found = tip_numbers(replayed, posed, fitted=True)
    assert found["replay_mean_mm"] == 3.0
    assert found["posed_mean_mm"] == 1.0
    assert (found["left_out_mean_mm"], found["left_out_p95_mm"], found["n_frames"]) == (4.0, 4.0, 3)
    assert "left_out_mean_mm" not in tip_numbers(replayed, None, fitted=True)


def test_truth_is_compared_frame_by_frame() -> None:
    """Frames 6 and 7 are shared: 5 mm and 1 mm; 30 deg and 90 deg, whatever the bone's own twist."""
    true, frame = true_digit([5, 6, 7], [[9, 9, 9], [0, 0, 0], [0, 0, 1]]), np.array([6, 7, 8])
    found = true_tip_numbers(np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), frame, true)
    assert found["true_tip_mean_mm"] == pytest.approx(3.0)
    assert found["true_tip_p95_mm"] == pytest.approx(4.8)
    assert metacarpal_deg(directions(turned(30, 90, 0)), frame, true) == pytest.approx(60.0)
