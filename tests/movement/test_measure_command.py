"""The stage from a subject's tables to its own: a ridden and a fitted hand, against the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulated_poses import recorded
from small_study import QUICK, PlannedSubject, planned_subject
from stage_runs import measure_movement as main
from stage_runs import of_plan

from shukotsu.hand.joint_angles import joint_angles, joint_rotation
from shukotsu.hand.neutral_bones import neutral_rotations
from shukotsu.hand.posing import SkeletonJoint
from shukotsu.hand.rotations import Array
from shukotsu.simulate.random_hand import BONES
from shukotsu.study.layout import read_layout
from shukotsu.tables.catalogue import CLOCKS, EVENTS, TABLES
from shukotsu.tables.parts import part_metadata, parts_writer, read_part
from shukotsu.tables.typed_table import Provenance, columns_from_rows, read_table, rows_of, write_table

N_FRAMES, SEED = 1500, 4
FINGERS = ("index", "middle", "ring", "little")
ANGLES = ("flexion", "abduction", "rotation")
LAYOUT = read_layout("liberty16")
ONSETS_S = (0.5, 1.6, 2.7, 3.8, 4.0, 5.1)
Row = dict[str, Any]


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> PlannedSubject:
    """Both hands: calibrated on one task, measured in another."""
    recordings = [
        (hand, task, role)
        for hand in ("right", "left")
        for task, role in (("rom", "calibration"), ("opposition", "evaluation"))
    ]
    folder = tmp_path_factory.mktemp("movement")
    alone = QUICK.replace("steps: 10", "steps: 10, share_lengths: false")
    made = planned_subject(folder, recordings, ["rigid", "quick"], n_frames=N_FRAMES, seed=SEED, quick=alone)
    made.run_stages(reference=False)
    rows = [event("right", number, "tap", onset_s) for number, onset_s in enumerate(ONSETS_S)]
    rows += [event("right", 9, "hold", 1.0, 0.8), event("right", 10, "hold", 2.0, 0.8)]
    columns = columns_from_rows(EVENTS, rows)
    write_table(made.plan_file.with_name("events.parquet"), EVENTS, columns, Provenance())
    return made


def event(hand: str, number: int, name: str, onset_s: float, duration_s: float | None = None) -> Row:
    keys = {"subject": "01", "session": "", "hand": hand, "task": "opposition", "trial": "", "event": number}
    more = {"name": name, "onset_s": onset_s, "duration_s": duration_s, "source": "sheet", "message": ""}
    return keys | more


@pytest.fixture(scope="module")
def out(subject: PlannedSubject, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tables")
    assert run(subject, folder, f"--events={subject.plan_file.with_name('events.parquet')}") == 0
    return folder


def run(subject: PlannedSubject, out: Path, *options: str) -> int:
    return main([*of_plan("measure_movement", subject.plan_file), f"--out={out}", *options])


def rows_in(out: Path, name: str, **wanted: str) -> list[Row]:
    rows = rows_of(read_table(out / f"{name}.parquet", TABLES[name]))
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def test_a_calibration_recording_has_its_ranges_of_motion(out: Path) -> None:
    """Under the hand that is fitted whole; nothing else is measured in it."""
    truth = recorded("right", "rom", seed=SEED, n_frames=N_FRAMES)[0].truth
    true = {joint.name: joint.range_deg for joint in truth.joints.values()}
    rows = rows_in(out, "ranges_of_motion", task="rom", hand="right", angle="flexion")
    assert {row["model"] for row in rows} == {"quick"}
    found = {row["joint"]: row for row in rows}
    for name in FINGERS:
        row = found[f"{name}_pip"]
        assert row["full_range_deg"] == pytest.approx(true[f"{name}_pip"], abs=12)
        assert 0 < row["range_deg"] <= row["full_range_deg"]
        assert row["n_frames"] == N_FRAMES
    for table in ("fingertip_paths", "movement_cycles"):
        assert not rows_in(out, table, task="rom")


def true_angles_deg(hand: str) -> dict[str, Array]:
    """Angles (T, 3) of the fingers' joints, from the bones of the simulation."""
    truth = recorded(hand, "opposition", seed=SEED, n_frames=N_FRAMES)[0].truth
    found = {}
    for name in FINGERS:
        digit = LAYOUT.digits[name]
        joints = [SkeletonJoint(joint, 0, "") for joint in digit.joints]
        rests = neutral_rotations(LAYOUT, hand, joints)
        for parent, child, joint, rest in zip(
            (digit.base, *digit.segments), digit.segments, digit.joints, rests, strict=False
        ):
            above, below = (truth.bone_quaternion[:, BONES.index(bone)] for bone in (parent, child))
            if LAYOUT.joints[joint].dof:
                found[joint] = joint_angles(above, below, hand, rest)
    return found


