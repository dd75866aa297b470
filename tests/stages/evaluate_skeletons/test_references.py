"""Reference rows: what is exact is exact."""

from dataclasses import replace
from pathlib import Path

import pytest

from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.poses import RecordingName
from shukotsu.schemas.study import Recording
from shukotsu.schemas.tables import Provenance
from shukotsu.stages.evaluate_skeletons.scores import EvaluatedRecording, true_skeleton_row
from shukotsu.stages.evaluate_skeletons.truth import read_truth
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.simulation import simulate
from shukotsu.stages.simulate.written_truth import write_truth

LAYOUT = read_layout("liberty16")
FINGERS = ("index", "middle", "ring", "little")


def recorded(folder: Path, realism: Realism, hand: str = "right") -> EvaluatedRecording:
    """A range of motion of 200 frames, with its truth."""
    made, name = simulate("01", hand, "rom", 4, realism, 200), RecordingName("01", hand, "rom")
    write_truth(folder, made, Provenance())
    truth, poses = read_truth(folder, name), made.poses()
    true = truth.digits(poses, {digit.name: digit.tip for digit in LAYOUT.digits.values()})
    of_none = ("both", Path(), "", Path(), "", None, "", "")
    recording = Recording(name.of_hand, "rom", "", *of_none)
    return EvaluatedRecording(recording, LAYOUT, poses, true, truth)


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
