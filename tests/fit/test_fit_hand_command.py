"""The fit_hand stage: its tables, its refusals, and its use of the sheets of measurements and touches."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulated_poses import recorded, write_poses
from small_study import QUICK, SHEETS, PlannedSubject, Row, planned_subject
from stage_runs import fit_hand as main

from shukotsu.errors import InputError
from shukotsu.fit.calibration import read_thinned
from shukotsu.fit.fit import HandFit, fit_hand
from shukotsu.study.layout import read_layout
from shukotsu.study.results import FIT_TABLES
from shukotsu.tables.catalogue import TABLES, table_in
from shukotsu.tables.parts import Part, read_part
from shukotsu.tables.typed_table import column_array, rows_of

pytestmark = pytest.mark.slow

WHOLE = Part("right", "quick", subject="01")
REPLAYED = 520


class HandAlone:
    """A full and a thinned recording of a right hand on disk, and the stage's command line for them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.model = folder / "quick.yaml"
        self.model.write_text(QUICK.replace("frames: 30", "frames: 40"))
        drawn, poses = recorded("right", "rom", seed=6)
        self.poses = write_poses(folder / "rom.parquet", drawn, "right", "rom")
        self.short = write_poses(folder / "short.parquet", poses.take(slice(None, None, 24)), "right", "rom")

    def fit(self, out: Path, *options: str, poses: Path | None = None) -> int:
        """Run the stage; return its exit code."""
        model = [f"--model={self.model}", f"--poses={poses or self.poses}"]
        return main(["--layout=liberty16", *model, f"--out={out}", *options])


def rows(folder: Path, name: str, part: Part = WHOLE) -> list[Row]:
    return list(rows_of(read_part(folder / f"{name}.parquet", table_in(name), part)))


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> HandAlone:
    return HandAlone(tmp_path_factory.mktemp("hand"))


def test_the_stage_writes_the_tables_of_a_hand_and_a_posed_task(hand: HandAlone, tmp_path: Path) -> None:
    task = recorded("right", "opposition", seed=6, n_frames=800)[1].take(slice(REPLAYED))
    replayed = write_poses(hand.folder / "replayed.parquet", task, "right", "opposition")
    fitted = tmp_path / "fitted"
    assert hand.fit(fitted, f"--replay={replayed}", poses=hand.short) == 0
    joints = {row["joint"]: row for row in rows(fitted, "fitted_joints")}
    assert set(joints) == {*read_layout("liberty16").joints}
    assert {row["status"] for row in joints.values()} <= {"ok", "weak"}
    for name in ("index_cmc", "little_cmc"):
        assert joints[name]["parent_segment"] == "hand"
        assert joints[name]["child_x_mm"] is None is not joints[name]["parent_x_mm"]
    assert len(rows(fitted, "fitted_bones")) == 19
    receivers = rows(fitted, "receivers")
    assert {row["status"] for row in receivers} == {"ok"}
    tipped = [row["segment"] for row in receivers if row["soft_tip_sd_mm"] is not None]
    assert tipped == [row["segment"] for row in receivers if row["segment"].endswith("_distal")]
    assert len(rows(fitted, "gains")) == 19 + 3 * 16 + 15 + 5
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
    assert 250 * 5 <= tried.sum() <= 512 * 5, "only some frames are posed without the tip's receiver"
    assert seen[tried].mean() < blind[tried].mean() < 1.5


REFUSALS = {
    "an unknown quantity": (
        "measurements",
        "01\tright\tindex_midle\t20\t0.5",
        "row 2, column quantity: 'index_midle' cannot be measured on layout liberty16; did you mean "
        "'index_middle'?",
    ),
    "a touch of an unknown digit": (
        "touches",
        "01\tright\trom\tfoot\ttip\t1\t2\t0\t0\t0\t1",
        "row 2: digit 'foot' has no fingertip; expected one of thumb, index, middle, ring, little",
    ),
    "a contact of a digit with itself": (
        "touches",
        "01\tright\trom\tindex\tpad\t1\t2\t\t\t\t\tindex",
        "row 2: column meets: is 'index', as is column digit; expected another digit",
    ),
    "a hand length in cm": ("hand-length-mm", "18", "--hand-length-mm: is 18; expected"),
    "a model without a whole-hand fit": ("model", "rigid", "model rigid does not fit a whole hand"),
    "the other hand's poses": ("hand", "left", "expected subject 01, left hand"),
}
"""An option, its value or the only row of its sheet, and a part of the error."""


