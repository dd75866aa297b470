"""The export command: file names, notes, refusals, recorded failures and collected exports."""

import os
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from simulated_hands import FITTED, REPLAYED, SimulatedHand, simulated_hand, simulated_hands
from stage_runs import collect_exports
from stage_runs import export as main

from shukotsu.tables.catalogue import BONE_POSES, FINDINGS, POSED_TIPS
from shukotsu.tables.poses import NUMBERS
from shukotsu.tables.typed_table import Provenance, columns_from_rows, write_table

STEM = f"sub-01_hand-right_task-opposition_model-{FITTED}"


def run(hand: SimulatedHand, out: Path, *argv: str, model: str = FITTED) -> int:
    """Export the hand's recording under one model, by default as BVH and CSV."""
    which = ["--plan", str(hand.plan_path), "--hand", hand.simulated.name.hand, "--recording", "opposition"]
    return main([*which, "--model", model, "--formats", "bvh,csv", "--out", str(out), *argv])


def test_joints_beyond_the_last_receiver_rest_and_are_noted(fresh: SimulatedHand, tmp_path: Path) -> None:
    for table, key, name in ((BONE_POSES, "segment", "little_distal"), (POSED_TIPS, "digit", "little")):
        rows = fresh.rows(FITTED, table)
        numbers = {column.name: None for column in table.columns if column.nullable}
        fresh.write(FITTED, table, [row | numbers if row[key] == name else row for row in rows])
    motion, ready = fresh.motion(FITTED), fresh.ready()
    beyond = [motion.index(joint) for joint in ("little_dip", "little_tip")]
    assert not motion.known[:, beyond].any()
    assert motion.notes == ("measured by no receiver: little_dip, little_tip",)
    middle, dip = ready.index("little_pip"), ready.index("little_dip")
    assert np.allclose(ready.quaternion[:, dip], ready.quaternion[:, middle])
    assert ready.whole.all()
    assert run(fresh, tmp_path) == 0
    assert "at rest in this file: little_dip, little_tip" in (tmp_path / f"{STEM}.bvh.txt").read_text("utf-8")


def test_exports_have_names_by_recording_and_notes_beside_them(
    right: SimulatedHand, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(right, tmp_path, "--licence", "CC BY 4.0") == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {f"{STEM}{end}" for end in (".bvh", ".bvh.txt", ".csv", "_angles.csv", ".json")}
    printed = capsys.readouterr()
    assert printed.out.splitlines() == [str(tmp_path / f"{STEM}.bvh"), str(tmp_path / f"{STEM}.csv")]
    assert "bvh: not in the file: device times" in printed.err
    note = (tmp_path / f"{STEM}.bvh.txt").read_text("utf-8")
    assert "licence: CC BY 4.0\n" in note
    assert f"  sub-01/fits/right/{FITTED}/bone_poses.parquet\n" in note
    assert str(tmp_path) not in note


def test_axis_rig_and_stiff_bones_show_in_the_exported_files(
    right: SimulatedHand, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = ["--transmitter-up=-z", "--rig", "mixamo", "--bones", "stiff"]
    assert run(right, tmp_path, *argv) == 0
    text, rows = (tmp_path / f"{STEM}.bvh").read_text(), pd.read_csv(tmp_path / f"{STEM}.csv")
    wrist_mm = rows[rows["joint"] == "mixamorig:RightHand"][["x_mm", "y_mm", "z_mm"]].to_numpy()
    root_cm = np.loadtxt(text.splitlines()[-len(wrist_mm) :])[:, :3]
    np.testing.assert_allclose(root_cm, wrist_mm[:, [0, 2, 1]] * [0.1, -0.1, 0.1], atol=1e-6)
    assert "JOINT mixamorig:RightHandIndex1\n" in text
    assert [line.split()[1] for line in text.splitlines() if "CHANNELS" in line] == ["6"] + ["3"] * 15
    assert "merged into the bones after them" in capsys.readouterr().err


def test_a_gap_is_refused_by_bvh_and_kept_by_csv(fresh: SimulatedHand, tmp_path: Path) -> None:
    rows = fresh.rows(FITTED, BONE_POSES)
    for row in rows:
        if row["segment"] == "index_middle" and 10 <= row["frame"] < 14:
            row |= dict.fromkeys(NUMBERS)
    fresh.write(FITTED, BONE_POSES, rows)
    out = tmp_path / "out"
    assert run(fresh, out) == 2
    assert not list(out.glob("*.bvh*"))
    cells = pd.read_csv(out / f"{STEM}.csv")
    assert cells["x_mm"].isna().sum() == 4
    assert run(fresh, out, "--gaps", "interpolate") == 0
    assert not pd.read_csv(out / f"{STEM}.csv")["x_mm"].isna().any()
    assert "\nFrames: 40\n" in (out / f"{STEM}.bvh").read_text()
    assert "1 gap (4 frames" in (out / f"{STEM}.bvh.txt").read_text("utf-8")


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["--formats", "bvh,fbx"], "'fbx' is not a format; expected one or more of"),
        (["--hand", "left"], "has no left hand of '01'; it has right"),
        (["--recording", "rom"], "'rom' is not one recording of the right hand"),
        (["--model", "rigid"], "has no model 'rigid'; it has paper-fig4, whole-hand"),
        (["--frames", "5000:"], "no frame of the recording is in 5000:"),
        (["--rig", "maya"], "there is no rig 'maya'"),
        (["--formats", "csv,bvh,bvh"], "--formats: bvh is listed twice; list each format"),
        (["--plan", "none/plan.json"], "none/plan.json: no such file"),
    ],
)
def test_an_impossible_export_is_refused_in_one_sentence(
    right: SimulatedHand, tmp_path: Path, capsys: pytest.CaptureFixture[str], argv: list[str], message: str
) -> None:
    assert run(right, tmp_path / "out", *argv) == 2
    lines = capsys.readouterr().err.splitlines()
    assert message in lines[-1]
    assert lines[-1].startswith("error: ")
    assert not (tmp_path / "out").exists()


