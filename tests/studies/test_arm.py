"""A real pair of arms, which no code knows of: layout `arm`, the shipped models, receivers on loose skin."""

from __future__ import annotations

from pathlib import Path

import pytest
from studies.running import Row, StudyRun, write_study

pytestmark = pytest.mark.slow

SIDES = ("right", "left")
WHOLE = "whole-hand"
MODELS = ("paper-fig4", "rigid", WHOLE)
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


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("joint", FREE_GAP_MM)
def test_a_free_centre_closes_as_well_as_skin_lets_it(study: StudyRun, side: str, joint: str) -> None:
    """The rms gap of the unconstrained fit: least at the wrist, most at the shoulder blade."""
    least, most = FREE_GAP_MM[joint]
    assert least < _joints(study, side)[joint]["gap_rms_free_mm"] < most


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


def test_a_study_of_that_model_alone_is_refused_before_anything_runs(study: StudyRun) -> None:
    """The sentence names the layout and the model to take."""
    file = study.folder / "alone.yaml"
    file.write_text(study.file.read_text("utf-8").replace(", ".join(MODELS), WHOLE), "utf-8")
    done = StudyRun(file, study.folder).snakemake("--dry-run")
    assert done.returncode == 1
    assert "model whole-hand fits a whole hand, and layout arm is none" in done.stdout + done.stderr
