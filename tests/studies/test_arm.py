"""A real pair of arms, which no code knows of: layout `arm`, the shipped models, receivers on loose skin."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from studies.running import Row, StudyRun, write_study

from schemas.catalogue import JOINT_SOLUTIONS
from schemas.parts import read_part
from schemas.plan import SubjectPlan, read_plan
from schemas.tables import rows_of

pytestmark = pytest.mark.slow

SIDES = ("right", "left")
WHOLE = "whole-hand"
MODELS = ("paper-fig4", "rigid", "anatomical", WHOLE)
FREE_GAP_MM = {"shoulder": (16, 26), "elbow": (6, 8), "wrist": (4.5, 7)}


@pytest.fixture(scope="module")
def study(real_data: Path, tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """The study of both arms, run."""
    rows = [f"01\t{side}\tracing\tboth\t{real_data}/upper_limb_poses/racing_{side}.csv" for side in SIDES]
    study = write_study(tmp_path_factory.mktemp("arm"), "arms", rows, list(MODELS), layout="arm")
    study.run()
    return study


def _joints(study: StudyRun, side: str, model: str = "paper-fig4") -> dict[str, Row]:
    rows = study.rows_where("joint_centres", hand=side, model=model)
    return {row["joint"]: row for row in rows}


def _plan(study: StudyRun) -> SubjectPlan:
    """The subject's plan, its paths as from here."""
    plan = read_plan(study.results.plan("01"))
    return replace(plan, folder=study.folder / plan.folder)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("joint", FREE_GAP_MM)
def test_a_free_centre_closes_as_well_as_skin_lets_it(study: StudyRun, side: str, joint: str) -> None:
    """The rms gap of the unconstrained fit: least at the wrist, most at the shoulder blade."""
    least, most = FREE_GAP_MM[joint]
    assert least < _joints(study, side)[joint]["gap_rms_free_mm"] < most


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("joint", FREE_GAP_MM)
def test_five_singular_values_close_worse_than_six(study: StudyRun, side: str, joint: str) -> None:
    """A least-squares fit with one direction left out cannot have the smaller gap."""
    plan = _plan(study)
    part = plan.part(side, "paper-fig4")
    rows = rows_of(read_part(plan.table("joint_solutions"), JOINT_SOLUTIONS, part))
    solution = {row["joint"]: row for row in rows}[joint]
    assert solution["gap_rms_mm"] > solution["gap_rms_free_mm"]


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("joint", FREE_GAP_MM)
def test_where_no_plane_cuts_the_axis_the_free_centre_stands(study: StudyRun, side: str, joint: str) -> None:
    row = _joints(study, side)[joint]
    assert row["gap_rms_mm"] == pytest.approx(row["gap_rms_free_mm"], rel=1e-9)


@pytest.mark.parametrize("model", MODELS[:-1])
@pytest.mark.parametrize("side", SIDES)
def test_the_arm_is_replayed_in_both_bindings(study: StudyRun, side: str, model: str) -> None:
    errors = study.rows_where("tip_errors", hand=side, model=model)
    assert {(row["digit"], row["binding"]) for row in errors} == {
        ("arm", "first-frame"),
        ("arm", "least-squares"),
    }
    assert all(row["n_frames"] > 350 and row["mean_mm"] > 0 for row in errors)


@pytest.mark.parametrize("side", SIDES)
def test_the_model_of_a_whole_hand_refuses_it(study: StudyRun, side: str) -> None:
    joints = _joints(study, side, WHOLE)
    assert {row["status"] for row in joints.values()} == {"failed"}
    (problem,) = study.rows_where("problems", hand=side)
    assert (problem["model"], problem["stage"], problem["severity"]) == (WHOLE, "fit_hand", "refused")
    assert problem["message"].endswith("take model anatomical, which solves each joint by itself")


def test_a_study_of_that_model_alone_is_refused_before_anything_runs(study: StudyRun) -> None:
    """The sentence names the layout and the model to take."""
    file = study.folder / "alone.yaml"
    file.write_text(study.file.read_text("utf-8").replace(", ".join(MODELS), WHOLE), "utf-8")
    done = StudyRun(file, study.folder).snakemake("--dry-run")
    assert done.returncode == 2
    assert "model whole-hand fits a whole hand, and layout arm is none" in done.stderr


def test_the_report_shows_the_arm(study: StudyRun) -> None:
    page = study.page()
    for word in ("shoulder", "elbow", "racing"):
        assert word in page