@pytest.mark.parametrize("what", REFUSALS)
def test_bad_input_is_refused_in_one_sentence_and_nothing_is_written(
    hand: HandAlone, capsys: pytest.CaptureFixture[str], tmp_path: Path, what: str
) -> None:
    option, value, sentence = REFUSALS[what]
    if option in SHEETS:
        sheet = tmp_path / f"{option}.tsv"
        sheet.write_text(f"{SHEETS[option]}\n{value}\n")
        value = str(sheet)
    assert hand.fit(tmp_path / "out", f"--{option}={value}", poses=hand.short) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.startswith("error: ")
    assert not list(tmp_path.glob("out/*"))


def test_long_recordings_are_thinned_evenly(hand: HandAlone) -> None:
    segments = read_layout("liberty16").measured
    whole = read_thinned(hand.poses, segments)
    thinned = read_thinned(hand.poses, segments, most_frames=700)
    assert len(whole.frame) == 2400
    assert len(thinned.frame) == 600
    np.testing.assert_array_equal(thinned.frame, whole.frame[::4])
    np.testing.assert_array_equal(thinned.position_mm, whole.position_mm[::4])


def planned(folder: Path, **sheets: list[str]) -> PlannedSubject:
    recordings = [("right", task, "both") for task in ("rom", "opposition")] + [("left", "rom", "evaluation")]
    return planned_subject(folder, recordings, ["quick", "rigid"], n_frames=120, **sheets)


def test_a_failure_is_recorded_for_its_part_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An unknown measurement fails every table of its hand. A hand without a calibration recording has failed
    tables too, but empty tables of receivers, gains and pulls, as nothing went wrong in its fit.
    """
    subject = planned(tmp_path, measurements=["01\tright\tindex_midle\t20\t0.5"])
    sentence = r"measurements\.tsv: column quantity: 'index_midle' cannot be measured"
    assert subject.fit("right") == 2
    assert not list(subject.fit_folder().glob("*"))
    assert subject.fit("right", "--record-failure") == 0
    for name in FIT_TABLES:
        with pytest.raises(InputError, match=sentence):
            rows(subject.fit_folder(), name)
    assert subject.fit("left", "--record-failure") == 0
    left = replace(WHOLE, hand="left")
    for name in FIT_TABLES:
        if name in ("receivers", "moved_receivers", "gains", "length_pulls"):
            assert rows(subject.fit_folder("left"), name, left) == []
        else:
            with pytest.raises(InputError, match="no calibration recording"):
                rows(subject.fit_folder("left"), name, left)
    for options, message in (
        (["--model=paper"], "has no model 'paper'; expected one of quick, rigid"),
        (["--model=rigid"], "model rigid does not fit a whole hand"),
    ):
        assert subject.fit("right", *options) == 2
        assert message in capsys.readouterr().err


def test_hands_fitted_in_one_job_equal_those_of_separate_jobs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The files are the same bytes, and each hand is fitted only once."""
    recordings = [(hand, "rom", "calibration") for hand in ("right", "left")]
    subject, fitted = planned_subject(tmp_path, recordings, ["quick"], n_frames=120), list[str]()

    def counted(*arguments: Any, hand: str, **options: Any) -> HandFit:
        fitted.append(hand)
        return fit_hand(*arguments, hand=hand, **options)

    assert [subject.fit(hand) for hand in ("right", "left")] == [0, 0]
    folders = [subject.fit_folder(hand) for hand in ("right", "left")]
    alone = [{path.name: path.read_bytes() for path in folder.iterdir()} for folder in folders]
    shutil.rmtree(folders[1])
    monkeypatch.setattr("shukotsu.fit.calibration.fit_hand", counted)
    assert subject.fit("right", f"--out-other={folders[1]}") == 0
    assert fitted == ["right", "left"]
    assert [{path.name: path.read_bytes() for path in folder.iterdir()} for folder in folders] == alone
