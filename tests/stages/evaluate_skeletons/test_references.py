"""Reference rows: what is exact is exact, and anatomy moves nothing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import stage_chain
from kinematics.recordings import Recordings
from schemas.layout import read_layout
from schemas.poses import read_poses
from schemas.tables import Provenance
from stages.evaluate_skeletons.references import (
    distal_receiver_row,
    fit_prior,
    prior_rows,
    some_frames,
    true_skeleton_row,
)
from stages.evaluate_skeletons.scores import Recording, read_recording
from stages.evaluate_skeletons.truth_folder import read_truth
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import simulate
from stages.simulate.truth import write_truth

LAYOUT = read_layout("liberty16")
FINGERS = ("index", "middle", "ring", "little")


def recorded(folder: Path, realism: Realism, hand: str = "right") -> Recording:
    """A range of motion of 200 frames, with its truth."""
    made = simulate("01", hand, "rom", 4, realism, 200)
    write_recording(folder / "rom.parquet", made)
    write_truth(folder / "truth", made.truth, made.written(), Provenance())
    poses = folder / "poses.parquet"
    stage_chain.run_here([stage_chain.capture(folder / "rom.parquet", poses, hand, "rom")])
    return read_recording(poses, LAYOUT, [read_truth(folder / "truth", "01", hand)])


@pytest.mark.parametrize("hand", ["right", "left"])
def test_the_true_skeleton_is_exact_where_nothing_disturbs(tmp_path: Path, hand: str) -> None:
    """Palm and thumb move, receivers are misplaced, but there is no skin and no noise: replay, tip and wrist
    of the fingers are true. The thumb's CMC axes do not meet, so that its base is true in the mean alone.
    """
    realism = replace(Realism.full(), artefact=0.0, noise=0.0, field_distortion=0.0)
    recording = recorded(tmp_path, realism, hand)
    for name, digit in LAYOUT.digits.items():
        row = true_skeleton_row(recording, digit, recording.poses(digit))
        assert row is not None
        assert row["true_tip_p95_mm"] < 1e-6, name
        assert row["metacarpal_deg"] == 0.0
        assert row["n_frames"] == 200
        assert row["replay_p95_mm"] < (1e-6 if name in FINGERS else 5.0), name
        if name in ("index", "middle"):
            assert row["wrist_mcp_sd_mm"] < 0.02


def test_skin_costs_the_true_skeleton_its_tip_error(tmp_path: Path) -> None:
    """With skin the replay is off; it is the left-out error too; a gap costs its frame."""
    recording = recorded(tmp_path, Realism.full())
    digit = LAYOUT.digits["index"]
    poses = recording.poses(digit)
    valid = poses.valid.copy()
    valid[7, poses.index("index_middle")] = False
    poses = replace(poses, valid=valid)
    row = true_skeleton_row(recording, digit, poses)
    assert row is not None
    assert 0.2 < row["true_tip_mean_mm"] < row["replay_mean_mm"] < 3.0
    assert row["left_out_p95_mm"] == row["replay_p95_mm"]
    assert row["n_frames"] == 199
    distal = distal_receiver_row(recording, digit)
    assert (distal["replay_mean_mm"], distal["replay_p95_mm"], distal["n_frames"]) == (0.0, 0.0, 200)
    stated = recording.truth["index"].to_receiver_mm
    assert distal["true_tip_mean_mm"] == pytest.approx(stated.mean())
    assert "left_out_mean_mm" not in distal


def test_without_truth_there_is_no_true_skeleton(tmp_path: Path) -> None:
    recording = replace(recorded(tmp_path, Realism.full()), truth={}, truth_folder=None)
    digit = LAYOUT.digits["index"]
    poses = recording.poses(digit)
    assert true_skeleton_row(recording, digit, poses) is None
    assert "true_tip_mean_mm" not in distal_receiver_row(recording, digit)


def test_the_prior_moves_nothing(tmp_path: Path) -> None:
    """Bones are an average hand's, 189 mm long or as long as it was measured; nothing is stated of errors."""
    recording = recorded(tmp_path, Realism.full())
    prior, longer = (fit_prior([recording.path], LAYOUT, "right", length) for length in (189.0, 210.0))
    assert prior is not None
    assert longer is not None
    ratio = [
        longer.stated.bones[name]["bone_mm"] / bone["bone_mm"] for name, bone in prior.stated.bones.items()
    ]
    assert np.ptp(ratio) < 1e-9
    assert ratio[0] == pytest.approx(210 / 189)
    assert {row.get("sd_mm") for row in prior.stated.joints.values()} == {None}
    for row in prior_rows(prior, recording):
        assert 0 < row["posed_mean_mm"] < row["left_out_mean_mm"] < 20, row["digit"]
        assert 0 < row["true_tip_mean_mm"] < 20
        assert row["wrist_mcp_sd_mm"] > 0
        assert row["n_frames"] == 200
        assert (row["model"], row["reference"], row["message"]) == ("prior-only", True, "")


def test_a_prior_that_cannot_be_had_says_why(tmp_path: Path) -> None:
    assert fit_prior([], read_layout("arm"), "right") is None
    recording = recorded(tmp_path, Realism.full())
    prior = fit_prior([], LAYOUT, "right")
    assert prior is not None
    rows = prior_rows(prior, recording)
    assert [row["message"] for row in rows] == ["no calibration recording: none is given"] * 5
    assert {row.get("posed_mean_mm") for row in rows} == {None}


def test_some_frames_are_evenly_spaced(tmp_path: Path) -> None:
    """200 frames: every third makes 67, and the numbers are those of the recording, whatever the blocks."""
    path = recorded(tmp_path, Realism.full()).path
    whole = read_poses(path, LAYOUT.measured)
    for block_frames in (200, 64, 2, 1):
        some = some_frames(Recordings([path], LAYOUT.measured, block_frames), 80)
        np.testing.assert_array_equal(some.frame, whole.frame[::3])
        np.testing.assert_array_equal(some.quaternion, whole.quaternion[::3])
    np.testing.assert_array_equal(some_frames(Recordings([path], LAYOUT.measured), 200).frame, whole.frame)
