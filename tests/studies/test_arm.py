"""A real pair of arms, which no code knows of: layout `arm`, the shipped models, receivers on loose skin."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from studies.running import Row, StudyRun, write_study

from schemas.catalogue import JOINT_ANGLES, JOINT_SOLUTIONS
from schemas.parts import read_part
from schemas.plan import SubjectPlan, read_plan
from schemas.tables import read_table, rows_of
from schemas.verdict import doubts_of

pytestmark = pytest.mark.slow

SIDES = ("right", "left")
MODELS = ("paper-fig4", "rigid", "anatomical", "whole-hand")
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


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("side", SIDES)
def test_the_arm_is_replayed_in_both_bindings(study: StudyRun, side: str, model: str) -> None:
    errors = study.rows_where("tip_errors", hand=side, model=model)
    assert {(row["digit"], row["binding"]) for row in errors} == {
        ("arm", "first-frame"),
        ("arm", "least-squares"),
    }
    assert all(row["n_frames"] > 350 and row["mean_mm"] > 0 for row in errors)


@pytest.mark.parametrize("side", SIDES)
def test_the_whole_arm_is_fitted_and_posed(study: StudyRun, side: str) -> None:
    """Nothing is known of its bones: joints lie where the gap is hardly more than the free fit's, every joint
    has its turns, and the hand is where the rest of the arm says, to some millimetres.
    """
    joints = _joints(study, side, "whole-hand")
    assert set(joints) == set(FREE_GAP_MM)
    for row in joints.values():
        assert row["gap_rms_mm"] < 1.35 * row["gap_rms_free_mm"]
        assert "not-converged" not in doubts_of(row)
    path = _plan(study).fit_table(side, "whole-hand", "joint_angles")
    angles = list(rows_of(read_table(path, JOINT_ANGLES)))
    assert {row["joint"] for row in angles} == set(FREE_GAP_MM)
    elbow = [row["flexion_deg"] for row in angles if row["joint"] == "elbow" and row["flexion_deg"]]
    assert max(elbow) - min(elbow) > 40
    (score,) = study.rows_where("skeleton_scores", hand=side, model="whole-hand")
    assert score["left_out_mean_mm"] < 12.0


def test_the_report_shows_the_arm(study: StudyRun) -> None:
    page = study.page()
    for word in ("shoulder", "elbow", "racing"):
        assert word in page
    assert not study.rows("problems")
