"""The measure_movement stage, on a simulated subject who plays keys: results equal what was simulated."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from simulated_poses import recorded, write_poses
from small_study import QUICK, PlannedSubject, planned_subject, run_stages
from stage_runs import measure_movement as main
from stage_runs import of_plan

from benchmarks.keystrokes import Played, play
from shukotsu.arrays import Array
from shukotsu.errors import InputError
from shukotsu.hand.joint_angles import joint_angles, joint_rotation
from shukotsu.hand.neutral_bones import neutral_rotations
from shukotsu.hand.posing import SkeletonJoint
from shukotsu.simulate.random_hand import BONES
from shukotsu.study.layout import read_layout
from shukotsu.tables.catalogue import CLOCKS, EVENTS, TABLES
from shukotsu.tables.typed_table import Provenance, columns_from_rows, read_table, rows_of, write_table

N_FRAMES, SEED, TASK = 1500, 4, "opposition"
pytestmark = pytest.mark.slow

FINGERS = ("index", "middle", "ring", "little")
ANGLES = ("flexion", "abduction", "rotation")
LAYOUT = read_layout("liberty16")
TAPS_S = (0.5, 1.6, 2.7, 3.8, 4.0, 5.1)
UNFITTED = "no calibration recording is left"
Row = dict[str, Any]


@dataclass
class Measured:
    """A subject with a playing right hand and a failed fit of the left hand, and the stage's tables."""

    subject: PlannedSubject
    played: Played
    out: Path

    def rows(self, table: str, **wanted: Any) -> list[Row]:
        """Return the rows of a table with the wanted values."""
        rows = rows_of(read_table(self.out / f"{table}.parquet", TABLES[table]))
        return [row for row in rows if all(row[key] == value for key, value in wanted.items())]

    @cached_property
    def strokes(self) -> list[Row]:
        """The right hand's strokes under the fitted model, in order of events."""
        return sorted(self.rows("event_strokes", model="quick"), key=lambda row: row["event"])


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Measured:
    """Both hands calibrated on rom, with a weak clock of the left hand's events."""
    folder = tmp_path_factory.mktemp("movement")
    recordings = [
        (hand, task, role)
        for hand in ("right", "left")
        for task, role in (("rom", "calibration"), (TASK, "evaluation"))
    ]
    recordings.append(("right", "keys", "evaluation"))
    alone = QUICK.replace("steps: 10", "steps: 10, share_lengths: false")
    subject = planned_subject(
        folder, recordings, ["rigid", "quick"], n_frames=N_FRAMES, seed=SEED, quick=alone
    )
    played = play(SEED, "right", 0.4, 10.0)
    write_poses(subject.poses("keys"), played.poses, "right", "keys")
    assert subject.fit("right") == 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shukotsu.fit.calibration.fit_hand", failing)
        assert subject.fit("left", "--record-failure") == 0
    run_stages(subject.plan_file, "--record-failure")
    write_events(subject, played)
    assert main([*of_plan("measure_movement", subject.plan_file), f"--out={folder / 'tables'}"]) == 0
    return Measured(subject, played, folder / "tables")


def failing(*_: Any, **__: Any) -> None:
    raise InputError(UNFITTED)


