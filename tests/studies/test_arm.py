"""A real recording of both arms: layout `arm` and the shipped models, without code specific to arms."""

from pathlib import Path

import pytest
from studies.running import StudyRun, write_study

pytestmark = pytest.mark.slow

MODELS = ["paper-fig4", "rigid", "whole-hand"]
FREE_GAP_MM = {"shoulder": (16, 26), "elbow": (6, 8), "wrist": (4.5, 7)}


def test_both_arms_are_solved_and_replayed(real_data: Path, tmp_path: Path) -> None:
    """Free joints have the gaps expected from skin motion and no plane; a whole-hand model is refused."""
    sides = ("right", "left")
    rows = [f"01\t{side}\tracing\tboth\t{real_data}/upper_limb_poses/racing_{side}.csv" for side in sides]
    study = write_study(tmp_path, "arms", rows, MODELS, layout="arm")
    study.run("results/arms/joint_centres.parquet")
    for side in sides:
        joints = study.rows_where("joint_centres", hand=side, model="paper-fig4")
        free = {row["joint"]: row for row in joints if row["joint"] in FREE_GAP_MM}
        for joint, (least, most) in FREE_GAP_MM.items():
            assert least < free[joint]["gap_rms_free_mm"] < most
            assert free[joint]["gap_rms_mm"] == pytest.approx(free[joint]["gap_rms_free_mm"], rel=1e-9)
        for model in MODELS[:2]:
            errors = study.rows_where("tip_errors", hand=side, model=model)
            replays = [(row["digit"], row["binding"]) for row in errors]
            assert replays == [("arm", "first-frame"), ("arm", "least-squares")]
            assert all(row["n_frames"] > 350 and row["mean_mm"] > 0 for row in errors)
    file = study.folder / "alone.yaml"
    file.write_text(study.file.read_text("utf-8").replace(", ".join(MODELS), MODELS[-1]), "utf-8")
    done = StudyRun(file, study.folder).snakemake("--dry-run")
    assert done.returncode == 1
    assert "whole-hand fits a whole hand, but layout arm does not describe one" in done.stdout + done.stderr
