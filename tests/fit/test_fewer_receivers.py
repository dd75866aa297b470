"""Hands calibrated with fewer receivers than bones."""

import numpy as np
import pytest
from simulated_poses import fitted, recorded

from shukotsu.fit.fingertips import fingertips
from shukotsu.fit.fit import FitSettings, fit_hand
from shukotsu.fit.gains import gains
from shukotsu.fit.hand_tables import joint_rows
from shukotsu.simulate.random_hand import BONES, FINGERS
from shukotsu.study.layout import read_layout
from shukotsu.study.verdict import ONE_RECEIVER, doubts_of
from shukotsu.tables.poses import Poses

SIX = ("hand", *(f"{digit}_distal" for digit in ("thumb", *FINGERS)))


@pytest.mark.slow
def test_six_receivers_report_what_they_cannot_determine() -> None:
    """Lengths are less certain but their sds are right; a joint centre is given only in the frame of a
    receiver on a neighbouring segment, and a joint without one is reported as failed.
    """
    whole, poses = fitted(), recorded(seed=4, n_frames=1600)[1]
    worn = [poses.index(name) for name in SIX]
    arrays = (array[:, worn] for array in (poses.position_mm, poses.quaternion, poses.valid))
    few = Poses(SIX, poses.frame, poses.time_s, *arrays)
    six = fit_hand([few], read_layout("tips-and-hand"), "right", settings=FitSettings(n_frames=60, rounds=1))
    assert six.model.receivers == SIX
    assert six.converged
    true_mm = recorded(seed=4, n_frames=1600)[0].truth.hand.length_mm
    off = np.array([bone.length_mm - true_mm[BONES.index(name)] for name, bone in six.bones.items()])
    sd = np.array([bone.sd_mm for bone in six.bones.values()])
    assert np.sqrt(((off / sd) ** 2).mean()) < 1.6
    assert sd.mean() > 1.2 * np.mean([bone.sd_mm for bone in whole.bones.values()])
    rows = {row["joint"]: row for row in joint_rows(six)}
    assert set(rows) == {row["joint"] for row in joint_rows(whole)}
    for digit in FINGERS:
        mcp, pip, dip = (rows[f"{digit}_{kind}"] for kind in ("mcp", "pip", "dip"))
        assert (mcp["parent_segment"], mcp["child_segment"], mcp["status"]) == ("hand", "", "ok")
        assert doubts_of(mcp)[ONE_RECEIVER] == {"segments": [f"{digit}_proximal"]}
        assert (dip["parent_segment"], dip["child_segment"]) == ("", f"{digit}_distal")
        assert np.isfinite([mcp["parent_x_mm"], dip["child_x_mm"], mcp["sd_mm"], dip["sd_mm"]]).all()
        assert np.isnan([mcp["child_x_mm"], dip["parent_x_mm"], pip["parent_x_mm"], pip["sd_mm"]]).all()
        assert pip["status"] == "failed"
        assert pip["message"].startswith(f"no receiver on {digit}_proximal and {digit}_middle: ")
    assert gains(fingertips(six)) == []