def write_events(subject: PlannedSubject, played: Played) -> None:
    rows = []
    for number, stroke in enumerate(played.strokes):
        duration_s = stroke.up_s - stroke.contact_s
        row = event("right", number, f"note {stroke.pitch}", stroke.contact_s, duration_s)
        rows.append(row | {"task": "keys"})
    rows[3] |= {"name": f"note {played.strokes[3].pitch} {played.strokes[3].digit}"}
    rows[4] |= {"onset_sd_ms": 30.0}
    rows[5] |= {"onset_s": 0.5, "duration_s": 0.1}
    for hand in ("right", "left"):
        names = [*((onset_s, "tap", None) for onset_s in TAPS_S), (1.0, "hold", 0.8), (2.0, "hold", 0.8)]
        if hand == "right":
            rows += [event(hand, len(rows) + n, "bend", 1.0 + n, None) | {"task": "rom"} for n in range(3)]
        more = [(0.5, "lamp", 0.1), *([(1.0, "note 60", 0.1)] if hand == "left" else [])]
        for onset_s, name, duration_s in [*names, *more]:
            rows.append(event(hand, len(rows), name, onset_s, duration_s))
    clock = {"subject": "01", "session": "", "trial": "", "source": "midi", "message": ""}
    clock |= dict.fromkeys(("n_pulses", "n_missing", "n_extra"), 0)
    recordings = [("right", TASK, "ok"), ("right", "keys", "ok"), ("left", TASK, "weak")]
    clocks = [clock | dict(zip(("hand", "task", "status"), keys, strict=True)) for keys in recordings]
    for table, table_rows in ((EVENTS, rows), (CLOCKS, clocks)):
        path = subject.plan_file.with_name(f"{table.name}.parquet")
        write_table(path, table, columns_from_rows(table, table_rows), Provenance())


def event(hand: str, number: int, name: str, onset_s: float, duration_s: float | None) -> Row:
    keys = {"subject": "01", "session": "", "hand": hand, "task": TASK, "trial": "", "event": number}
    times = {"onset_s": onset_s, "duration_s": duration_s, "onset_sd_ms": 1.0}
    return keys | times | {"name": name, "source": "midi", "message": ""}


def test_a_calibration_recording_is_measured_too(measured: Measured) -> None:
    """It has ranges and speeds of joints, fingertip paths and cycles, under every model."""
    truth = recorded("right", "rom", seed=SEED, n_frames=N_FRAMES)[0].truth
    rows = measured.rows("ranges_of_motion", task="rom", angle="flexion")
    assert {(row["hand"], row["model"]) for row in rows if row["range_deg"] is not None} == {
        ("right", "quick"), ("right", "rigid"), ("left", "rigid")
    }  # fmt: skip
    by_joint = {row["joint"]: row for row in rows if (row["hand"], row["model"]) == ("right", "quick")}
    for name in FINGERS:
        row = by_joint[f"{name}_pip"]
        assert row["full_range_deg"] == pytest.approx(truth.joints[f"{name}_pip"].range_deg, abs=12)
        assert 0 < row["range_deg"] <= row["full_range_deg"]
        assert row["n_frames"] == N_FRAMES
        assert row["speed_p95_deg_s"] > row["speed_median_deg_s"] > 0
    ways = measured.rows("fingertip_paths", task="rom", hand="right", model="quick")
    assert all(row["path_length_mm"] > 100 and row["path_sd_mm"] > 0 for row in ways)
    assert {row["digit"] for row in ways} == {"thumb", *FINGERS}
    assert [row["used"] for row in measured.rows("movement_cycles", task="rom")] == [True] * 2


def digits_joints() -> list[tuple[str, str, str]]:
    """Return the digits' joints, each with the segments above and below it."""
    return [
        (joint, parent, child)
        for digit in LAYOUT.digits.values()
        for joint, parent, child in zip(
            digit.joints, (digit.base, *digit.segments), digit.segments, strict=False
        )
    ]


def test_angles_follow_from_bone_poses_and_the_zero_posture(measured: Measured) -> None:
    """Angles computed from bone_poses and joint_centres as in docs/movement.md equal those of
    joint_angles.
    """
    subject, part = measured.subject, measured.subject.part("quick")

    def table(path: Path) -> pd.DataFrame:
        rows = read_table(path, TABLES[path.stem]).to_pandas()
        return rows[(rows["hand"] == "right") & (rows["model"] == part.model)]

    fit = subject.fit_folder()
    bones, angles = (
        rows[rows["task"] == TASK].groupby(key)[columns]
        for rows, key, columns in (
            (table(fit / "bone_poses.parquet"), "segment", [f"q{axis}" for axis in "wxyz"]),
            (table(fit / "joint_angles.parquet"), "joint", [f"{angle}_deg" for angle in ANGLES]),
        )
    )
    turns, stated = ({str(name): rows.to_numpy() for name, rows in groups} for groups in (bones, angles))
    zeros = table(subject.plan.table("joint_centres")).set_index("joint")
    assert set(stated) == set(zeros.index[zeros["axes_turn_deg"].notna()])
    for joint, parent, child in digits_joints():
        if joint in stated:
            zero = zeros.loc[joint]
            rest = joint_rotation(np.array([zero[f"rest_{angle}_deg"] for angle in ANGLES]), "right")
            axes = joint_rotation(np.array([0.0, 0.0, zero["axes_turn_deg"]]), "right")
            angles_deg = joint_angles(turns[parent], turns[child], "right", rest, axes)
            np.testing.assert_allclose(angles_deg, stated[joint], atol=1e-4, err_msg=joint)


