"""CSV export: poses, joint angles and the JSON header."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from simulated_hands import FITTED, REPLAYED, SimulatedHand

from shukotsu.export import exported_motion
from shukotsu.export.exported_motion import rest_pose
from shukotsu.export.tidy_csv import bone_angles_deg, write
from shukotsu.hand.joint_angles import joint_angles
from shukotsu.hand.known_digits import rest_rotations
from shukotsu.hand.rotations import angle, conjugate, multiply
from shukotsu.simulate.random_hand import JOINTS, PARENT


def test_every_exported_pose_is_read_back(hand: SimulatedHand, tmp_path: Path) -> None:
    motion = hand.motion(REPLAYED)
    assert write(motion, tmp_path / "a.csv") == ()
    rows = pd.read_csv(tmp_path / "a.csv")
    assert list(rows.columns) == ["frame", "time_s", "joint", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    np.testing.assert_array_equal(rows["frame"], motion.frame.repeat(25))
    np.testing.assert_allclose(rows["time_s"], motion.time_s.repeat(25))
    assert list(rows["joint"][:25]) == list(motion.names)
    position_mm = rows[["x_mm", "y_mm", "z_mm"]].to_numpy().reshape(motion.position_mm.shape)
    turn = rows[["qw", "qx", "qy", "qz"]].to_numpy().reshape(motion.quaternion.shape)
    np.testing.assert_allclose(position_mm, motion.position_mm, atol=1e-6)
    assert angle(multiply(conjugate(turn), motion.quaternion))[motion.known].max() < 1e-8


def test_exported_angles_equal_those_of_the_bones(hand: SimulatedHand) -> None:
    """They equal joint_angles of the same bones; the thumb has a separate test."""
    motion, truth, side = hand.motion(FITTED), hand.simulated.truth, hand.simulated.name.hand
    angles_deg = bone_angles_deg(motion)
    ours = truth.bone_quaternion
    rests = rest_rotations(hand.plan.layouts[side], side)
    compared = [name for name in angles_deg if name not in {"thumb_cmc", "thumb_mcp"}]
    assert len(compared) == 15
    for name in compared:
        index = JOINTS.index(name)
        expected = joint_angles(ours[:, PARENT[index]], ours[:, index + 1], side, rests[name])
        np.testing.assert_allclose(angles_deg[name], expected, atol=1e-6, err_msg=name)


def test_angles_that_a_model_assumes_are_empty_and_the_poses_complete(
    right: SimulatedHand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exported_motion, "assumed_angles", lambda _: {"little_cmc": "kept still"})
    motion = right.motion(REPLAYED)
    assert motion.notes == ("angles not measured: little_cmc (kept still)",)
    write(motion, tmp_path / "a.csv")
    rows = pd.read_csv(tmp_path / "a_angles.csv").set_index("joint")[["flexion_deg", "rotation_deg"]]
    assert rows.loc["little_cmc"].isna().all(axis=None)
    assert rows.drop("little_cmc").notna().all(axis=None)
    assert pd.read_csv(tmp_path / "a.csv").notna().all(axis=None)


def test_the_header_describes_columns_and_rest_pose(hand: SimulatedHand, tmp_path: Path) -> None:
    motion = hand.motion(FITTED)
    name = replace(motion.origin.recording, subject="山田 太郎")
    motion = replace(motion, origin=replace(motion.origin, licence="CC0", recording=name))
    write(motion.noting("resampled"), tmp_path / "a.csv")
    header = json.loads((tmp_path / "a.json").read_text("utf-8"))
    columns = {*pd.read_csv(tmp_path / "a.csv").columns, *pd.read_csv(tmp_path / "a_angles.csv").columns}
    assert set(header["columns"]) == columns
    assert header["subject"] == "山田 太郎"
    assert header["licence"] == "CC0"
    assert header["notes"] == ["resampled"]
    assert header["parent"]["index_pip"] == "index_mcp"
    assert header["inputs_sha256"] == motion.origin.inputs
    offset = header["rest_offset_mm"]["index_pip"]
    at_rest = rest_pose(motion)[0]
    span = at_rest[motion.index("index_pip")] - at_rest[motion.index("index_mcp")]
    assert abs(np.linalg.norm(offset) - np.linalg.norm(span)) < 1e-5
