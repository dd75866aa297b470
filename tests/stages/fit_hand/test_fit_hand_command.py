"""The stage on files: what it writes, what it refuses, and what sheets of measurements and touches do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from pipeline import Row, import_recording

from kinematics.rotations import multiply, rotate
from schemas.catalogue import TABLES
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.tables import column_array, read_table, rows_of
from stages.estimate_metacarpals.__main__ import main as estimate_metacarpals
from stages.evaluate_tips.__main__ import main as evaluate_tips
from stages.fit_hand.__main__ import OUTPUTS, main
from stages.fit_hand.calibration import read_thinned
from stages.project_planes.__main__ import main as project_planes
from stages.simulate.realism import Realism
from stages.simulate.recording import tidy
from stages.simulate.simulation import Simulated, simulate
from stages.solve_joints.__main__ import main as solve_joints

FAST = (
    "model: quick\ndescription: a whole hand, fitted in few frames\n"
    "joints: {solver: anatomical, calibration: all}\nplanes: {cut: false}\n"
    "fit: {whole_hand: true, frames: 40}\nown_cmc: [thumb_cmc, index_cmc, middle_cmc, ring_cmc, little_cmc]\n"
    "metacarpals: {unmeasured: fitted, measured: fitted}\n"
)


class Study:
    """Recordings of a right hand and a left one, captured and solved joint by joint."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.made: dict[tuple[str, str], Simulated] = {}
        self.model = folder / "quick.yaml"
        self.model.write_text(FAST)
        for side, task, n in (("right", "rom", 2400), ("left", "rom", 2400), ("right", "opposition", 800)):
            made = self.made[side, task] = simulate("01", side, task, 6, Realism.full(), n)
            pq.write_table(tidy(made), folder / f"{side}-{task}.raw.parquet")
            import_recording(
                folder / f"{side}-{task}.raw.parquet", self.poses(side, task), hand=side, task=task
            )
        assert solve_joints([*self.common, self.option("poses"), f"--out={folder / 'solved.parquet'}"]) == 0
        words = [f"--joints={folder / 'solved.parquet'}", f"--out={folder / 'projected.parquet'}"]
        assert project_planes([*self.common, *words]) == 0

    @property
    def common(self) -> list[str]:
        """What every stage is told."""
        return ["--layout=liberty16", f"--model={self.model}"]

    def poses(self, side: str = "right", task: str = "rom") -> Path:
        """A recording's poses."""
        return self.folder / f"{side}-{task}.parquet"

    def option(self, name: str, side: str = "right", task: str = "rom") -> str:
        """A word that gives a recording's poses."""
        return f"--{name}={self.poses(side, task)}"

    def fit(self, out: Path, *words: str) -> int:
        """Run the stage; give its exit code."""
        out.mkdir(exist_ok=True)
        outputs = [
            f"--{name.replace('_', '-')}={out / table}.parquet" for name, (table, _) in OUTPUTS.items()
        ]
        joints = f"--joints={self.folder / 'projected.parquet'}"
        return main([*self.common, self.option("poses"), joints, *outputs, *words])


def rows(folder: Path, table: str) -> list[Row]:
    return list(rows_of(read_table(folder / f"{table}.parquet", TABLES[table])))


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return Study(tmp_path_factory.mktemp("study"))


@pytest.fixture(scope="module")
def fitted(study: Study) -> Path:
    """What the stage wrote of the right hand, alone, posed in opposition."""
    out = study.folder / "fitted"
    assert study.fit(out, study.option("replay", task="opposition")) == 0
    return out


def test_every_joint_of_the_hand_has_its_place(study: Study, fitted: Path) -> None:
    layout = read_layout("liberty16")
    joints = {row["joint"]: row for row in rows(fitted, "joint_centres")}
    assert set(joints) == {*layout.joints}
    assert {row["status"] for row in joints.values()} <= {"ok", "weak"}
    truth = study.made["right", "rom"].truth.joints
    off = [
        np.linalg.norm([joints[name][f"child_{a}_mm"] - true.child_mm[i] for i, a in enumerate("xyz")])
        for name, true in truth.items()
        if true.parent_segment
    ]
    assert len(off) == 15
    assert np.median(off) < 2.0
    assert max(off) < 6.0
    for name in ("index_cmc", "little_cmc"):
        assert joints[name]["parent_segment"] == "hand"
        assert joints[name]["parent_x_mm"] is not None
        assert joints[name]["child_x_mm"] is None


