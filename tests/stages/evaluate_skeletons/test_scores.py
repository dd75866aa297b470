"""Scores of a digit with numbers that can be checked by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chains import as_poses
from hypothesis import given
from hypothesis import strategies as st

from kinematics.rotations import about_axis
from schemas.catalogue import TIPS
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.poses import RecordingName
from schemas.tables import Provenance, columns_from_rows, write_table
from stages.evaluate_skeletons.scores import (
    known,
    mean_and_p95,
    metacarpal_deg,
    tip_numbers,
    truth_numbers,
    wrist_mcp_sd,
)
from stages.evaluate_skeletons.skeleton_folder import (
    SkeletonFolder,
    Stated,
    check_tables,
    model_of,
    read_digits,
)
from stages.evaluate_skeletons.truth_folder import TrueDigit, at_frames

LAYOUT = read_layout("liberty16")
NAN = float("nan")
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def turned(*degrees: float) -> np.ndarray:
    return np.stack([about_axis(np.eye(3)[2], np.radians(angle)) for angle in degrees])


def true_digit(frame: list[int], tip_mm: list[list[float]]) -> TrueDigit:
    n = len(frame)
    return TrueDigit(np.array(frame), np.array(tip_mm), np.zeros(n), np.tile(UPRIGHT, (n, 1)), 60.0)


def test_mean_and_percentile_of_what_is_known() -> None:
    found = mean_and_p95("replay", known(np.array([1.0, NAN, 4.0, 2.0, 3.0])))
    assert found == {"replay_mean_mm": 2.5, "replay_p95_mm": pytest.approx(3.85)}
    assert mean_and_p95("replay", known(np.array([NAN]))) == {}


def test_a_replay_is_its_own_left_out_error() -> None:
    found = tip_numbers({"error_mm": known(np.array([1.0, 3.0, NAN]))}, None, whole_hand=False)
    assert (found["replay_mean_mm"], found["left_out_mean_mm"]) == (2.0, 2.0)
    assert (found["posed_mean_mm"], found["n_frames"]) == (None, 2)


def test_a_whole_hand_has_a_left_out_error_of_its_own() -> None:
    """It is that of the frames tried; where the hand could not be posed the replay does not stand in."""
    replayed = {"error_mm": known(np.array([1.0, 3.0, 5.0]))}
    posed = {
        "error_mm": known(np.array([0.5, 0.5, 2.0])),
        "error_left_out_mm": known(np.array([NAN, 4.0, NAN])),
    }
    found = tip_numbers(replayed, posed, whole_hand=True)
    assert found["replay_mean_mm"] == 3.0
    assert found["posed_mean_mm"] == 1.0
    assert (found["left_out_mean_mm"], found["left_out_p95_mm"], found["n_frames"]) == (4.0, 4.0, 3)
    assert "left_out_mean_mm" not in tip_numbers(replayed, None, whole_hand=True)


def test_truth_is_compared_frame_by_frame() -> None:
    """Frames 6 and 7 are shared: 5 mm and 1 mm; 30 deg and 90 deg, whatever the bone's own twist."""
    true = true_digit([5, 6, 7], [[9, 9, 9], [0, 0, 0], [0, 0, 1]])
    tip = {"frame": np.array([6, 7, 8]), "tip_x_mm": np.array([3.0, 0.0, 0.0])}
    tip |= {"tip_y_mm": np.array([4.0, 0.0, 0.0]), "tip_z_mm": np.zeros(3)}
    quaternion = turned(30, 90, 0)
    bone = {"frame": np.array([6, 7, 8])} | {f"q{part}": quaternion[:, i] for i, part in enumerate("wxyz")}
    found = truth_numbers(tip, bone, true)
    assert found["true_tip_mean_mm"] == pytest.approx(3.0)
    assert found["true_tip_p95_mm"] == pytest.approx(4.8)
    assert found["metacarpal_deg"] == pytest.approx(60.0)
    assert truth_numbers(None, None, true) == {}


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
    assert wrist_mcp_sd([poses], index, LAYOUT, [joints]) == [pytest.approx(2.0)]
    halves = [poses.take(slice(0, 1)), poses.take(slice(1, 3))]
    assert wrist_mcp_sd(halves, index, LAYOUT, [joints, {}, joints]) == [
        pytest.approx(2.0),
        None,
        pytest.approx(2.0),
    ]
    for joint in joints:
        failed = joints | {joint: {**joints[joint], "status": "failed"}}
        assert wrist_mcp_sd([poses], index, LAYOUT, [failed]) == [None]
    assert wrist_mcp_sd(halves[:1], index, LAYOUT, [joints]) == [None]
    arm = read_layout("arm")
    assert wrist_mcp_sd([poses], arm.digits["arm"], arm, [joints]) == [None]


