"""The stage on files: what it writes, what it refuses, and what sheets of measurements and touches do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pipeline import Row
from planned_subject import QUICK, SHEETS, PlannedSubject, planned_subject
from simulated_poses import recorded, write_poses
from stage_runs import fit_hand as main

from shukotsu.errors import InputError
from shukotsu.fit.calibration import read_thinned
from shukotsu.fit.hand_tables import FIT
from shukotsu.simulate.simulation import Simulated
from shukotsu.study.layout import read_layout
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.parts import Part, read_part
from shukotsu.tables.typed_table import column_array, rows_of

WHOLE = Part("right", "quick", subject="01")
REPLAYED = 520


def simulated(side: str = "right", task: str = "rom") -> Simulated:
    return recorded(side, task, seed=6, n_frames=800 if task == "opposition" else 2400)[0]


class HandAlone:
    """Recordings of a right hand and a left one, as a command line names them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.model = folder / "quick.yaml"
        self.model.write_text(QUICK.replace("frames: 30", "frames: 40"))
        for side, task in (("right", "rom"), ("left", "rom"), ("right", "opposition")):
            write_poses(self.poses(side, task), simulated(side, task), side, task)
        self.short = [f"--poses={folder / 'short.parquet'}"]
        part = simulated().poses().take(slice(None, None, 40))
        write_poses(folder / "short.parquet", part, "right", "rom")

    def poses(self, side: str = "right", task: str = "rom") -> Path:
        """A recording's poses."""
        return self.folder / f"{side}-{task}.parquet"

    def fit(self, out: Path, *options: str) -> int:
        """Run the stage; give its exit code."""
        poses = [f"--poses={self.poses()}"] * (not any(option.startswith("--poses") for option in options))
        return main(["--layout=liberty16", f"--model={self.model}", *poses, f"--out={out}", *options])


def rows(folder: Path, name: str, part: Part = WHOLE) -> list[Row]:
    return list(rows_of(read_part(folder / f"{name}.parquet", FIT[name], part)))


def lengths(folder: Path) -> dict[str, Row]:
    return {row["bone"]: row for row in rows(folder, "fitted_bones")}


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> HandAlone:
    return HandAlone(tmp_path_factory.mktemp("hand"))


@pytest.fixture(scope="module")
def fitted(hand: HandAlone) -> Path:
    """What the stage wrote of the right hand, alone, posed in opposition."""
    out, replayed = hand.folder / "fitted", hand.folder / "replayed.parquet"
    part = simulated(task="opposition").poses().take(slice(REPLAYED))
    write_poses(replayed, part, "right", "opposition")
    assert hand.fit(out, f"--replay={replayed}") == 0
    return out


def test_every_joint_of_the_hand_has_its_place(fitted: Path) -> None:
    joints = {row["joint"]: row for row in rows(fitted, "fitted_joints")}
    assert set(joints) == {*read_layout("liberty16").joints}
    assert {row["status"] for row in joints.values()} <= {"ok", "weak"}
    for name in ("index_cmc", "little_cmc"):
        assert joints[name]["parent_segment"] == "hand"
        assert joints[name]["parent_x_mm"] is not None
        assert joints[name]["child_x_mm"] is None


def test_bones_and_receivers_carry_their_uncertainty(fitted: Path) -> None:
    bones = lengths(fitted)
    assert len(bones) == 19
    assert all(0.2 < row["sd_mm"] < 4.0 for row in bones.values())
    receivers = {row["segment"]: row for row in rows(fitted, "receivers")}
    assert list(receivers) == list(simulated().truth.mounts.segments)
    assert {row["status"] for row in receivers.values()} == {"ok"}
    tipped = [segment for segment, row in receivers.items() if row["soft_tip_sd_mm"] is not None]
    assert tipped == [segment for segment in receivers if segment.endswith("_distal")]
    assert len(rows(fitted, "gains")) == 19 + 3 * 16 + 15 + 5


def test_angles_bones_and_tips_of_a_recording(fitted: Path) -> None:
    n = REPLAYED
    angles = read_part(fitted / "joint_angles.parquet", TABLES["joint_angles"], WHOLE)
    assert angles.num_rows == 17 * n
    assert set(angles.column("task").unique().to_pylist()) == {"opposition"}
    poses = read_part(fitted / "bone_poses.parquet", TABLES["bone_poses"], WHOLE)
    assert poses.num_rows == 20 * n
    tips = read_part(fitted / "posed_tips.parquet", TABLES["posed_tips"], WHOLE)
    assert tips.num_rows == 5 * n
    seen, blind = column_array(tips, "error_mm"), column_array(tips, "error_left_out_mm")
    assert np.isfinite(seen).all()
    tried = np.isfinite(blind)
    assert 250 * 5 <= tried.sum() <= 512 * 5, "the error left out is that of some frames"
    assert seen[tried].mean() < blind[tried].mean() < 1.5