def test_bones_and_receivers_carry_their_uncertainty(study: Study, fitted: Path) -> None:
    hand = study.made["right", "rom"].truth
    bones = {row["bone"]: row for row in rows(fitted, "bone_lengths")}
    assert len(bones) == 19
    assert all(0.2 < row["bone_sd_mm"] < 4.0 for row in bones.values())
    receivers = {row["segment"]: row for row in rows(fitted, "receivers")}
    assert list(receivers) == list(hand.mounts.segments)
    assert {row["status"] for row in receivers.values()} == {"ok"}
    tipped = [segment for segment, row in receivers.items() if row["soft_tip_sd_mm"] is not None]
    assert tipped == [segment for segment in receivers if segment.endswith("_distal")]
    gains = rows(fitted, "gains")
    after = [row["mean_sd_after_mm"] for row in gains]
    assert after == sorted(after)
    assert all(row["mean_sd_after_mm"] <= row["mean_sd_before_mm"] for row in gains)


def test_angles_bones_and_tips_of_a_recording(study: Study, fitted: Path) -> None:
    n = len(study.made["right", "opposition"].frame)
    angles = read_table(fitted / "joint_angles.parquet", TABLES["joint_angles"])
    assert angles.num_rows == 17 * n
    assert set(angles.column("task").unique().to_pylist()) == {"opposition"}
    poses = read_table(fitted / "bone_poses.parquet", TABLES["bone_poses"])
    assert poses.num_rows == 20 * n
    tips = read_table(fitted / "posed_tips.parquet", TABLES["posed_tips"])
    assert tips.num_rows == 5 * n
    seen, blind = column_array(tips, "error_mm"), column_array(tips, "error_left_out_mm")
    assert np.isfinite(seen).all()
    tried = np.isfinite(blind)
    assert 400 * 5 <= tried.sum() <= 512 * 5
    assert seen[tried].mean() < blind[tried].mean() < 1.5


def test_the_chain_goes_on_with_the_fitted_hand(study: Study, fitted: Path) -> None:
    """Metacarpals are those of the fit, the replay's tip is near the receiver."""
    out = study.folder / "after"
    out.mkdir()
    words = [
        f"--joints={fitted / 'joint_centres.parquet'}",
        study.option("calibration"),
        study.option("poses", task="opposition"),
        f"--fitted-bones={fitted / 'bone_lengths.parquet'}",
        f"--bone-poses={fitted / 'bone_poses.parquet'}",
        f"--out-joints={out / 'joint_centres.parquet'}",
        f"--out-bones={out / 'bone_lengths.parquet'}",
        f"--out={out / 'metacarpals.parquet'}",
    ]
    assert estimate_metacarpals([*study.common, *words]) == 0
    bones = {row["bone"]: row for row in rows(out, "bone_lengths")}
    of_fit = {row["bone"]: row for row in rows(fitted, "bone_lengths")}
    for name in ("index_metacarpal", "thumb_metacarpal"):
        assert bones[name]["length_mm"] == of_fit[name]["length_mm"]
    assert bones["index_proximal"]["bone_mm"] == of_fit["index_proximal"]["length_mm"]
    assert bones["index_proximal"]["length_mm"] == pytest.approx(bones["index_proximal"]["bone_mm"], abs=0.5)
    posed = {
        (row["digit"], row["frame"]): row for row in rows(out, "metacarpals") if row["digit"] == "little"
    }
    of_fit_poses = [row for row in rows(fitted, "bone_poses") if row["segment"] == "little_metacarpal"]
    assert [posed["little", row["frame"]]["qx"] for row in of_fit_poses] == [
        row["qx"] for row in of_fit_poses
    ]
    words = [
        study.option("calibration"),
        study.option("poses", task="opposition"),
        f"--joints={out / 'joint_centres.parquet'}",
        f"--bones={out / 'bone_lengths.parquet'}",
        f"--metacarpals={out / 'metacarpals.parquet'}",
        f"--out={out / 'tips.parquet'}",
        f"--out-errors={out / 'tip_errors.parquet'}",
    ]
    assert evaluate_tips([*study.common, *words]) == 0
    errors = [row for row in rows(out, "tip_errors") if row["binding"] == "least-squares"]
    assert len(errors) == 5
    assert all(row["held_out"] and row["mean_mm"] < 4.0 for row in errors)


