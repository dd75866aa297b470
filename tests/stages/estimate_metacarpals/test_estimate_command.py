"""The stage by a plan and alone: every skeleton's own rows in three tables, or why there are none."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pytest
from pipeline import recording_numbers

from shukotsu.schemas.catalogue import (
    BONE_LENGTHS,
    BONE_POSES,
    BONE_TIP,
    DISTAL_RECEIVER,
    JOINT_CENTRES,
    METACARPALS,
)
from shukotsu.schemas.model import read_model
from shukotsu.schemas.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.schemas.plan import SubjectPlan, read_plan
from shukotsu.schemas.tables import Provenance, Table, read_metadata, read_table, rows_of
from shukotsu.stages.estimate_metacarpals.__main__ import main

WHOLE = Part("right", "rigid", "", "01")
TURNS = [f"q{name}" for name in "wxyz"]
TABLES = {"joint_centres": JOINT_CENTRES, "bone_lengths": BONE_LENGTHS, "metacarpals": METACARPALS}


@pytest.fixture
def plan(plan_file: Path) -> SubjectPlan:
    return read_plan(plan_file)


def run(out: Path, joints: Path, *options: object) -> int:
    """Run the stage into a folder."""
    out.mkdir(exist_ok=True)
    written = ["--out-joints", out / "joint_centres.parquet", "--out-bones", out / "bone_lengths.parquet"]
    argv = ["--joints", joints, *written, "--out", out / "metacarpals.parquet", *options]
    return main([str(argument) for argument in argv])


def poses_of(plan: SubjectPlan, hand: str, *tasks: str) -> list[Path]:
    return [plan.poses(r) for r in plan.recordings if r.hand.hand == hand and r.task in tasks]


def test_every_part_says_what_it_was_made_from(plan: SubjectPlan) -> None:
    for name, table in TABLES.items():
        found = part_metadata(plan.table(name), table)
        assert list(found) == plan.parts()
        for part, parameters in found.items():
            used = "rom" if part.made_without else "opposition"
            assert parameters == {"calibrated_on": [used]}
    inputs = [entry["file"] for entry in read_metadata(plan.table("metacarpals"))["inputs"]]
    assert "projected_joints.parquet" in inputs
    assert "right/opposition/poses.parquet" in inputs
    assert "left/rom/poses.parquet" not in inputs


def test_metacarpals_are_posed_in_what_is_evaluated(plan: SubjectPlan) -> None:
    table = read_table(plan.table("metacarpals"), METACARPALS)
    assert set(table.column("task").to_pylist()) == {"opposition"}
    assert set(table.column("made_without").to_pylist()) == {"", "opposition"}
    for part in plan.parts():
        found = recording_numbers(
            plan.table("metacarpals"), METACARPALS, part, "opposition", "", "digit", TURNS, 300
        )
        assert list(found) == ["thumb", "index", "middle", "ring", "little"]
        assert all(np.isfinite(values).all() for values in found.values())


def test_a_hand_alone_has_the_same_numbers(plan: SubjectPlan, tmp_path: Path) -> None:
    poses = poses_of(plan, "right", "opposition")
    options = ["--layout", "liberty16", "--model", "rigid", "--poses", *poses, "--calibration", *poses]
    assert run(tmp_path, plan.table("projected_joints"), *options) == 0
    for name, table in TABLES.items():
        alone = read_part(tmp_path / f"{name}.parquet", table, WHOLE)
        assert alone.equals(read_part(plan.table(name), table, WHOLE))


def change_part(path: Path, out: Path, table: Table, part: Part, change: Callable[[Any], Any] | str) -> None:
    """Copy a subject table with one part's rows changed, or failed where the change is a message."""
    with parts_writer(out, table, Provenance()) as writer:
        for own, parameters in part_metadata(path, table).items():
            rows = list(rows_of(read_part(path, table, own)))
            if own == part and isinstance(change, str):
                writer.failure(own, change)
            else:
                writer.rows(own, change(rows) if own == part and callable(change) else rows, **parameters)