def sheet(hand: HandAlone, kind: str, *lines: str) -> str:
    path = hand.folder / f"{kind}.tsv"
    path.write_text("\n".join([SHEETS[kind], *lines]) + "\n")
    return f"--{kind}={path}"


def test_a_calliper_is_believed_as_far_as_its_error(hand: HandAlone, fitted: Path) -> None:
    before = lengths(fitted)["index_middle"]
    value_mm = before["length_mm"] + 1.0
    lines = [f"01\tright\tindex_middle\t{value_mm}\t0.1", "01\tleft\tindex_middle\t5\t0.1"]
    out = hand.folder / "callipers"
    assert hand.fit(out, sheet(hand, "measurements", *lines)) == 0
    after = lengths(out)["index_middle"]
    assert after["length_mm"] == pytest.approx(value_mm, abs=0.15)
    assert after["sd_mm"] < 0.11 < before["sd_mm"]


Refused = Callable[[HandAlone], list[str]]
REFUSALS: dict[str, tuple[Refused, str]] = {
    "a quantity that is none": (
        lambda h: [sheet(h, "measurements", "01\tright\tindex_midle\t20\t0.5")],
        "row 2, column quantity: 'index_midle' is nothing that is measured on layout liberty16; did you mean "
        "'index_middle'?",
    ),
    "a touch of no digit": (
        lambda h: [*h.short, sheet(h, "touches", "01\tright\trom\tfoot\ttip\t1\t2\t0\t0\t0\t1")],
        "row 2: digit 'foot' has no fingertip; expected one of thumb, index, middle, ring, little",
    ),
    "a digit that met itself": (
        lambda h: [*h.short, sheet(h, "touches", "01\tright\trom\tindex\tpad\t1\t2\t\t\t\t\tindex")],
        "row 2: column meets: is 'index' as column digit is; expected another digit",
    ),
    "a touch of neither a point nor a digit": (
        lambda h: [sheet(h, "touches", "01\tright\trom\tindex\ttip\t1\t2\t0\t\t0\t1")],
        "row 2, column y_mm: is ''; expected a number, or a cell in column meets",
    ),
    "a hand length in cm": (lambda _: ["--hand-length-mm=18"], "--hand-length-mm: is 18; expected"),
    "a model without a fit": (lambda _: ["--model=rigid"], "model rigid fits no whole hand"),
    "the other hand's poses": (lambda _: ["--hand=left"], "expected subject 01, left hand"),
}


@pytest.mark.parametrize("what", REFUSALS)
def test_it_refuses(hand: HandAlone, capsys: pytest.CaptureFixture[str], tmp_path: Path, what: str) -> None:
    options, sentence = REFUSALS[what]
    assert hand.fit(tmp_path / "out", *options(hand)) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.startswith("error: ")
    assert not list(tmp_path.glob("out/*"))


def test_long_recordings_are_thinned_evenly(hand: HandAlone) -> None:
    segments = read_layout("liberty16").measured
    whole = read_thinned(hand.poses(), segments)
    thinned = read_thinned(hand.poses(), segments, most_frames=700)
    assert len(whole.frame) == 2400
    assert len(thinned.frame) == 600
    np.testing.assert_array_equal(thinned.frame, whole.frame[::4])
    np.testing.assert_array_equal(thinned.position_mm, whole.position_mm[::4])


def planned(folder: Path, **sheets: list[str]) -> PlannedSubject:
    recordings = [("right", task, "both") for task in ("rom", "opposition")] + [("left", "rom", "evaluation")]
    return planned_subject(folder, recordings, ["quick", "rigid"], n_frames=120, **sheets)


def test_a_failed_part_costs_no_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A measurement that is none fails every part of its hand; a hand that nothing calibrates is no problem
    of the fit, so that what the study reads of its problems is empty.
    """
    subject = planned(tmp_path, measurements=["01\tright\tindex_midle\t20\t0.5"])
    sentence = r"measurements\.tsv: column quantity: 'index_midle' is nothing that is measured"
    assert subject.fit("right") == 2
    assert not list(subject.fit_folder().glob("*"))
    assert subject.fit("right", "--record-failure") == 0
    for name in FIT:
        with pytest.raises(InputError, match=sentence):
            rows(subject.fit_folder(), name)
    assert subject.fit("left", "--record-failure") == 0
    left = replace(WHOLE, hand="left")
    for name in FIT:
        if name in ("receivers", "moved_receivers", "gains"):
            assert rows(subject.fit_folder("left"), name, left) == []
        else:
            with pytest.raises(InputError, match="no calibration recording"):
                rows(subject.fit_folder("left"), name, left)
    for options, message in (
        (["--model=paper"], "has no model 'paper'; expected one of quick, rigid"),
        (["--model=rigid"], "model rigid fits no whole hand"),
    ):
        assert subject.fit("right", *options) == 2
        assert message in capsys.readouterr().err
