"""A fitted hand drawn moving, from tables as a fit writes them."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from guide.average_joints import average_joints, posed
from guide.moving_hand import MODEL, fitted_hand, main
from schemas.catalogue import BONE_LENGTHS, BONE_POSES
from schemas.tables import Provenance, columns_from_rows, write_table
from skeleton.rotations import about_axis, multiply, rotate
from stages.simulate.random_hand import BONES
from stages.simulate.task_motion import range_postures, rest_posture

OF_FIT = {"subject": "01", "session": "", "hand": "right", "model": MODEL, "made_without": ""}
ROUNDS, PER_ROUND = 4, 60


def fitted_tables(results: Path) -> None:
    """Four rounds of a fist, the whole hand turned and away from the transmitter."""
    share = (1 - np.cos(np.linspace(0, 2 * np.pi * ROUNDS, ROUNDS * PER_ROUND))) / 2
    position, turn = posed(rest_posture() + share[:, None, None] * range_postures()["fist"][0])
    moved = about_axis(np.array([0.0, 0.6, 0.8]), 1.1)
    position, turn = rotate(moved, position) + np.array([260.0, 40.0, -120.0]), multiply(moved, turn)
    folder = results / "sub-01" / "fits" / "right" / MODEL
    folder.mkdir(parents=True)
    poses = [
        OF_FIT
        | {"task": "opposition", "trial": "", "segment": bone, "frame": frame}
        | dict(zip(("x_mm", "y_mm", "z_mm"), position[frame, b].tolist(), strict=True))
        | dict(zip(("qw", "qx", "qy", "qz"), turn[frame, b].tolist(), strict=True))
        for b, bone in enumerate(BONES)
        if bone != "forearm"
        for frame in range(len(share))
    ]
    write_table(folder / "bone_poses.parquet", BONE_POSES, columns_from_rows(BONE_POSES, poses), Provenance())
    texts = {column.name: "" for column in BONE_LENGTHS.columns if not column.nullable}
    bones = [
        texts
        | OF_FIT
        | {"digit": bone.split("_")[0], "bone": bone, "length_mm": average_joints().length_mm[b]}
        for b, bone in enumerate(BONES)
        if "_" in bone
    ]
    write_table(
        folder / "fitted_bones.parquet", BONE_LENGTHS, columns_from_rows(BONE_LENGTHS, bones), Provenance()
    )


def test_a_fitted_hand_is_drawn_in_its_own_frame_for_one_round(tmp_path: Path) -> None:
    fitted_tables(tmp_path)
    hand = fitted_hand(tmp_path, "01", "right")
    assert hand.origins_mm[:, BONES.index("hand")] == pytest.approx(
        np.zeros((len(hand.origins_mm), 3)), abs=1e-9
    )
    straight, _ = posed(rest_posture()[None])
    knuckle = BONES.index("index_proximal")
    assert hand.origins_mm[:, knuckle] == pytest.approx(
        np.tile(straight[0, knuckle], (len(hand.origins_mm), 1))
    )
    tip = hand.at("middle_distal", np.zeros(3))
    assert np.ptp(tip, axis=0).max() > 60  # open and closed, both
    step = np.linalg.norm(np.diff(np.concatenate([tip, tip[:1]]), axis=0), axis=-1)
    assert step[-1] < 1.5 * step.max()  # it ends where it began
    assert main([str(tmp_path), "--out", str(tmp_path / "hand.svg")]) == 0
    picture = (tmp_path / "hand.svg").read_text("utf-8")
    assert ElementTree.fromstring(picture).findtext("{http://www.w3.org/2000/svg}title")
    assert len(picture) < 150_000


def test_results_that_are_not_there_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path), "--out", str(tmp_path / "hand.svg")]) == 2
    assert "bone_poses.parquet" in capsys.readouterr().err


def test_the_readmes_hand_is_small() -> None:
    picture = (Path(__file__).parents[2] / "docs" / "hand-moving.svg").read_bytes()
    assert len(picture) < 150_000
    ElementTree.fromstring(picture)
