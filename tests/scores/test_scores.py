"""Scores of digits, errors of joints and reference rows, on numbers that can be checked by hand."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shukotsu.hand.rotations import about_axis
from shukotsu.scores import truth
from shukotsu.scores.evaluation import EvaluatedRecording, tip_numbers, true_skeleton_row
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_truth
from shukotsu.simulate.simulation import simulate
from shukotsu.study.layout import read_layout
from shukotsu.study.study import Recording, Source
from shukotsu.tables.poses import RecordingName
from shukotsu.tables.typed_table import Provenance, vector_columns

NAN = float("nan")


def turned(*degrees: float) -> np.ndarray:
    return np.stack([about_axis(np.eye(3)[2], np.radians(angle)) for angle in degrees])


def true_digit(frame: list[int], tip_mm: list[list[float]]) -> truth.TrueDigit:
    n = len(frame)
    return truth.TrueDigit(
        np.array(frame), np.array(tip_mm), np.zeros(n), np.tile(truth.DISTAL, (n, 1)), 60.0
    )


def test_a_replays_left_out_error_is_its_own_error() -> None:
    replayed = np.array([[1.0], [3.0], [NAN]])
    numbers = tip_numbers(replayed, replayed, fitted=False)
    assert (numbers["replay_mean_mm"], numbers["left_out_mean_mm"]) == (2.0, 2.0)
    assert (numbers["posed_mean_mm"], numbers["n_frames"]) == (None, 2)
    assert numbers["replay_p95_mm"] == pytest.approx(2.9)
    nothing = np.array([[NAN]])
    assert tip_numbers(nothing, nothing, fitted=False) == {"posed_mean_mm": None, "n_frames": 0}


def test_a_fitted_hand_has_a_separate_left_out_error() -> None:
    """It is that of the frames tried; if the hand could not be posed, the replay's error is not used
    instead.
    """
    replayed = np.array([[1.0], [3.0], [5.0]])
    posed = np.array([[0.5, NAN], [0.5, 4.0], [2.0, NAN]])
    numbers = tip_numbers(replayed, posed, fitted=True)
    assert numbers["replay_mean_mm"] == 3.0
    assert numbers["posed_mean_mm"] == 1.0
    assert (numbers["left_out_mean_mm"], numbers["left_out_p95_mm"], numbers["n_frames"]) == (4.0, 4.0, 3)
    assert "left_out_mean_mm" not in tip_numbers(replayed, np.empty((0, 2)), fitted=True)


def test_the_truth_is_compared_in_shared_frames() -> None:
    """In the shared frames 6 and 7 errors are 5 mm and 1 mm, 30 deg and 90 deg; frame 8 has no truth."""
    true, frame = true_digit([5, 6, 7], [[9, 9, 9], [0, 0, 0], [0, 0, 1]]), np.array([6, 7, 8])
    errors_mm = true.tip_errors_mm(np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), frame)
    np.testing.assert_allclose(errors_mm, [5.0, 1.0, NAN])
    assert true.metacarpal_deg(turned(30, 90, 0), frame) == pytest.approx(60.0)


Row = dict[str, Any]


def centre(joint: str, child: tuple[float, ...], parent: tuple[float, ...], **other: Any) -> Row:
    row: Row = {"joint": joint, "status": "ok", "dof": 1, "sd_mm": None, "parent_segment": "x"}
    row["n_frames"] = 100
    for side, half_mm in (("child", child), ("parent", parent)):
        row |= vector_columns(f"{side}_", np.array(half_mm), "_mm")
        row |= vector_columns(f"axis_{side}_", np.array([0.0, 1.0, 0.0]))
    return row | other


def truth_of(task: str, *joints: Row, **length_mm: float) -> truth.RecordingTruth:
    bones = {bone: {"length_mm": value} for bone, value in length_mm.items()}
    stated = truth.Stated({row["joint"]: row for row in joints}, bones)
    return truth.RecordingTruth(Path(task), RecordingName("01", "right", task), stated)


def test_a_centres_error_is_split_along_and_across_its_axis() -> None:
    """The error (3, -4, 0) with the true axis along y is 5 mm in all, 4 along and 3 across; the parent's is 6
    mm.
    """
    true = centre("index_pip", (1, 1, 1), (0, 0, 0))
    tilted = {"axis_child_x": 0.0, "axis_child_y": -np.cos(0.2), "axis_child_z": np.sin(0.2)}
    estimated = centre("index_pip", (4, -3, 1), (0, 0, 6), sd_mm=3.8, **tilted)
    expected_mm = {"error_mm": 5.0, "along_mm": 4.0, "across_mm": 3.0, "parent_error_mm": 6.0, "sd_mm": 3.8}
    errors = truth.centre_errors(estimated, true)
    assert {name: errors[name] for name in expected_mm} == pytest.approx(expected_mm)
    assert errors["axis_deg"] == pytest.approx(np.degrees(0.2))
    # sd 3.8 mm as a ball: 95 % within 6.1 mm; covariances allow more along their long axis
    for sds_mm, expected in (
        (None, (True, True)),
        ((1, 1, 2, 1.5, 3, 1), (True, False)),
        ((9, 9, 3, 3, 1, 9), (False, True)),
    ):
        stated = None if sds_mm is None else np.diag(np.square(sds_mm)).ravel()
        errors = truth.centre_errors(estimated | {"covariance_mm2": stated}, true)
        assert (errors["within_95"], errors["parent_within_95"]) == expected


def test_the_truth_is_averaged_over_the_calibration_recordings() -> None:
    """Recordings are weighted by frames; a skeleton without a truth of its recordings is compared with
    all.
    """
    turned = {"axis_child_x": 1.0, "axis_child_y": 0.0}
    rom = truth_of("rom", centre("index_pip", (1, 0, 0), (0, 0, 0), n_frames=300), index_middle=25.0)
    grasp = truth_of("grasp", centre("index_pip", (5, 0, 0), (0, 0, 8), **turned), index_middle=25.0)
    tap = truth_of("tap", centre("index_pip", (90, 0, 0), (0, 0, 0)), index_middle=25.0)

    def true(*tasks: str, of: tuple[truth.RecordingTruth, ...] = (rom, grasp, tap)) -> Row:
        averaged = truth.truth_for(tasks, of)
        assert averaged is not None
        assert averaged.bones["index_middle"]["length_mm"] == 25.0
        return dict(averaged.joints["index_pip"])

    assert [true("grasp", "other")[f"child_{axis}_mm"] for axis in "xyz"] == [5.0, 0.0, 0.0]
    both = true("rom", "grasp")
    assert (both["child_x_mm"], both["parent_z_mm"]) == (2.0, 2.0)
    axis = np.array([both[f"axis_child_{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(axis, np.array([1.0, 3.0, 0.0]) / np.sqrt(10.0))
    assert true("other", of=(rom, grasp)) == both
    assert truth.truth_for(["rom"], []) is None


LAYOUT = read_layout("liberty16")
FINGERS = ("index", "middle", "ring", "little")


def recorded(folder: Path, realism: Realism, hand: str = "right") -> EvaluatedRecording:
    simulated, name = (
        simulate(RecordingName("01", hand, "rom"), 4, realism, 200),
        RecordingName("01", hand, "rom"),
    )
    write_truth(folder, simulated, Provenance())
    written, poses = truth.read_truth(folder, name), simulated
    true = written.digits(poses, LAYOUT)
    recording = Recording(name.of_hand, "rom", "", "both", Source(Path(), "", Path()))
    return EvaluatedRecording(recording, LAYOUT, poses, true, written)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_the_true_skeleton_is_exact_without_disturbances(tmp_path: Path, hand: str) -> None:
    """Palm and thumb move and receivers are misplaced, but there is no gliding, skin motion or noise: the
    fingers' replay, tips and wrist are exact. The thumb's CMC axes do not meet, so its base is right on
    average only.
    """
    realism = replace(Realism(), glide=0.0, artefact=0.0, noise=0.0, field_distortion=0.0)
    recording = recorded(tmp_path, realism, hand)
    for name, digit in LAYOUT.digits.items():
        row = true_skeleton_row(recording, digit)
        assert row is not None
        assert row["true_tip_p95_mm"] < 1e-6, name
        assert row["metacarpal_deg"] == 0.0
        assert row["n_frames"] == 200
        assert row["replay_p95_mm"] < (1e-6 if name in FINGERS else 5.0), name
        if name in ("index", "middle"):
            assert row["wrist_mcp_sd_mm"] < 0.02
