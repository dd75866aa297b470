"""The stage by a plan and alone: every skeleton's own rows in three tables, or why there are none."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pipeline import recording_numbers
from stage_runs import estimate_metacarpals as main

from shukotsu.study.plan import SubjectPlan, read_plan
from shukotsu.tables.catalogue import BONE_LENGTHS, JOINT_CENTRES, METACARPALS
from shukotsu.tables.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.tables.typed_table import Provenance, Table, read_metadata, read_table, rows_of

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
    argv = ["--projected-joints", joints, *written, "--out", out / "metacarpals.parquet", *options]
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
