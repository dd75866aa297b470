"""The check_recordings stage: findings with and without a plan, and their effect on later stages."""

from pathlib import Path

import numpy as np
import pytest
from simulated_poses import hand_of, write_poses
from small_study import write_plans, write_study
from stage_runs import check_recordings as main

from benchmarks.mistakes import MISTAKES
from shukotsu.errors import InputError
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.plan_file import plan_of_results, read_plan
from shukotsu.tables.catalogue import FINDINGS, POSES
from shukotsu.tables.typed_table import Provenance, read_metadata, read_table, rows_of, write_failure

ROWS = (
    "01 right rom calibration a.csv - - - -",
    "01 right grip evaluation b.csv - - - seen-on-video",
    "01 left rom both c.csv - - - -",
    "01 left old evaluation d.csv - - moved -",
    "01 left cut evaluation e.csv - - - -",
)


@pytest.fixture(scope="module")
def plan_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Plan of a subject whose right grip is in metres and whose left rom has random poses."""
    folder = tmp_path_factory.mktemp("study")
    file = write_study(folder, *ROWS, models=("rigid",))
    plan_file = write_plans(file)["01"]
    plan = read_plan(plan_file)
    rng = np.random.default_rng(0)
    poses = {
        ("right", "rom"): hand_of(7).poses,
        ("right", "grip"): MISTAKES["metres read as mm"][1](hand_of(7, task="opposition"), rng).poses,
        ("left", "rom"): MISTAKES["random poses"][1](hand_of(7, "left"), rng).poses,
    }
    for recording in plan.recordings:
        hand, task = recording.hand.hand, recording.task
        if (hand, task) in poses:
            write_poses(plan.poses(recording), poses[hand, task], hand, task)
        elif not recording.exclude:
            parameters = {"subject": "01", "hand": hand, "task": task, "trial": ""}
            write_failure(plan.poses(recording), POSES, "e.csv: is cut", Provenance((), parameters))
    return plan_file


@pytest.fixture(scope="module")
def plan(plan_file: Path) -> SubjectPlan:
    assert main(["--plan", str(plan_file), "--out", str(plan_file.with_name("findings.parquet"))]) == 0
    return plan_of_results(plan_file)


def test_findings_are_by_recording_and_noted_as_accepted_by_the_sheet(plan: SubjectPlan) -> None:
    rows = list(rows_of(read_table(plan.table("findings"), FINDINGS)))
    assert [(row["hand"], row["task"], row["kind"], row["severity"]) for row in rows] == [
        ("right", "grip", "units", "note"),
        ("left", "rom", "spikes", "refused"),
    ]
    assert rows[0]["message"].endswith("Accepted: seen-on-video")
    digests = read_metadata(plan.table("findings"))["parameters"]["digests"]
    assert {*digests} == {"01//right/rom/", "01//right/grip/", "01//left/rom/"}


def test_a_refused_recording_is_not_used_by_later_stages(plan: SubjectPlan, plan_file: Path) -> None:
    assert [recording.task for recording in plan.all_calibrating("left")] == []
    assert [recording.task for recording in plan.all_calibrating("right")] == ["rom"]
    assert len(read_plan(plan_file).all_calibrating("left")) == 1
    plan.check_calibration_left("right")
    with pytest.raises(InputError, match=r"no calibration recording is left: The poses jump from frame"):
        plan.check_calibration_left("left")


@pytest.mark.slow
def test_poses_without_a_plan_are_checked(
    plan: SubjectPlan, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    poses = [plan.folder / "right" / task / "poses.parquet" for task in ("rom", "grip")]
    command = ["--layout", "liberty16", "--poses", *map(str, poses)]
    assert main(command) == 0
    assert capsys.readouterr().out.startswith("right grip: suspect: units: The positions seem to be in m")
    assert main([*command[:4], "--out", str(tmp_path / "findings.parquet")]) == 0
    assert capsys.readouterr().out == "no finding\n"
    assert read_table(tmp_path / "findings.parquet", FINDINGS).num_rows == 0