def test_results_of_a_model_without_stated_errors_are_weak(measured: Measured) -> None:
    """Joints of metacarpals that the model keeps still have no angles; the message states this."""
    every = measured.rows("ranges_of_motion", model="rigid", task=TASK)
    fixed = [row for row in every if row["message"] == "the model keeps the metacarpal fixed in the hand"]
    assert {(row["joint"], row["status"], row["range_deg"]) for row in fixed} == {
        (joint, "failed", None) for joint in ("ring_cmc", "little_cmc")
    }
    rows = [row for row in every if row["range_deg"] is not None]
    assert {(row["status"], row["hand"]) for row in rows} == {("weak", "right"), ("weak", "left")}
    still = {row["joint"] for row in rows if "keeps the metacarpal fixed" in row["message"]}
    assert still == {f"{name}_mcp" for name in FINGERS}
    assert all("states no error" in row["message"] for row in rows)
    truth = recorded("left", TASK, seed=SEED, n_frames=N_FRAMES)[0].truth
    for row in rows:
        if (row["hand"], row["angle"]) == ("left", "flexion") and row["joint"].endswith("_pip"):
            assert row["full_range_deg"] == pytest.approx(truth.joints[row["joint"]].range_deg, abs=12)


def true_angles_deg() -> dict[str, Array]:
    """Return the angles (T, 3) of the right fingers' joints from the simulated bones."""
    turns = recorded("right", TASK, seed=SEED, n_frames=N_FRAMES)[0].truth.bone_quaternion
    angles_deg = {}
    for joint, parent, child in digits_joints():
        if LAYOUT.joints[joint].dof and not joint.startswith("thumb"):
            (rest,) = neutral_rotations(LAYOUT, "right", [SkeletonJoint(joint, 0, "")])
            above, below = (turns[:, BONES.index(bone)] for bone in (parent, child))
            angles_deg[joint] = joint_angles(above, below, "right", rest)
    return angles_deg


def test_range_errors_of_a_fitted_hand_agree_with_the_stated_ones(measured: Measured) -> None:
    rows = {
        (row["joint"], row["angle"]): row
        for row in measured.rows("ranges_of_motion", task=TASK, model="quick", hand="right")
    }
    assert len({joint for joint, _ in rows}) == 17
    assert len(rows) == 3 * 17
    off, sd, speed_ratio = [], [], []
    for joint, angles in true_angles_deg().items():
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


def test_only_a_failed_model_has_no_numbers(measured: Measured) -> None:
    rows = measured.rows("ranges_of_motion", hand="left", model="quick")
    assert len(rows) == 2 * 15, "every solved joint, in both recordings"
    assert {(row["range_deg"], row["status"], row["message"]) for row in rows} == {(None, "failed", UNFITTED)}
    assert not measured.rows("fingertip_paths", hand="left", model="quick")
    assert measured.rows("fingertip_paths", hand="left", model="rigid")


def test_cycles_are_cut_by_events_and_short_ones_refused(measured: Measured) -> None:
    cycles = measured.rows("movement_cycles", hand="right", task=TASK)
    taps = [row for row in cycles if row["event"] == "tap"]
    assert [row["used"] for row in taps] == [True, True, True, False, True]
    assert taps[3]["message"].startswith("too short")
    assert [row["duration_s"] for row in cycles if row["event"] == "hold"] == [0.8, 0.8]


