"""Hands calibrated, and tasks recorded, with fewer receivers than there are bones."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulated_poses import recorded, write_poses

from schemas.layout import read_layout
from schemas.poses import Poses
from schemas.verdict import ONE_RECEIVER, doubts_of
from stages.fit_hand.fingertips import fingertips
from stages.fit_hand.fit import HandFit, Settings, fit_hand
from stages.fit_hand.gains import gains
from stages.fit_hand.hand_tables import joint_rows
from stages.fit_hand.posed_tables import posed_blocks
from stages.fit_hand.receiver_costs import receiver_costs
from stages.fit_hand.receiver_frames import neighbours
from stages.simulate.random_hand import BONES, FINGERS, JOINTS

QUICK = Settings(n_frames=60, rounds=1)
SIX = ("hand", *(f"{digit}_distal" for digit in ("thumb", *FINGERS)))


def only(poses: Poses, worn: tuple[str, ...]) -> Poses:
    """The recording with the rows of some receivers alone."""
    own = [poses.index(name) for name in worn]
    return Poses(
        worn,
        poses.frame,
        poses.time_s,
        poses.position_mm[:, own],
        poses.quaternion[:, own],
        poses.valid[:, own],
    )


@pytest.fixture(scope="module")
def whole() -> HandFit:
    return fit_hand([recorded(seed=4)[1]], read_layout("liberty16"), "right", settings=QUICK)


@pytest.fixture(scope="module")
def six() -> HandFit:
    poses = only(recorded(seed=4)[1], SIX)
    return fit_hand([poses], read_layout("tips-and-hand"), "right", settings=QUICK)


def test_a_calibration_with_six_says_what_is_lost(whole: HandFit, six: HandFit) -> None:
    """Bones are less certain, as far off as stated; joints have a place only beside a receiver."""
    assert six.evidence.model.receivers == SIX
    assert six.converged
    true_mm = recorded(seed=4)[0].truth.hand.length_mm
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
        assert pip["message"].startswith(f"no receiver on {digit}_proximal or {digit}_middle: ")
    assert gains(fingertips(six)) == []


def test_a_layout_with_six_is_the_larger_one_of_which_six_are_worn(six: HandFit) -> None:
    """Whether the layout expects no more receivers, or the recording lacks them."""
    poses = only(recorded(seed=4)[1], SIX)
    lacking = fit_hand([poses], read_layout("liberty16"), "right", settings=QUICK)
    for name, bone in six.bones.items():
        assert lacking.bones[name].length_mm == pytest.approx(bone.length_mm, abs=1e-3)
        assert lacking.bones[name].sd_mm == pytest.approx(bone.sd_mm, abs=1e-3)


def test_no_finger_is_bent_backwards(six: HandFit) -> None:
    """Of a finger's two postures with the same tip, the one with the knuckle up, frame by frame."""
    truth = recorded(seed=4)[0].truth
    names = six.evidence.model.states.names
    for digit in FINGERS:
        pip, dip = (six.evidence.states[:, names.index((f"{digit}_{k}", "flexion"))] for k in ("pip", "dip"))
        true_pip = truth.angles_rad[:, JOINTS.index(f"{digit}_pip"), 0]
        assert np.degrees(pip.min()) > np.degrees(true_pip.min()) - 50
        assert np.degrees(dip.max()) < 110


def test_a_task_with_six_has_every_bone_and_angle_with_its_error(whole: HandFit, tmp_path: Path) -> None:
    """From a file that has no row of the other receivers; DIP joints follow the PIP joints."""
    made = recorded(task="opposition", seed=4, n_frames=480)[0]
    worn = [made.segments.index(name) for name in SIX]
    fewer = replace(
        made, segments=SIX, position_mm=made.position_mm[:, worn], quaternion=made.quaternion[:, worn]
    )
    path = write_poses(tmp_path / "poses.parquet", fewer, "right", "opposition")
    (block,) = posed_blocks(fingertips(whole), path)
    angles, bones, ends = (block[name] for name in ("joint_angles", "bone_poses", "posed_tips"))
    for columns, numbers in (
        (angles, ["flexion_deg", "flexion_sd_deg", "abduction_sd_deg", "rotation_sd_deg"]),
        (bones, ["x_mm", "sd_mm", "turn_sd_deg"]),
        (ends, ["tip_x_mm", "skin_tip_x_mm", "tip_sd_mm", "skin_tip_sd_mm"]),
    ):
        for name in numbers:
            assert np.isfinite(columns[name]).all(), name
    names = np.array(angles["joint"].to_pylist())
    assert len(angles["flexion_deg"]) == 480 * 17
    pip = np.isin(names, [f"{digit}_pip" for digit in FINGERS])
    assert 3 < np.median(angles["flexion_sd_deg"][pip]) < 12


def test_the_dip_follows_the_pip_once_a_person(whole: HandFit) -> None:
    """In a frame to 15 deg, over a calibration as one fact; states that follow cost nothing."""
    states = whole.evidence.model.states
    dip, pip = (states.names.index((f"index_{kind}", "flexion")) for kind in ("dip", "pip"))
    assert np.degrees(states.sd[dip]) == pytest.approx(15)
    assert whole.evidence.problem.state_sd[dip] == pytest.approx(states.sd[dip] * 30**0.5)
    assert whole.evidence.problem.state_sd[pip] == pytest.approx(states.sd[pip])
    y = np.array(states.mean)
    y[pip] += 0.3
    root = replace(whole.evidence.problem, state_sd=np.array(states.sd)).state_prior()
    alone = root @ (y - states.mean)
    y[dip] += 0.2
    both = root @ (y - states.mean)
    assert alone[dip] == pytest.approx(-0.2 / states.sd[dip])
    assert both[dip] == pytest.approx(0, abs=1e-12)
    assert both[pip] == alone[pip] == pytest.approx(0.3 / states.sd[pip])


def test_neighbours_reach_over_what_is_not_worn() -> None:
    layout = read_layout("liberty16")
    assert neighbours(layout, SIX) == [("hand", name) for name in SIX[1:]]
    worn = ("hand", "index_proximal", "index_distal", "ring_middle")
    assert neighbours(layout, worn) == [
        ("hand", "index_proximal"), ("index_proximal", "index_distal"), ("hand", "ring_middle"),
    ]  # fmt: skip


def test_costs_begin_with_none_left_out_and_end_with_layouts_that_ship(whole: HandFit) -> None:
    task = recorded(task="opposition", seed=4, n_frames=480)[1].take(slice(0, None, 40))
    costs = receiver_costs(fingertips(whole), task)
    receivers = whole.evidence.model.receivers
    assert [(cost.without, cost.layout) for cost in costs[:1]] == [("", "")]
    assert {cost.without for cost in costs[1:-2]} == set(receivers)
    assert [(cost.layout, cost.n_receivers) for cost in costs[-2:]] == [
        ("two-hands-7", 7),
        ("tips-and-hand", 6),
    ]
    dearest = [cost.flexion_sd_deg for cost in costs[1:-2]]
    assert dearest == sorted(dearest, reverse=True)
    for cost in costs[1:]:
        assert cost.centre_sd_mm >= costs[0].centre_sd_mm
        assert cost.flexion_sd_deg >= costs[0].flexion_sd_deg
    lost = {cost.without: cost.joint for cost in costs[1:-2]}
    assert lost["ring_distal"] == "ring_dip"
    assert costs[-1].flexion_sd_deg > costs[-2].flexion_sd_deg > 1.2 * costs[0].flexion_sd_deg