def test_a_failure_can_be_recorded_beside_the_exports(right: SimulatedHand, tmp_path: Path) -> None:
    """It is recorded for a format, for a recording under a model, or for the subject, and removed by a
    success.
    """
    assert run(right, tmp_path, "--frames", "5000:", "--record-failure") == 0
    assert "no frame of the recording" in (tmp_path / f"{STEM}.failed.txt").read_text("utf-8")
    assert run(right, tmp_path, "--fps", "9", "--record-failure", "--rig", "maya") == 0
    for name in ("bvh", "csv"):
        assert "no rig 'maya'" in (tmp_path / f"{STEM}_{name}.failed.txt").read_text("utf-8")
    assert run(right, tmp_path) == 0
    assert not list(tmp_path.glob("*.failed.txt"))
    assert run(right, tmp_path, "--record-failure", model="none") == 0
    assert "has no model 'none'" in (tmp_path / "sub-01.failed.txt").read_text("utf-8")


def test_a_failed_model_does_not_prevent_exports_of_others(
    fresh: SimulatedHand, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fresh.write(FITTED, BONE_POSES, "the hand was not fitted")
    out = tmp_path / "out"
    assert run(fresh, out, "--record-failure", model=f"{FITTED},{REPLAYED}") == 0
    assert (out / f"{STEM}.failed.txt").read_text("utf-8") == "the hand was not fitted\n"
    assert (out / f"{STEM.replace(FITTED, REPLAYED)}.bvh").is_file()
    assert run(fresh, out, model=f"{FITTED},{REPLAYED}") == 2
    assert capsys.readouterr().err.endswith("error: the hand was not fitted\n")


def test_exports_of_a_hand_with_findings_state_that_there_are_some(
    fresh: SimulatedHand, tmp_path: Path
) -> None:
    finding = {"kind": "units", "severity": "suspect", "variant": "", "values": "", "accepted": ""}
    row = {**fresh.plan.recordings[0].key, **finding, "message": "in m"}
    findings = fresh.plan_path.with_name("findings.parquet")
    write_table(findings, FINDINGS, columns_from_rows(FINDINGS, [row]), Provenance())
    assert run(fresh, tmp_path) == 0
    note = (tmp_path / f"{STEM}.bvh.txt").read_text("utf-8")
    assert "leaves this hand out of its statistics: there are findings on " in note


@pytest.mark.slow
def test_without_filters_every_evaluated_recording_is_exported(tmp_path: Path) -> None:
    """Each hand has its own files under every model."""
    hand = simulated_hands(tmp_path, ["right", "left"], 40)[0]
    out = tmp_path / "out"
    argv = ["--plan", str(hand.plan_path), "--out", str(out)]
    assert main([*argv, "--formats", "csv"]) == 0
    stems = {
        f"sub-01_hand-{hand}_task-opposition_model-{model}"
        for hand in ("right", "left")
        for model in (REPLAYED, FITTED)
    }
    ends = (".csv", "_angles.csv", ".json")
    assert {path.name for path in out.iterdir()} == {f"{stem}{end}" for stem in stems for end in ends}


@pytest.mark.slow
def test_a_dataset_has_the_receivers_once_and_each_models_skeleton(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A failed model has no skeleton; participants are those exported, with the sheet's columns."""
    hands = []
    for subject in ("01", "02"):
        (tmp_path / subject).mkdir()
        hands.append(simulated_hand(tmp_path / subject, "right", 40, subject))
    hands[1].write(FITTED, BONE_POSES, "the hand was not fitted")
    sheet, out = tmp_path / "participants.tsv", tmp_path / "out"
    sheet.write_text("subject\thand_length_mm\n01\t180\n03\t190\n", "utf-8")
    argv = ["--plan", *(str(hand.plan_path) for hand in hands), "--participants", str(sheet)]
    assert main([*argv, "--formats", "bids", "--licence", "CC0", "--out", str(out)]) == 2
    assert capsys.readouterr().err.endswith("error: the hand was not fitted\n")
    skeletons = {"01": ("", "skeletonpaperQdfig4", "skeletonwholeQdhand"), "02": ("", "skeletonpaperQdfig4")}
    assert {path.name for path in out.rglob("*_motion.tsv")} == {
        f"sub-{subject}_task-opposition_tracksys-righthand{skeleton}_motion.tsv"
        for subject, of_subject in skeletons.items()
        for skeleton in of_subject
    }
    table = (out / "bids" / "participants.tsv").read_text("utf-8").splitlines()
    assert [line.split("\t")[0] for line in table] == ["participant_id", "sub-01", "sub-02"]
    assert table[1].split("\t")[2].startswith("180")
    assert '"License": "CC0"' in (out / "bids" / "dataset_description.json").read_text("utf-8")


@pytest.mark.parametrize("links", [True, False])
def test_exports_of_all_subjects_are_collected_in_one_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    """Hidden files are left out, existing files replaced, and files copied if links are not possible."""
    for name in ("one/a.bvh", "one/.hidden", "two/b.bvh", "two/bids/sub-01/b.tsv", "out/a.bvh"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    if not links:
        monkeypatch.setattr(os, "link", _refuse)
    folders, out = [str(tmp_path / "one"), str(tmp_path / "two")], tmp_path / "out"
    assert collect_exports(["--folders", *folders, "--out", str(out)]) == 0
    texts = {path.relative_to(out).as_posix(): path.read_text() for path in out.rglob("*") if path.is_file()}
    expected = {"a.bvh": "one/a.bvh", "b.bvh": "two/b.bvh", "bids/sub-01/b.tsv": "two/bids/sub-01/b.tsv"}
    assert texts == expected
    assert (out / "a.bvh").samefile(tmp_path / "one" / "a.bvh") == links


def test_a_failed_copy_leaves_the_existing_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("one/a.bvh", "out/a.bvh"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text(name)

    def half(_: Path, target: Path) -> None:
        target.write_text("ha")
        raise OSError("the disk is full")

    monkeypatch.setattr(os, "link", _refuse)
    monkeypatch.setattr(shutil, "copy2", half)
    assert collect_exports(["--folders", str(tmp_path / "one"), "--out", str(tmp_path / "out")]) == 2
    assert [path.read_text() for path in (tmp_path / "out").iterdir()] == ["out/a.bvh"]


def _refuse(*_: object) -> None:
    raise OSError("no links")
