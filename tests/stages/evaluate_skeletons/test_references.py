"""Reference rows: what is exact is exact."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from schemas.layout import read_layout
from schemas.poses import RecordingName
from schemas.tables import Provenance
from stages.evaluate_skeletons.references import distal_receiver_row, true_skeleton_row
from stages.evaluate_skeletons.scores import EvaluatedRecording
from stages.evaluate_skeletons.truth import read_truth
from stages.simulate.realism import Realism
from stages.simulate.simulation import simulate
from stages.simulate.written_truth import write_truth

LAYOUT = read_layout("liberty16")
FINGERS = ("index", "middle", "ring", "little")


def recorded(folder: Path, realism: Realism, hand: str = "right") -> EvaluatedRecording:
    """A range of motion of 200 frames, with its truth."""
    made, name = simulate("01", hand, "rom", 4, realism, 200), RecordingName("01", hand, "rom")
    write_truth(folder, made, Provenance())
    truth, poses = read_truth(folder, name), made.poses()
    true = truth.digits(poses, {digit.name: digit.tip for digit in LAYOUT.digits.values()})
    return EvaluatedRecording(name, LAYOUT, poses, true, truth)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_the_true_skeleton_is_exact_where_nothing_disturbs(tmp_path: Path, hand: str) -> None:
    """Palm and thumb move, receivers are misplaced, but no centre glides and there is no skin and no noise:
    replay, tip and wrist of the fingers are true. The thumb's CMC axes do not meet, so that
    its base is true in the mean alone.
    """
    realism = replace(Realism.full(), glide=0.0, artefact=0.0, noise=0.0, field_distortion=0.0)
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


def test_skin_costs_the_true_skeleton_its_tip_error(tmp_path: Path) -> None:
    """With skin the replay is off; it is the left-out error too; a gap costs its frame."""
    recording = recorded(tmp_path, Realism.full())
    digit, poses = LAYOUT.digits["index"], recording.poses
    assert poses is not None
    valid = poses.valid.copy()
    valid[7, poses.index("index_middle")] = False
    row = true_skeleton_row(replace(recording, poses=replace(poses, valid=valid)), digit)
    assert row is not None
    assert 0.2 < row["true_tip_mean_mm"] < row["replay_mean_mm"] < 3.0
    assert row["left_out_p95_mm"] == row["replay_p95_mm"]
    assert row["n_frames"] == 199
    distal = distal_receiver_row(recording, digit)
    assert (distal["replay_mean_mm"], distal["replay_p95_mm"], distal["n_frames"]) == (0.0, 0.0, 200)
    stated = recording.truth["index"].to_receiver_mm
    assert distal["true_tip_mean_mm"] == pytest.approx(np.mean(stated))
    assert "left_out_mean_mm" not in distal