def test_the_other_hand_sharpens_the_lengths(study: Study, fitted: Path) -> None:
    out = study.folder / "both"
    assert study.fit(out, study.option("other-poses", side="left")) == 0
    alone = {row["bone"]: row for row in rows(fitted, "bone_lengths")}
    both = {row["bone"]: row for row in rows(out, "bone_lengths")}
    assert all(both[name]["sd_mm"] < alone[name]["sd_mm"] for name in alone)


def measured(study: Study, name: str, *lines: str) -> str:
    sheet = study.folder / f"{name}.tsv"
    head = {
        "measurements": "subject\thand\tquantity\tvalue_mm\tsd_mm",
        "touches": "subject\thand\ttask\tdigit\tpart\tfrom_s\tto_s\tx_mm\ty_mm\tz_mm\tsd_mm",
    }
    sheet.write_text("\n".join([head[name.split("-")[0]], *lines]) + "\n")
    return f"--{name.split('-')[0]}={sheet}"


def test_a_calliper_is_believed_as_far_as_its_error(study: Study, fitted: Path) -> None:
    before = {row["bone"]: row for row in rows(fitted, "bone_lengths")}["index_middle"]
    value_mm = before["length_mm"] + 1.0
    lines = [f"01\tright\tindex_middle\t{value_mm}\t0.1", "01\tleft\tindex_middle\t5\t0.1"]
    out = study.folder / "callipers"
    assert study.fit(out, measured(study, "measurements", *lines)) == 0
    after = {row["bone"]: row for row in rows(out, "bone_lengths")}["index_middle"]
    assert after["length_mm"] == pytest.approx(value_mm, abs=0.15)
    assert after["sd_mm"] < 0.11 < before["sd_mm"]


def test_a_touch_tells_where_the_fingertip_is(study: Study, fitted: Path) -> None:
    """The end of the digit comes down to about the error of the touch."""
    made = study.made["right", "rom"]
    segment = made.segments.index("index_distal")
    before = {row["segment"]: row for row in rows(fitted, "receivers")}["index_distal"]
    true_mm = np.array([before[f"soft_tip_{a}_mm"] for a in "xyz"]) + np.array([1.0, -0.8, 0.6])
    at = slice(480, 484)
    turn, place = made.quaternion[at, segment], made.position_mm[at, segment]
    point = (rotate(turn, true_mm) + place).mean(0)
    cells = ("01", "right", "rom", "index", "tip", made.time_s[480], made.time_s[483], *point, 0.3)
    out = study.folder / "touched"
    assert study.fit(out, measured(study, "touches", "\t".join(map(str, cells)))) == 0
    after = {row["segment"]: row for row in rows(out, "receivers")}["index_distal"]
    assert after["soft_tip_sd_mm"] < 0.6 * before["soft_tip_sd_mm"]
    found = np.array([after[f"soft_tip_{a}_mm"] for a in "xyz"])
    assert np.linalg.norm(found - true_mm) < 0.5


