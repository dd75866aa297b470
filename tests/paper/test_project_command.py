"""The stage by a plan: every skeleton's joints, corrected where model and sheet say so."""

from pathlib import Path

import numpy as np
import pytest
from small_study import write_plans, write_study
from stage_runs import project_planes as main

from shukotsu.study.plan import SubjectPlan, read_plan
from shukotsu.study.verdict import doubts_of
from shukotsu.tables.catalogue import JOINT_CENTRES, JOINT_SOLUTIONS
from shukotsu.tables.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.tables.typed_table import Provenance, read_metadata, rows_of

SHEET = (
    "subject hand joint dx_mm dy_mm dz_mm\n"
    "01 left index_pip 0 0 9\n01 right index_pip 1 2 2\n02 right index_pip 9 9 9"
)
MODELS = ("paper-fig4", "paper-fig4-corrected")


@pytest.fixture
def corrected(plan_file: Path, tmp_path: Path) -> tuple[Path, Path]:
    """A plan with corrections, and joint solutions of its right hand under its models; the left's failed."""
    rows = ("01 right opposition both b.csv", "01 left opposition both c.csv")
    file = write_study(tmp_path, *rows, models=MODELS, corrections=SHEET)
    solved = read_plan(plan_file)
    solutions, source = tmp_path / "joint_solutions.parquet", Part("right", "paper-fig4", "", "01")
    rows = list(rows_of(read_part(solved.table("joint_solutions"), JOINT_SOLUTIONS, source)))
    with parts_writer(solutions, JOINT_SOLUTIONS, Provenance()) as writer:
        for model in MODELS:
            writer.rows(Part("right", model, "", "01"), [row | {"model": model} for row in rows])
            writer.failure(Part("left", model, "", "01"), "no usable poses")
    return write_plans(file)["01"], solutions


def test_every_part_has_the_joints_that_were_solved(plan_file: Path) -> None:
    plan = read_plan(plan_file)
    for part in plan.parts():
        solved = read_part(plan.table("joint_solutions"), JOINT_SOLUTIONS, part)
        placed = read_part(plan.table("projected_joints"), JOINT_CENTRES, part)
        for name in ("subject", "hand", "model", "made_without", "joint", "n_frames"):
            assert placed.column(name).equals(solved.column(name)), name


def test_corrections_move_that_hands_joint_under_models_that_take_them(
    corrected: tuple[Path, Path], tmp_path: Path
) -> None:
    plan, solutions = corrected
    out = tmp_path / "projected.parquet"
    argv = ["--plan", plan, "--joint-solutions", solutions, "--out", out, "--record-failure"]
    assert main([str(argument) for argument in argv]) == 0
    as_solved, moved = (
        {row["joint"]: row for row in rows_of(read_part(out, JOINT_CENTRES, Part("right", model, "", "01")))}
        for model in MODELS
    )
    for joint, row in moved.items():
        shift = [row[f"child_{axis}_mm"] - as_solved[joint][f"child_{axis}_mm"] for axis in "xyz"]
        np.testing.assert_allclose(shift, [1, 2, 2] if joint == "index_pip" else [0, 0, 0], atol=1e-12)
    assert moved["index_pip"]["correction_mm"] == pytest.approx(3.0)
    assert doubts_of(moved["index_pip"])["moved-by-hand"] == {"correction_mm": 3.0}
    assert moved["index_dip"]["correction_mm"] is None
    for model in MODELS:
        assert part_metadata(out, JOINT_CENTRES)[Part("left", model, "", "01")] == {
            "failure": "no usable poses"
        }
    assert "plan.json" in {Path(entry["file"]).name for entry in read_metadata(out)["inputs"]}


def test_a_hand_alone_has_the_same_numbers(plan_file: Path, tmp_path: Path) -> None:
    """Whose hand it is the solutions say, or of several hands an option."""
    plan: SubjectPlan = read_plan(plan_file)
    out, part = tmp_path / "projected.parquet", Part("right", "rigid", "", "01")
    argv = [
        "--layout",
        "liberty16",
        "--model",
        "rigid",
        "--joint-solutions",
        str(plan.table("joint_solutions")),
    ]
    assert main([*argv, "--out", str(out)]) == 2
    assert main([*argv, "--out", str(out), "--hand", "right"]) == 0
    expected = read_part(plan.table("projected_joints"), JOINT_CENTRES, part)
    assert read_part(out, JOINT_CENTRES, part).equals(expected)