@pytest.mark.parametrize("hand", ["right", "left"])
def test_angles_follow_from_bones_and_the_zero_in_joint_centres(subject: PlannedSubject, hand: str) -> None:
    """As docs/movement.md says, of the bones of another table."""
    plan, keys = subject.plan, {"hand": hand, "model": "quick"}

    def rows(name: str, path: Path) -> list[Row]:
        table = rows_of(read_table(path, TABLES[name]))
        return [row for row in table if all(row[key] == value for key, value in keys.items())]

    fit = subject.fit_folder(hand)
    turns: dict[str, list[list[float]]] = {}
    for row in rows("bone_poses", fit / "bone_poses.parquet"):
        if row["task"] == "opposition":
            turns.setdefault(row["segment"], []).append([row[f"q{part}"] for part in "wxyz"])
    stated: dict[str, list[list[float]]] = {}
    for row in rows("joint_angles", fit / "joint_angles.parquet"):
        if row["task"] == "opposition":
            stated.setdefault(row["joint"], []).append([row[f"{angle}_deg"] for angle in ANGLES])
    zeros = {row["joint"]: row for row in rows("joint_centres", plan.table("joint_centres"))}
    assert set(stated) == {name for name, row in zeros.items() if row["axes_turn_deg"] is not None}
    for digit in LAYOUT.digits.values():
        for parent, child, joint in zip(
            (digit.base, *digit.segments), digit.segments, digit.joints, strict=False
        ):
            if joint in stated:
                rest = joint_rotation(np.array([zeros[joint][f"rest_{angle}_deg"] for angle in ANGLES]), hand)
                axes = joint_rotation(np.array([0.0, 0.0, zeros[joint]["axes_turn_deg"]]), hand)
                found = joint_angles(np.array(turns[parent]), np.array(turns[child]), hand, rest, axes)
                np.testing.assert_allclose(found, stated[joint], atol=1e-4, err_msg=joint)


def test_what_a_model_without_stated_errors_says_is_weak(out: Path) -> None:
    """And where it cannot tell a metacarpal's motion, it says so."""
    rows = [row for row in rows_in(out, "ranges_of_motion", model="rigid") if row["range_deg"] is not None]
    assert {row["status"] for row in rows} == {"weak"}
    still = {row["joint"] for row in rows if "keeps the metacarpal still" in row["message"]}
    assert still == {f"{name}_mcp" for name in FINGERS} | {"ring_cmc", "little_cmc"}
    assert all("states no error" in row["message"] for row in rows)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_ranges_of_a_fitted_hand_are_as_far_off_as_stated(out: Path, hand: str) -> None:
    rows = {
        (row["joint"], row["angle"]): row
        for row in rows_in(out, "ranges_of_motion", hand=hand, task="opposition", model="quick")
    }
    assert len({joint for joint, _ in rows}) == 17
    assert len(rows) == 3 * 17
    off, sd, speed_ratio = [], [], []
    for joint, angles in true_angles_deg(hand).items():
        for index, angle in enumerate(ANGLES):
            row = rows[joint, angle]
            assert (row["n_frames"], row["valid_percent"]) == (N_FRAMES, 100.0)
            low, high = np.percentile(angles[:, index], [2.5, 97.5])
            off.append(row["range_deg"] - (high - low))
            sd.append(row["range_sd_deg"])
        speed = np.abs(np.gradient(angles[:, 0], 1 / 240))
        speed_ratio.append(rows[joint, "flexion"]["speed_p95_deg_s"] / np.percentile(speed, 95))
    assert np.mean(np.abs(off) < 1.96 * np.array(sd)) > 0.85
    assert np.sqrt(np.mean(np.square(sd))) < 2 * np.sqrt(np.mean(np.square(off)))
    assert np.median(speed_ratio) == pytest.approx(1.0, abs=0.1)


def test_cycles_are_cut_and_refused(out: Path) -> None:
    cycles = rows_in(out, "movement_cycles")
    assert {row["hand"] for row in cycles} == {"right"}
    taps = [row for row in cycles if row["event"] == "tap"]
    assert [row["used"] for row in taps] == [True, True, True, False, True]
    assert taps[3]["message"].startswith("too short")
    assert [row["duration_s"] for row in cycles if row["event"] == "hold"] == [0.8, 0.8]


def test_a_weak_clock_cuts_nothing(subject: PlannedSubject, tmp_path: Path) -> None:
    events = subject.plan_file.with_name("events.parquet")
    key = {"subject": "01", "session": "", "hand": "right", "task": "opposition", "trial": ""}
    row = {**key, "source": "sheet", "status": "weak", "message": "said"}
    row |= dict.fromkeys(("n_pulses", "n_missing", "n_extra"), 0)
    clocks = tmp_path / "clocks.parquet"
    write_table(clocks, CLOCKS, columns_from_rows(CLOCKS, [row]), Provenance())
    assert run(subject, tmp_path, f"--events={events}", f"--clocks={clocks}") == 0
    cycles = rows_in(tmp_path, "movement_cycles")
    assert {(row["used"], row["message"]) for row in cycles} == {(False, "the clock of its events is weak")}


def test_a_model_that_failed_has_no_rows_and_the_other_has(subject: PlannedSubject, tmp_path: Path) -> None:
    copy = subject.copied(tmp_path)
    fit = copy.fit_folder() / "joint_angles.parquet"
    with parts_writer(fit, TABLES["joint_angles"], Provenance()) as writer:
        writer.failure(copy.part("quick"), "no calibration recording is left")
    assert run(copy, tmp_path / "out") == 2
    assert run(copy, tmp_path / "out", "--record-failure") == 0
    path = tmp_path / "out" / "ranges_of_motion.parquet"
    parts = part_metadata(path, TABLES["ranges_of_motion"])
    assert "no calibration recording is left" in parts[copy.part("quick")]["failure"]
    assert read_part(path, TABLES["ranges_of_motion"], copy.part("rigid")).num_rows > 0
    assert read_part(path, TABLES["ranges_of_motion"], copy.part("quick", hand="left")).num_rows > 0
