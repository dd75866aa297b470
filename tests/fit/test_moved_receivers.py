"""Receivers that moved on the hand between the calibration and an evaluated recording."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from simulated_poses import recorded, write_poses

from shukotsu.fit.fingertips import fingertips
from shukotsu.fit.fit import FitSettings, HandFit, fit_hand
from shukotsu.fit.hand_tables import moved_rows
from shukotsu.fit.loose_receivers import LooseReceiver, Moment, displaced_in, moved_in
from shukotsu.fit.part_tables import UNSEEN_TURN_DEG, posed_blocks
from shukotsu.hand.rotations import about_axis, multiply, rotate
from shukotsu.study.findings import moved_finding
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import Poses, recording_name

pytestmark = pytest.mark.slow

LAYOUT = read_layout("liberty16")
_, Y, Z = np.eye(3)


def thinned(task: str) -> Poses:
    return recorded("right", task, seed=5, n_frames=3600)[1].take(slice(None, None, 12))


@cache
def fitted() -> HandFit:
    return fit_hand([thinned("rom")], LAYOUT, "right", settings=FitSettings(n_frames=40, rounds=1))


def moved(segment: str, axis: np.ndarray, deg: float, shift_mm: tuple[float, ...], first: int = 0) -> Poses:
    """Return the task with a receiver turned (deg) and shifted (mm) in its own frame from row `first` on."""
    poses = thinned("opposition")
    s, position, quaternion = poses.index(segment), poses.position_mm.copy(), poses.quaternion.copy()
    position[first:, s] += rotate(quaternion[first:, s], np.array(shift_mm))
    quaternion[first:, s] = multiply(quaternion[first:, s], about_axis(axis, np.radians(deg)))
    return replace(poses, position_mm=position, quaternion=quaternion)


@pytest.mark.parametrize(
    ("segment", "axis", "deg", "shift_mm", "first"),
    [
        ("index_middle", Z, 25.0, (4.0, 4.0, 0.0), 0),
        ("ring_proximal", Y, 15.0, (3.0, 0.0, 0.0), 150),
    ],
)
def test_a_moved_receiver_is_detected_with_shift_turn_and_frame(
    segment: str, axis: np.ndarray, deg: float, shift_mm: tuple[float, ...], first: int
) -> None:
    poses = moved(segment, axis, deg, shift_mm, first)
    (receiver,) = moved_in(fitted(), poses)
    assert (receiver.segment, receiver.slid) == (segment, False)
    assert receiver.start.frame == pytest.approx(poses.frame[first], abs=24)
    assert receiver.shift_mm == pytest.approx(np.linalg.norm(shift_mm), abs=1.5)
    assert receiver.turn_deg == pytest.approx(deg, abs=3.0)


def test_only_joints_and_tips_that_need_a_moved_receiver_are_empty(tmp_path: Path) -> None:
    tips = fingertips(fitted())
    poses = moved("index_distal", Y, 25.0, (0.0, 0.0, 0.0)).take(slice(0, 40))
    path = write_poses(tmp_path / "poses.parquet", poses, "right", "opposition")
    start = Moment(0, int(poses.frame[0]), float(poses.time_s[0]))
    receivers = [LooseReceiver("index_distal", start, start, np.radians([0.0, 0, 0, 0, 25, 0]))]
    (row,) = moved_rows(LAYOUT, recording_name(path), receivers)
    assert (row["segment"], row["from_frame"]) == ("index_distal", poses.frame[0])
    assert (row["joints"], row["digits"]) == ("index_dip", "index")
    sentence = moved_finding(row).message
    assert "index_distal is in another place in opposition than in the calibration" in sentence
    blocks = [next(posed_blocks(tips, path, receivers, calibrates=was)) for was in (False, True)]
    angles, ends = blocks[0]["joint_angles"], blocks[0]["posed_tips"]
    for names, values, lost in (
        (angles["joint"], angles["flexion_deg"], "index_dip"),
        (ends["digit"], ends["tip_x_mm"], "index"),
    ):
        of = np.array(names, object)
        assert {*of[np.isnan(values)]} == {lost}
        assert np.isnan(values[of == lost]).all()
    dip = np.array(angles["joint"], object) == "ring_dip"
    sd_deg, calibrated_sd_deg = (block["joint_angles"]["flexion_sd_deg"][dip] for block in blocks)
    assert np.sqrt(sd_deg**2 - calibrated_sd_deg**2) == pytest.approx(UNSEEN_TURN_DEG, rel=1e-6)


def test_no_receiver_is_called_moved_in_a_faultless_recording() -> None:
    assert not moved_in(fitted(), thinned("opposition"))


def test_poses_that_all_contradict_the_hand_name_no_field(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if a calibration in centimetres was read as millimetres: no pose is left to place a field by."""
    monkeypatch.setattr("shukotsu.fit.field_test.GROSS", 0.0)
    assert displaced_in(fitted(), [thinned("rom")]).field is None