def test_cycle_curves_average_the_angles_over_the_used_cycles(measured: Measured) -> None:
    """There are curves of whole-hand models only; they equal NumPy's from the tables of angles and cycles."""
    rows = pd.DataFrame(measured.rows("cycle_curves", task=TASK))
    assert set(zip(rows["hand"], rows["model"], strict=True)) == {("right", "quick")}, "left: a weak clock"
    assert set(rows["event"]) == {"tap", "hold", "lamp"}
    assert rows.groupby("joint").size().eq(3 * 3 * 101).all()
    assert rows["joint"].nunique() == 17
    angles = pd.DataFrame(
        read_table(measured.subject.fit_folder() / "joint_angles.parquet", TABLES["joint_angles"]).to_pandas()
    )
    angles = angles[(angles["joint"] == "ring_pip") & (angles["task"] == TASK)].sort_values("frame")
    courses = [
        np.interp(
            np.linspace(row["onset_s"], row["onset_s"] + row["duration_s"], 101),
            angles["time_s"],
            angles["flexion_deg"],
        )
        for row in measured.rows("movement_cycles", hand="right", task=TASK, event="tap", used=True)
    ]
    curve = rows[(rows["joint"] == "ring_pip") & (rows["angle"] == "flexion") & (rows["event"] == "tap")]
    assert curve["cycle_percent"].tolist() == list(range(101))
    assert set(curve["n_cycles"]) == {len(courses)} == {4}
    np.testing.assert_allclose(curve["mean_deg"], np.mean(courses, axis=0), atol=1e-6)
    np.testing.assert_allclose(curve["sd_deg"], np.std(courses, axis=0, ddof=1), atol=1e-6)


def test_events_on_a_weak_clock_are_not_used(measured: Measured) -> None:
    cycles = measured.rows("movement_cycles", hand="left")
    assert {(row["used"], row["message"]) for row in cycles} == {(False, "the clock of its events is weak")}
    (stroke,) = measured.rows("event_strokes", hand="left")
    assert (stroke["used"], stroke["message"]) == (False, "its clock is uncertain: its status is weak")


def test_strokes_match_those_played(measured: Measured) -> None:
    rows, played = measured.strokes, measured.played.strokes
    assert [row["event"] for row in rows] == list(range(len(played))), "a lamp is not a stroke"
    pairs = [pair for pair in zip(rows, played, strict=True) if pair[0]["event"] != 5]
    used = [(row, stroke) for row, stroke in pairs if row["used"]]
    assert len(used) > 0.9 * len(pairs)
    assert np.mean([row["digit"] == stroke.digit for row, stroke in used]) > 0.95
    lag_ms = np.array([1e3 * (row["key_down_s"] - stroke.contact_s) for row, stroke in used])
    assert np.abs(lag_ms).max() < 4
    speed = np.array([row["contact_speed_mm_s"] / stroke.speed_mm_s for row, stroke in used])
    assert np.mean(speed) == pytest.approx(1.0, abs=0.05)
    assert np.std(speed) < 0.08
    assert all(row["peak_speed_before_mm_s"] >= row["contact_speed_mm_s"] for row, _ in used)
    for model in ("rigid", "quick"):
        row = measured.rows("event_strokes", model=model, hand="right")[3]
        assert (row["contact_speed_sd_mm_s"] is None) == (model == "rigid"), "only fitted hands state errors"


def test_named_digits_are_used_and_uncertain_strokes_are_not(measured: Measured) -> None:
    named, late, other = measured.strokes[3:6]
    assert (named["digit"], named["used"]) == (measured.played.strokes[3].digit, True)
    assert (late["used"], late["digit"]) == (False, "")
    assert late["message"] == "1-sigma error of its onset: 30 ms, more than 10 ms"
    assert (other["used"], other["digit"]) == (False, ""), "no digit moved down then"
    assert other["message"].startswith("no digit of this hand moved down")