@given(st.lists(st.integers(0, 60), unique=True, min_size=1), st.lists(st.integers(-5, 65)))
def test_values_are_found_by_their_frames(known: list[int], wanted: list[int]) -> None:
    known = sorted(known)
    found = at_frames(np.array(known, float)[:, None], np.array(known), np.array(wanted, int))
    expected = [[float(frame) if frame in known else NAN] for frame in wanted]
    np.testing.assert_array_equal(found, np.array(expected).reshape(-1, 1))


ROM, OPPOSITION = RecordingName("01", "right", "rom"), RecordingName("01", "right", "opposition", "2")
FOLDER = SkeletonFolder(
    Path("models/m/sub-01/right"), "m", ("rom, 1", "grasp"), "", False, Stated({}, {}), {}, ""
)


def test_held_out_goes_by_tasks() -> None:
    """Another trial of a calibration task is not; where nothing is said, tip_errors or the folder says it."""
    assert not FOLDER.held_out(ROM)
    assert FOLDER.held_out(OPPOSITION)
    assert FOLDER.calibrated_text == "rom, 1;grasp"
    unsaid = replace(FOLDER, calibrated_on=None)
    assert not unsaid.held_out(OPPOSITION)
    told = replace(unsaid, errors={("opposition", "2", "index"): {"held_out": True}})
    assert told.held_out(OPPOSITION)
    assert not told.held_out(ROM)
    assert replace(unsaid, without="rom").held_out(ROM)
    assert replace(FOLDER, calibrated_on=()).held_out(ROM)


def test_a_folder_without_a_task_is_scored_on_that_task() -> None:
    assert FOLDER.evaluates(ROM)
    without = replace(FOLDER, without="opposition")
    assert without.evaluates(OPPOSITION)
    assert not without.evaluates(ROM)
    assert replace(FOLDER, without="pick%20up").evaluates(RecordingName("01", "right", "pick up"))


def test_a_models_name_in_its_path() -> None:
    assert model_of(Path("results/x/models/paper-fig4/sub-01/right")) == "paper-fig4"
    assert model_of(Path("results/x/models/rigid/sub-01/right/without-rom")) == "rigid"
    assert model_of(Path("lonely")) == "lonely"


def test_a_recording_is_read_whatever_the_order_of_rows(tmp_path: Path) -> None:
    """Digits interleaved, blocks apart, other tasks and trials between."""
    rows = [
        {"task": task, "trial": trial, "digit": digit, "frame": frame, "error_mm": error}
        for task, trial, digit, frame, error in (
            ("rom", "", "thumb", 1, 1.0),
            ("rom", "", "index", 1, None),
            ("rom", "2", "thumb", 1, 7.0),
            ("grasp", "", "thumb", 1, 8.0),
            ("rom", "", "thumb", 2, 2.0),
            ("rom", "", "index", 2, 4.0),
        )
    ]
    words = {"subject": "01", "hand": "right", "model": "m"}
    columns = columns_from_rows(TIPS, [words | row for row in rows])
    write_table(tmp_path / "tips.parquet", TIPS, columns, Provenance(), row_group_rows=4)
    found = read_digits(tmp_path / "tips.parquet", TIPS, ("frame", "error_mm"), ROM)
    assert set(found) == {"thumb", "index"}
    np.testing.assert_array_equal(found["thumb"]["error_mm"], [1.0, 2.0])
    np.testing.assert_array_equal(found["index"]["error_mm"], [NAN, 4.0])
    np.testing.assert_array_equal(found["index"]["frame"], [1, 2])


def test_a_tables_first_row_says_whose_it_is(tmp_path: Path) -> None:
    rows = [
        {"subject": subject, "hand": "right", "task": "rom", "trial": "", "model": "m", "digit": "thumb"}
        | {"frame": 1, "error_mm": 1.0}
        for subject in ("02", "01")
    ]
    write_table(tmp_path / "tips.parquet", TIPS, columns_from_rows(TIPS, rows), Provenance())
    check_tables(tmp_path, (TIPS,), "02", "right")
    with pytest.raises(InputError, match=r"tips\.parquet: is of subject 02, right hand; expected subject 01"):
        check_tables(tmp_path, (TIPS,), "01", "right")