def test_a_part_that_failed_costs_no_other(
    plan_file: Path, plan: SubjectPlan, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    joints = tmp_path / "joints.parquet"
    change_part(plan.table("projected_joints"), joints, JOINT_CENTRES, WHOLE, "no usable poses")
    assert run(tmp_path / "out", joints, "--plan", plan_file) == 2
    assert capsys.readouterr().err == "error: no usable poses\n"
    assert list((tmp_path / "out").iterdir()) == []
    assert run(tmp_path / "out", joints, "--plan", plan_file, "--record-failure") == 0
    assert "error: no usable poses" in capsys.readouterr().err
    for name, table in TABLES.items():
        path = tmp_path / "out" / f"{name}.parquet"
        assert part_metadata(path, table)[WHOLE] == {"failure": "no usable poses"}
        for part in plan.parts():
            if part != WHOLE:
                assert read_part(path, table, part).equals(read_part(plan.table(name), table, part))


def test_joints_that_lack_a_part_are_never_a_recorded_failure(
    plan_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """That is no result of the subject's data but a table to make again."""
    joints = tmp_path / "joints.parquet"
    with parts_writer(joints, JOINT_CENTRES, Provenance()) as writer:
        writer.rows(Part("right", "rigid", "", "02"), [])
    assert run(tmp_path / "out", joints, "--plan", plan_file, "--record-failure") == 2
    assert "has no rows of subject 01, but of 02; remove it" in capsys.readouterr().err
    assert list((tmp_path / "out").iterdir()) == []


# --- models that fit the whole hand -----------------------------------------------------------------------

FITTED = Part("right", "whole-hand", "", "01")
TURN = np.array([[np.nan] * 4, *[[0.5, 0.5, 0.5, 0.5]] * 299])


@pytest.fixture
def fit(plan: SubjectPlan, tmp_path: Path) -> Path:
    """A folder of what a fit of the whole hand writes, and of the joints before it."""
    joints = list(rows_of(read_part(plan.table("projected_joints"), JOINT_CENTRES, WHOLE)))
    built = list(rows_of(read_part(plan.table("joint_centres"), JOINT_CENTRES, WHOLE)))
    bones = rows_of(read_part(plan.table("bone_lengths"), BONE_LENGTHS, WHOLE))
    own = {"model": "whole-hand"}
    base = next(row for row in built if row["joint"] == "thumb_cmc")
    fitted = [{**row, **own} for row in built if row["status"] != "failed"]
    fitted += [{**base, **own, "joint": f"{name}_cmc", "gap_rms_free_mm": None} for name in FINGERS]
    lengths = [{**row, **own, "length_mm": row["length_mm"] + 1, "sd_mm": 0.5} for row in bones]
    for row in lengths:
        row["ends_at"] = BONE_TIP if row["ends_at"] == DISTAL_RECEIVER else row["ends_at"]
    for name, table, rows in (
        ("projected_joints", JOINT_CENTRES, [{**row, **own} for row in joints]),
        ("fitted_joints", JOINT_CENTRES, fitted),
        ("fitted_bones", BONE_LENGTHS, lengths),
    ):
        with parts_writer(tmp_path / f"{name}.parquet", table, Provenance()) as writer:
            writer.rows(FITTED, rows)
    with parts_writer(tmp_path / "bone_poses.parquet", BONE_POSES, Provenance()) as writer:
        for segment in ("thumb_metacarpal", *(f"{name}_metacarpal" for name in FINGERS)):
            place = dict.fromkeys(("x_mm", "y_mm", "z_mm"), np.zeros(300))
            turns = dict(zip(TURNS, TURN.T, strict=True)) | dict.fromkeys(
                ("sd_mm", "turn_sd_deg"), np.ones(300)
            )
            keys = {"subject": "01", "task": "opposition", "trial": "", "segment": segment}
            writer.columns(FITTED, {**keys, "frame": 1 + np.arange(300), **place, **turns})
    return tmp_path


FINGERS = ("index", "middle", "ring", "little")


def run_fitted(plan: SubjectPlan, fit: Path, more: Sequence[object]) -> int:
    poses = poses_of(plan, "right", "opposition")
    options = ["--layout", "liberty16", "--model", "whole-hand", "--poses", *poses, "--calibration", *poses]
    return run(fit / "out", fit / "projected_joints.parquet", *options, *more)


def test_a_fitted_hand_has_the_fits_joints_lengths_and_postures(plan: SubjectPlan, fit: Path) -> None:
    assert read_model("whole-hand").fitting is not None
    assert run_fitted(plan, fit, ["--fit", fit]) == 0
    joints = list(rows_of(read_part(fit / "out/joint_centres.parquet", JOINT_CENTRES, FITTED)))
    solved = read_part(fit / "projected_joints.parquet", JOINT_CENTRES, FITTED)
    assert [row["joint"] for row in joints][: solved.num_rows] == solved.column("joint").to_pylist()
    assert {f"{name}_cmc" for name in FINGERS} < {row["joint"] for row in joints}
    bones = {
        row["bone"]: row for row in rows_of(read_part(fit / "out/bone_lengths.parquet", BONE_LENGTHS, FITTED))
    }
    given = rows_of(read_part(fit / "fitted_bones.parquet", BONE_LENGTHS, FITTED))
    for row in given:
        for name in ("starts_at", "ends_at", "length_mm", "sd_mm"):
            assert bones[row["bone"]][name] == row[name]
    assert bones["index_distal"]["ends_at"] == BONE_TIP
    found = read_part(fit / "out/metacarpals.parquet", METACARPALS, FITTED)
    thumb = found.filter(pc.equal(found.column("digit"), "thumb"))
    np.testing.assert_array_equal(np.stack([thumb.column(name).to_numpy() for name in TURNS], -1), TURN)
    assert thumb.column("flags").to_pylist() == ["gap"] + [""] * 299
