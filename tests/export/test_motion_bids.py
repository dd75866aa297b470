"""Motion-BIDS export: labels, validity, contents, gaps, and independence of the order of writing."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_fingers import blanked, moving_fingers, timed
from simulated_hands import FITTED, REPLAYED, SimulatedHand

from shukotsu.export.motion_bids import DESCRIPTION, label, recording_path, write, write_dataset_files
from shukotsu.export.tidy_csv import bone_angles_deg
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import angle, conjugate, multiply


@given(st.text(), st.text())
def test_labels_are_valid_and_unique_to_their_names(first: str, second: str) -> None:
    assert label(first).isascii()
    assert label(first).isalnum() or not first
    assert (label(first) == label(second)) == (first == second)


def add(motion: PosedRecording, folder: Path) -> tuple[str, ...]:
    return write(motion, folder / DESCRIPTION)


def skeleton_path(folder: Path, motion: PosedRecording) -> Path:
    return folder / f"{recording_path(motion.origin.recording, motion.origin.model)}_motion.tsv"


def table(path: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    beside = path.with_name(path.name.replace("_motion.tsv", "_channels.tsv"))
    channels = pd.read_csv(beside, sep="\t", keep_default_na=False)
    numbers = pd.read_csv(path, sep="\t", header=None, names=list(channels["name"]), na_values=["n/a"])
    return numbers, channels


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def named(motion: PosedRecording, **names: str) -> PosedRecording:
    licence = names.pop("licence", "")
    recording = replace(motion.origin.recording, **names)
    return replace(motion, origin=replace(motion.origin, recording=recording, licence=licence))


def with_gaps(motion: PosedRecording) -> PosedRecording:
    return blanked(motion, joints=np.s_[3:5, 2], receivers=np.s_[6, 1])


def with_assumed_angles(motion: PosedRecording) -> PosedRecording:
    joints = (
        replace(joint, assumed="kept still") if joint.name == "little_cmc" else joint
        for joint in motion.joints
    )
    return replace(motion, joints=tuple(joints))


def validate(folder: Path) -> list[dict[str, Any]]:
    """Return the issues reported by the BIDS validator, which needs no network."""
    program = Path(sys.executable).with_name("bids-validator-deno")
    if not program.is_file():
        pytest.skip("bids-validator-deno is not installed beside this Python")
    command = [program, str(folder), "--format", "json", "--max-rows", "-1"]
    report = json.loads(subprocess.run(command, capture_output=True, text=True, check=False).stdout)
    return list(report["issues"]["issues"])


KNOWN_WARNINGS = {
    "TOO_FEW_AUTHORS",
    "NO_AUTHORS",
    "EVENTS_TSV_MISSING",
    ("JSON_KEY_RECOMMENDED", "HEDVersion"),
    ("JSON_KEY_RECOMMENDED", "SourceDatasets"),
}
"""Warnings about contents that only the dataset's authors can add."""


def test_the_validator_finds_no_avoidable_issue(right: SimulatedHand, tmp_path: Path) -> None:
    """The dataset has names in other scripts, gaps, a single frame, assumed angles, and trials that are
    absent, numbers or text.
    """
    hand = named(right.motion(FITTED), licence="CC0")
    add(hand, tmp_path / "set")
    add(named(with_assumed_angles(right.motion(REPLAYED)), subject="assumed"), tmp_path / "set")
    drawn = with_gaps(moving_fingers(9))
    add(named(drawn, subject="山田 Ö.", task="ex-po_1", trial="2"), tmp_path / "set")
    add(named(drawn, subject="Q", hand="left", trial="pre op"), tmp_path / "set")
    frame = replace(named(drawn.take(slice(1)), subject="one"), rate_hz=float("nan"))
    assert add(frame, tmp_path / "set")[0].startswith("a sampling frequency")
    broken = named(drawn, subject="broken")
    add(broken, tmp_path / "set")
    next((tmp_path / "set" / "sub-broken").rglob("*righthand_channels.tsv")).unlink()
    issues = validate(tmp_path / "set")
    errors = [issue["location"] for issue in issues if issue["severity"] == "error"]
    assert errors
    assert all(location.startswith("/sub-broken/") for location in errors), "no other recording has errors"
    issues = [issue for issue in issues if not issue["location"].startswith("/sub-broken/")]
    codes = {issue["code"] for issue in issues} | {(i["code"], i.get("subCode")) for i in issues}
    assert "EVENTS_TSV_MISSING" in codes, "the validator looked at the recordings"
    avoidable = [i for i in issues if not {i["code"], (i["code"], i.get("subCode"))} & KNOWN_WARNINGS]
    assert {i.get("subCode") for i in avoidable} == {"SamplingFrequencyEffective"}, "one frame has no rate"
    assert all(i["location"].startswith("/sub-one/") for i in avoidable)