Refused = Callable[[Study], list[str]]
REFUSALS: dict[str, tuple[Refused, str]] = {
    "a quantity that is none": (
        lambda s: [measured(s, "measurements-odd", "01\tright\tindex_midle\t20\t0.5")],
        "row 2, column quantity: 'index_midle' is nothing that is measured on layout liberty16; did you mean "
        "'index_middle'?",
    ),
    "a touch of no digit": (
        lambda s: [measured(s, "touches-odd", "01\tright\trom\tfoot\ttip\t1\t2\t0\t0\t0\t1")],
        "row 2: digit 'foot' has no fingertip; expected one of thumb, index, middle, ring, little",
    ),
    "a hand length in cm": (lambda _: ["--hand-length-mm=18"], "--hand-length-mm: is 18; expected"),
    "a model without a fit": (lambda _: ["--model=rigid"], "model rigid fits no whole hand"),
}


@pytest.mark.parametrize("what", REFUSALS)
def test_it_refuses(study: Study, capsys: pytest.CaptureFixture[str], tmp_path: Path, what: str) -> None:
    words, sentence = REFUSALS[what]
    assert study.fit(tmp_path / "out", *words(study)) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.startswith("error: ")
    assert not list((tmp_path / "out").iterdir())


def test_a_failure_is_recorded(study: Study, tmp_path: Path) -> None:
    """Joints that failed and why, the reason for the study's problems, empty tables for what comes after."""
    out = tmp_path / "out"
    assert study.fit(out, "--hand-length-mm=18", "--record-failure") == 0
    joints = rows(out, "joint_centres")
    assert len(joints) == 15
    assert {row["status"] for row in joints} == {"failed"}
    assert all(row["message"].startswith("--hand-length-mm: is 18") for row in joints)
    assert all(row["child_x_mm"] is None for row in joints)
    for table in ("receivers", "gains"):
        with pytest.raises(InputError, match="hand-length-mm: is 18"):
            rows(out, table)
    for table in ("bone_lengths", "joint_angles", "bone_poses", "posed_tips"):
        assert rows(out, table) == []


def test_a_failure_without_joints_is_recorded_in_every_table(study: Study, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert study.fit(out, f"--joints={tmp_path / 'none.parquet'}", "--record-failure") == 0
    for table, _ in OUTPUTS.values():
        with pytest.raises(InputError, match=r"none\.parquet: no such file"):
            rows(out, table)


def test_a_loose_receiver_is_named(study: Study, tmp_path: Path) -> None:
    """It slips by 6 mm and 12 deg in mid-recording; the fit goes on without its shorter part."""
    made = study.made["right", "rom"]
    segment, frame = made.segments.index("ring_middle"), 1500
    turned = multiply(made.quaternion[frame:, segment], np.array([0.9945, 0.0, 0.0, 0.1045]))
    moved = made.position_mm[frame:, segment] + rotate(
        made.quaternion[frame:, segment], np.array([6.0, 0, 0])
    )
    position, quaternion = made.position_mm.copy(), made.quaternion.copy()
    position[frame:, segment], quaternion[frame:, segment] = moved, turned
    slipped = replace(made, position_mm=position, quaternion=quaternion)
    pq.write_table(tidy(slipped), tmp_path / "slipped.raw.parquet")
    poses = import_recording(tmp_path / "slipped.raw.parquet", tmp_path / "slipped.parquet", task="rom")
    assert study.fit(tmp_path / "out", f"--poses={poses}") == 0
    receivers = {row["segment"]: row for row in rows(tmp_path / "out", "receivers")}
    assert [name for name, row in receivers.items() if row["loose_from_frame"] is not None] == ["ring_middle"]
    row = receivers["ring_middle"]
    assert abs(row["loose_from_frame"] - made.frame[frame]) < 60
    assert row["loose_shift_mm"] == pytest.approx(6.0, abs=2.0)
    assert row["loose_turn_deg"] == pytest.approx(12.0, abs=4.0)
    assert row["message"].startswith("came loose in rom at ")


def test_long_recordings_are_thinned_evenly(study: Study) -> None:
    layout = read_layout("liberty16")
    whole = read_thinned(study.poses(), layout)
    thinned = read_thinned(study.poses(), layout, most_frames=700)
    assert len(whole.frame) == 2400
    assert len(thinned.frame) == 600
    np.testing.assert_array_equal(thinned.frame, whole.frame[::4])
    np.testing.assert_array_equal(thinned.position_mm, whole.position_mm[::4])
