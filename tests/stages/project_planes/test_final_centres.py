"""Models whose planes cut nothing: the centre of the joint solve is final, with its own gap and message."""

from pathlib import Path

import numpy as np
import pytest
from chains import moments_of, random_chain

from schemas.errors import InputError
from schemas.model import read_model
from stages.project_planes.place import place_joint
from stages.project_planes.plane import centre_sd_mm
from stages.solve_joints.__main__ import _row
from stages.solve_joints.closed import solve_closed


@pytest.mark.parametrize("message", ["", "the joint moved 3 deg; its centre comes mostly from the prior"])
def test_a_final_centre_is_kept(message: str) -> None:
    chain = random_chain(3, 2, off_axis_rad=0.2, noise_mm=0.3, in_plane=False)
    row = _row(chain.joints[0], solve_closed(moments_of(chain), 0, 6), "") | {"message": message}
    placed = place_joint(chain.joints[0], row, read_model("anatomical"), None)
    for half in ("parent", "child"):
        for axis in "xyz":
            assert placed[f"{half}_{axis}_mm"] == row[f"{half}_{axis}_mm"]
    assert placed["gap_rms_mm"] == row["gap_rms_mm"]
    assert placed["slide_mm"] == 0
    assert placed["axis_plane_deg"] is None
    assert placed["sd_mm"] == centre_sd_mm(np.reshape(row["covariance_mm2"], (6, 6)))
    assert (placed["status"], placed["message"]) == ("weak" if message else "ok", message)


def test_receivers_that_disagree_are_told_all_the_same() -> None:
    chain = random_chain(3, 2, off_axis_rad=0.2, noise_mm=30.0, in_plane=False)
    row = _row(chain.joints[0], solve_closed(moments_of(chain), 0, 6), "")
    placed = place_joint(chain.joints[0], row, read_model("anatomical"), None)
    assert placed["status"] == "weak"
    assert "receivers disagree" in placed["message"]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("joints: {solver: anatomical}", "planes.cut: is true; the solver anatomical gives final centres"),
        ("planes: {cut: false, corrections: true}", "planes.corrections: is true, but planes.cut: false"),
    ],
)
def test_a_model_that_contradicts_itself_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "mine.yaml").write_text(f"model: mine\ndescription: Mine.\n{text}\n")
    with pytest.raises(InputError, match=reason):
        read_model("mine.yaml", tmp_path)
