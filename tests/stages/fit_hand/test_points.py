"""Hands measured by points without orientation: what is made of them, and what refuses them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulated_poses import recorded
from studies.running import write_study

from benchmarks.positions_only import BONES, DIGITS, JOINTS, Drawn
from benchmarks.positions_only import recorded as seen_by_a_camera
from shukotsu.anatomy.known_digits import refusal
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.model import read_model
from shukotsu.schemas.poses import Poses, read_poses
from shukotsu.stages.capture.__main__ import main as capture
from shukotsu.stages.fit_hand.fit import Settings, fit_hand
from shukotsu.stages.fit_hand.hand_tables import joint_rows

POINTS = read_layout("keypoints-21")


def keypoints(hand: str = "right") -> tuple[Poses, dict[str, float]]:
    """What a camera sees of a simulated hand, to 1 mm, and the bones' true lengths."""
    made, poses = recorded(hand, seed=4)
    truth = made.truth
    points = {joint: truth.bone_position_mm[:, JOINTS.index(joint) + 1] for joint in JOINTS}
    points |= {f"{digit}_tip": truth.skin_tip_mm[:, i] for i, digit in enumerate(DIGITS)}
    points["wrist"] = truth.bone_position_mm[:, 0]
    lengths = {bone: float(truth.hand.length_mm[BONES.index(bone)]) for bone in BONES if "_" in bone}
    drawn = Drawn(hand, {"rom": poses}, {"rom": points}, lengths)
    return seen_by_a_camera(drawn, "rom", POINTS, 1.0, np.random.default_rng(5)), lengths


def written(poses: Poses, folder: Path) -> tuple[Path, Path]:
    """The recording as a table of positions alone, and its mapping."""
    file, mapping = folder / "seen.csv", folder / "mapping.yaml"
    titles = [f"{name}_{axis}" for name in poses.segments for axis in "xyz"]
    rows = np.column_stack([poses.time_s, poses.position_mm.reshape(len(poses.frame), -1)])
    np.savetxt(file, rows, "%.17g", ",", header=",".join(["t", *titles]), comments="")
    columns = "".join(f"  {n}: {{position: [{n}_x, {n}_y, {n}_z]}}\n" for n in poses.segments)
    csv = "csv: {time: t, time_unit: s}\n"
    mapping.write_text(f"format: csv\nposition_unit: mm\nreceivers:\n{columns}{csv}")
    return file, mapping


def test_points_give_lengths_to_what_is_stated_whatever_stands_for_their_orientation() -> None:
    poses, lengths = keypoints("left")
    quick = Settings(n_frames=40, rounds=1)
    fit = fit_hand([poses], POINTS, "left", settings=quick)
    bones = {name: own for name, own in fit.bones.items() if not name.endswith("_distal")}
    off = np.array([(own.length_mm - lengths[name]) / own.sd_mm for name, own in bones.items()])
    assert np.sqrt((off**2).mean()) < 1.6
    rows = {row["joint"]: row for row in joint_rows(fit)}
    assert rows["index_pip"]["status"] == "ok"
    assert 1 < rows["index_pip"]["sd_mm"] < 4
    turned = np.random.default_rng(1).normal(size=poses.quaternion.shape)
    again = fit_hand([replace(poses, quaternion=turned)], POINTS, "left", settings=quick)
    assert [own.length_mm for own in again.bones.values()] == [own.length_mm for own in fit.bones.values()]


def test_positions_come_back_as_they_were_and_say_that_nothing_turned(tmp_path: Path) -> None:
    poses, _ = keypoints()
    file, mapping = written(poses, tmp_path)
    words = ["import", f"--in={file}", f"--mapping={mapping}", f"--out={tmp_path / 'poses.parquet'}"]
    words += ["--subject=01", "--hand=right", "--task=rom"]
    assert capture([*words, "--layout=keypoints-21"]) == 0
    back = read_poses(tmp_path / "poses.parquet", POINTS.expected)
    assert np.array_equal(back.position_mm, poses.position_mm, equal_nan=True)
    assert np.array_equal(back.valid, poses.valid)
    assert np.isnan(back.quaternion).all()
    mapping.write_text(mapping.read_text().replace("wrist_point: ", "hand: "))
    assert capture([*words, "--layout=keypoints-21"]) == 2  # of a receiver positions are not enough


def test_a_model_that_needs_receivers_that_turn_says_so_in_a_sentence() -> None:
    for name in ("keypoints-21", "tips-and-back"):
        reason = refusal(read_layout(name), "paper-fig4", read_model("paper-fig4"))
        assert "has points without orientation; take model whole-hand" in str(reason).replace(r"\n", " ")
        assert not refusal(read_layout(name), "whole-hand", read_model("whole-hand"))
    assert not refusal(read_layout("liberty16"), "paper-fig4", read_model("paper-fig4"))


@pytest.mark.slow
def test_a_study_of_points_comes_to_a_report(tmp_path: Path) -> None:
    file, mapping = written(keypoints()[0], tmp_path)
    rows = [f"01\tright\trom\tboth\t{file}"]
    study = write_study(tmp_path, "seen", rows, ["rigid", "whole-hand"], layout="keypoints-21")
    study.file.write_text(f"{study.file.read_text()}mapping: {mapping}\n")
    study.run()
    verdicts = {row["joint"]: row["verdict"] for row in study.rows_where("joint_centres", model="whole-hand")}
    assert verdicts["index_pip"] in ("believe", "care")
    assert any("layout keypoints-21 has points" in row["message"] for row in study.rows_where("problems"))
    (unchecked,) = study.rows_where("problems", kind="unchecked")
    assert "points that are exchanged do not show" in unchecked["message"]