@pytest.mark.parametrize("model", [REPLAYED, FITTED])
def test_the_skeleton_is_read_back_by_pandas(hand: SimulatedHand, tmp_path: Path, model: str) -> None:
    """Positions are in metres, orientations quaternions, angles in degrees."""
    motion = hand.motion(model)
    assert add(motion, tmp_path) == ("receivers that have no pose in any frame: forearm",)
    numbers, channels = table(skeleton_path(tmp_path, motion))
    np.testing.assert_array_equal(numbers["frame"], motion.frame)
    np.testing.assert_array_equal(numbers["time"], motion.time_s)
    np.testing.assert_allclose(numbers["latency"], motion.time_s - motion.time_s[0], atol=5e-7)
    for index, joint in enumerate(motion.joints):
        position_mm = numbers[[f"{joint.name}_pos_{axis}" for axis in "xyz"]].to_numpy() * 1000
        np.testing.assert_allclose(position_mm, motion.position_mm[:, index], rtol=0, atol=1e-6)
        if not joint.tip:
            turn = numbers[[f"{joint.name}_quat_{part}" for part in "wxyz"]].to_numpy()
            off = angle(multiply(conjugate(turn), motion.quaternion[:, index]))
            assert np.degrees(off[motion.known[:, index]]).max() < 1e-6
    angles_deg = bone_angles_deg(motion)
    assert "index_mcp" in angles_deg
    columns = [f"{name}_{part}" for name in angles_deg for part in ("flexion", "abduction", "rotation")]
    np.testing.assert_allclose(numbers[columns], np.concatenate([*angles_deg.values()], 1), atol=1e-6)
    kinds = channels.groupby(["type", "units"]).size().to_dict()
    assert kinds == {
        ("JNTANG", "deg"): 3 * len(angles_deg), ("LATENCY", "s"): 1, ("MISC", "n/a"): 1, ("MISC", "s"): 1,
        ("ORNT", "n/a"): 80, ("POS", "m"): 3 * len(motion.joints),
    }  # fmt: skip
    sidecar = json.loads(skeleton_path(tmp_path, motion).with_suffix(".json").read_text("utf-8"))
    counted = [
        sidecar[f"{kind}ChannelCount"] for kind in ("Motion", "POS", "ORNT", "JNTANG", "MISC", "LATENCY")
    ]
    assert counted == [len(channels), 3 * len(motion.joints), 80, 3 * len(angles_deg), 2, 1]
    assert sidecar["TrackedPointsCount"] == len(motion.joints)
    assert sidecar["SamplingFrequency"] == pytest.approx(240)
    frames = json.loads(next(tmp_path.rglob("*skeleton*_channels.json")).read_text())["reference_frame"][
        "Levels"
    ]
    assert set(channels["reference_frame"]) == {"n/a", *frames}


def test_gaps_are_written_as_n_a_in_every_file(tmp_path: Path) -> None:
    motion = with_gaps(moving_fingers(9))
    time_s = motion.time_s.copy()
    time_s[7] = np.nan
    add(timed(motion, time_s=time_s), tmp_path)
    numbers, _ = table(skeleton_path(tmp_path, motion))
    gone = [name for name in numbers if name.startswith("index_mcp_")]
    assert np.argwhere(numbers[gone].isna().to_numpy())[:, 0].tolist() == [3] * 7 + [4] * 7
    assert np.flatnonzero(numbers["latency"].isna()).tolist() == [7]
    receivers, _ = table(tmp_path / f"{recording_path(motion.origin.recording)}_motion.tsv")
    assert receivers.isna().to_numpy().sum() == 7 + 2
    for path in tmp_path.rglob("*_motion.tsv"):
        cells = {cell for line in path.read_text().splitlines() for cell in line.split("\t")}
        assert "n/a" in cells
        assert not [cell for cell in cells if cell.lower() in ("", "nan", "inf", "-inf", "null", "none")]
        assert len({line.count("\t") for line in path.read_text().splitlines()}) == 1


def test_assumed_angles_are_written_as_n_a_with_the_reason(right: SimulatedHand, tmp_path: Path) -> None:
    motion = with_assumed_angles(right.motion(REPLAYED))
    add(motion, tmp_path)
    numbers, channels = table(skeleton_path(tmp_path, motion))
    empty = [f"little_cmc_{angle}" for angle in ("flexion", "abduction", "rotation")]
    assert list(numbers.columns[numbers.isna().all()]) == empty
    assert list(channels["name"][channels["status"] == "n/a"]) == empty
    assert {*channels["status_description"]} == {"n/a", "not measured: kept still"}


def test_dataset_files_describe_the_study_and_its_participants(tmp_path: Path) -> None:
    sizes = {"山田": {"hand_length_mm": 181.5, "sex": None}, "a\tb": {"hand_length_mm": None, "sex": "F"}}
    write_dataset_files(tmp_path, "The study", sizes, "CC0")
    described = json.loads((tmp_path / DESCRIPTION).read_text("utf-8"))
    assert (described["Name"], described["License"]) == ("The study", "CC0")
    participants = tmp_path / "participants.tsv"
    expected = [
        "participant_id\tname\thand_length_mm\tsex",
        "sub-Qx5c71xQx7530x\t山田\t181.5\tn/a",
        "sub-aQx9xb\ta b\tn/a\tF",
    ]
    assert participants.read_text("utf-8").splitlines() == expected
    columns = json.loads((tmp_path / "participants.json").read_text())
    assert list(columns) == ["name", "hand_length_mm", "sex"]
    assert columns["hand_length_mm"]["Units"] == "mm"
    before = content(tmp_path)
    write_dataset_files(tmp_path, "The study", dict(reversed(sizes.items())), "CC0")
    add(named(moving_fingers(9), subject="山田"), tmp_path)
    assert {name: data for name, data in content(tmp_path).items() if name in before} == before
    add(named(moving_fingers(9), subject="zz"), tmp_path)
    assert participants.read_text("utf-8").splitlines() == [*expected, "sub-zz\tzz\tn/a\tn/a"]
