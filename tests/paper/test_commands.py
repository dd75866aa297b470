"""The stages project_planes, estimate_metacarpals and evaluate_tips, with a plan and for one hand alone."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest
import stage_runs
from small_study import planned_subject, recording_numbers, run_stages, write_plans, write_study

from shukotsu.study.layout import read_layout
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.plan_file import read_plan
from shukotsu.study.verdict import doubts_of
from shukotsu.tables.catalogue import (
    BONE_LENGTHS,
    JOINT_CENTRES,
    JOINT_SOLUTIONS,
    METACARPALS,
    TIP_ERRORS,
    TIPS,
)
from shukotsu.tables.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.tables.poses import read_poses
from shukotsu.tables.typed_table import Provenance, read_metadata, rows_of

WHOLE = Part("right", "rigid", "", "01")
DIGITS = ("thumb", "index", "middle", "ring", "little")
TURNS = [f"q{name}" for name in "wxyz"]
BUILT = {"joint_centres": JOINT_CENTRES, "bone_lengths": BONE_LENGTHS, "metacarpals": METACARPALS}
ALONE = ("--layout", "liberty16", "--model", "rigid")
MODELS = ("paper-fig4", "paper-fig4-corrected")
CORRECTIONS = (
    "subject hand joint dx_mm dy_mm dz_mm\n"
    "01 left index_pip 0 0 9\n01 right index_pip 1 2 2\n02 right index_pip 9 9 9"
)


@pytest.fixture(scope="module")
def plan_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Plan in which the right hand's skeletons are also made without opposition, from rom alone."""
    recordings = [("right", "rom", "calibration"), ("right", "opposition", "both")]
    recordings += [("left", "opposition", "both"), ("left", "rom", "both", "-", "-", "moved")]
    subject = planned_subject(
        tmp_path_factory.mktemp("study"), recordings, ["rigid", "paper-fig4"], n_frames=300
    )
    run_stages(subject.plan_file)
    return subject.plan_file


@pytest.fixture
def plan(plan_file: Path) -> SubjectPlan:
    return read_plan(plan_file)


def poses_of(plan: SubjectPlan, task: str) -> Path:
    return next(plan.poses(r) for r in plan.recordings if (r.hand.hand, r.task) == ("right", task))


def project(out: Path, solutions: Path, *options: object) -> int:
    argv = ["--joint-solutions", solutions, "--out", out, *options]
    return stage_runs.project_planes([str(argument) for argument in argv])


def estimate(out: Path, joints: Path, *options: object) -> int:
    out.mkdir(exist_ok=True)
    argv = ["--projected-joints", joints, *stage_runs.outputs("estimate_metacarpals", out), *options]
    return stage_runs.estimate_metacarpals([str(argument) for argument in argv])


def evaluate(plan: SubjectPlan, out: Path, calibrated_on: str, *options: object, **tables: Path) -> int:
    """Evaluate the right hand without a plan, on the plan's tables or on `tables` instead, into a folder."""
    out.mkdir(exist_ok=True)
    read = {name: plan.table(name) for name in BUILT} | tables
    argv = [f"--{name.replace('_', '-')}={path}" for name, path in read.items()]
    argv += [*ALONE, f"--poses={poses_of(plan, 'opposition')}"]
    argv += [f"--calibration={poses_of(plan, calibrated_on)}", *map(str, options)]
    return stage_runs.evaluate_tips([*argv, *stage_runs.outputs("evaluate_tips", out)])


def test_corrections_move_only_their_joint_under_models_that_use_them(
    plan: SubjectPlan, tmp_path: Path
) -> None:
    """The left hand's solutions failed; its failure is recorded and the right hand is projected."""
    recordings = ("01 right opposition both b.csv", "01 left opposition both c.csv")
    file = write_study(tmp_path, *recordings, models=MODELS, corrections=CORRECTIONS)
    solutions, solved = tmp_path / "joint_solutions.parquet", Part("right", "paper-fig4", "", "01")
    rows = list(rows_of(read_part(plan.table("joint_solutions"), JOINT_SOLUTIONS, solved)))
    with parts_writer(solutions, JOINT_SOLUTIONS, Provenance()) as writer:
        for model in MODELS:
            writer.rows(Part("right", model, "", "01"), [row | {"model": model} for row in rows])
            writer.failure(Part("left", model, "", "01"), "no usable poses")
    out = tmp_path / "projected.parquet"
    assert project(out, solutions, "--plan", write_plans(file)["01"], "--record-failure") == 0
    as_solved, moved = (
        {row["joint"]: row for row in rows_of(read_part(out, JOINT_CENTRES, Part("right", model, "", "01")))}
        for model in MODELS
    )
    assert len(as_solved) == len(rows)
    for joint, row in moved.items():
        shift = [row[f"child_{axis}_mm"] - as_solved[joint][f"child_{axis}_mm"] for axis in "xyz"]
        np.testing.assert_allclose(shift, [1, 2, 2] if joint == "index_pip" else [0, 0, 0], atol=1e-12)
    assert moved["index_pip"]["correction_mm"] == pytest.approx(3.0)
    assert doubts_of(moved["index_pip"])["moved-by-hand"] == {"correction_mm": 3.0}
    assert moved["index_dip"]["correction_mm"] is None
    for model in MODELS:
        failed = part_metadata(out, JOINT_CENTRES)[Part("left", model, "", "01")]
        assert failed == {"failure": "no usable poses"}
    assert "plan.json" in {Path(entry["file"]).name for entry in read_metadata(out)["inputs"]}


def test_a_hand_without_a_plan_has_the_same_results(plan: SubjectPlan, tmp_path: Path) -> None:
    """Run from the joint solutions to the tips; if the solutions are of several hands, --hand is required."""
    projected, solutions = tmp_path / "projected_joints.parquet", plan.table("joint_solutions")
    assert project(projected, solutions, *ALONE) == 2
    assert project(projected, solutions, *ALONE, "--hand", "right") == 0
    poses = poses_of(plan, "opposition")
    assert estimate(tmp_path, projected, *ALONE, "--poses", poses, "--calibration", poses) == 0
    assert evaluate(plan, tmp_path, "opposition") == 0
    tables = {"projected_joints": JOINT_CENTRES, **BUILT, "tips": TIPS, "tip_errors": TIP_ERRORS}
    for name, table in tables.items():
        alone = read_part(tmp_path / f"{name}.parquet", table, WHOLE)
        of_plan = read_part(plan.table(name), table, WHOLE)
        if "task" in alone.column_names:  # a plan poses the hand in its calibration as well
            of_plan = of_plan.filter(pc.equal(of_plan["task"], "opposition"))
        assert alone.equals(of_plan), name
    assert evaluate(plan, tmp_path, "rom") == 0
    assert all(read_part(tmp_path / "tip_errors.parquet", TIP_ERRORS, WHOLE)["held_out"].to_pylist())


def test_metacarpals_are_posed_in_every_included_recording(plan: SubjectPlan) -> None:
    """A skeleton made without a task is posed in that task alone."""
    for name, table in BUILT.items():
        metadata = part_metadata(plan.table(name), table)
        assert list(metadata) == plan.parts()
        for part, parameters in metadata.items():
            assert parameters == {"calibrated_on": ["rom" if part.made_without else "opposition"]}
    inputs = [entry["file"] for entry in read_metadata(plan.table("metacarpals"))["inputs"]]
    assert {"projected_joints.parquet", "right/opposition/poses.parquet"} <= {*inputs}
    assert "left/rom/poses.parquet" not in inputs
    for part in plan.parts():
        tasks = set(read_part(plan.table("metacarpals"), METACARPALS, part)["task"].to_pylist())
        every = {"opposition", "rom"} if part.hand == "right" else {"opposition"}  # the left rom is excluded
        assert tasks == ({part.made_without} if part.made_without else every)
    which = ("opposition", "", TURNS, 300)
    for part in plan.parts():
        turns = recording_numbers(plan.table("metacarpals"), METACARPALS, part, *which)
        assert tuple(turns) == DIGITS
        assert all(np.isfinite(values).all() for values in turns.values())


def test_a_failed_part_does_not_affect_the_others(
    plan_file: Path, plan: SubjectPlan, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    joints, projected = tmp_path / "joints.parquet", plan.table("projected_joints")
    with parts_writer(joints, JOINT_CENTRES, Provenance()) as writer:
        for part, parameters in part_metadata(projected, JOINT_CENTRES).items():
            if part == WHOLE:
                writer.failure(part, "no usable poses")
            else:
                writer.rows(part, list(rows_of(read_part(projected, JOINT_CENTRES, part))), **parameters)
    assert estimate(tmp_path / "out", joints, "--plan", plan_file) == 2
    assert capsys.readouterr().err == "error: no usable poses\n"
    assert list((tmp_path / "out").iterdir()) == []
    assert estimate(tmp_path / "out", joints, "--plan", plan_file, "--record-failure") == 0
    assert "error: no usable poses" in capsys.readouterr().err
    for name, table in BUILT.items():
        path = tmp_path / "out" / f"{name}.parquet"
        assert part_metadata(path, table)[WHOLE] == {"failure": "no usable poses"}
        for part in plan.parts():
            if part != WHOLE:
                assert read_part(path, table, part).equals(read_part(plan.table(name), table, part))


def test_every_skeleton_is_evaluated_in_its_evaluation_recordings(plan: SubjectPlan) -> None:
    """A recording counts as held out only for skeletons made without its task."""
    assert list(part_metadata(plan.table("tips"), TIPS)) == plan.parts()
    for part in plan.parts():
        errors = list(rows_of(read_part(plan.table("tip_errors"), TIP_ERRORS, part)))
        assert [row["digit"] for row in errors] == [digit for digit in DIGITS for _ in range(2)]
        assert {(row["task"], row["held_out"]) for row in errors} == {("opposition", bool(part.made_without))}
        assert all(row["n_frames"] == row["n_frames_total"] == 300 for row in errors)
        which = ("opposition", "", ["error_mm"], 300)
        tips = recording_numbers(plan.table("tips"), TIPS, part, *which)
        for row in errors:
            if row["binding"] == "least-squares":
                assert row["mean_mm"] == pytest.approx(tips[row["digit"]].mean(), rel=1e-12)


def test_tip_errors_are_distances_between_tips_and_receivers(plan: SubjectPlan) -> None:
    columns = [f"tip_{axis}_mm" for axis in "xyz"] + ["error_mm"]
    layout = read_layout("liberty16")
    tips = recording_numbers(plan.table("tips"), TIPS, WHOLE, "opposition", "", columns)
    poses = read_poses(poses_of(plan, "opposition"), layout.measured)
    for name, values in tips.items():
        receiver_mm = poses.position_mm[:, poses.index(layout.digits[name].tip)]
        off_mm = np.linalg.norm(values[:, :3] - receiver_mm, axis=-1)
        np.testing.assert_allclose(off_mm, values[:, 3], atol=1e-9)


def changed_metacarpals(out: Path, rows: pa.Table) -> Path:
    with parts_writer(out, METACARPALS, Provenance()) as writer:
        writer.columns(WHOLE, {name: rows.column(name) for name in rows.column_names})
    return out


def test_metacarpals_of_other_poses_are_refused(
    plan: SubjectPlan, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Frames are never paired with those of another recording, and no failure is recorded for the subject."""
    table = read_part(plan.table("metacarpals"), METACARPALS, WHOLE)
    few = changed_metacarpals(tmp_path / "few.parquet", table.filter(pc.less(table["frame"], 101)))
    assert evaluate(plan, tmp_path / "out", "rom", "--record-failure", metacarpals=few) == 2
    message = "few.parquet: opposition, thumb: has 100 frames and the recording 300; name one that this"
    assert message in capsys.readouterr().err
    assert list((tmp_path / "out").iterdir()) == []


def test_gaps_are_left_out_of_the_statistics(plan: SubjectPlan, tmp_path: Path) -> None:
    """If the posture is unknown in the first frames, the paper's binding starts from the next frame."""
    table = read_part(plan.table("metacarpals"), METACARPALS, WHOLE)
    table = table.filter(pc.equal(table["task"], "opposition"))
    first = pc.and_(pc.less(table["frame"], 5), pc.equal(table["digit"], "index"))
    index = table.column_names.index("qw")
    table = table.set_column(index, "qw", pc.if_else(first, None, table["qw"]))
    assert evaluate(plan, tmp_path, "rom", metacarpals=changed_metacarpals(tmp_path / "gap", table)) == 0
    errors = read_part(tmp_path / "tip_errors.parquet", TIP_ERRORS, WHOLE).to_pylist()
    frames = {row["digit"]: row["n_frames"] for row in errors}
    n_lost = int(pc.sum(first).as_py())
    assert (frames["index"], frames["ring"]) == (300 - n_lost, 300)
    which = ("opposition", "", ["error_mm", "error_first_frame_mm"])
    tips = recording_numbers(tmp_path / "tips.parquet", TIPS, WHOLE, *which)["index"]
    assert np.isnan(tips[:n_lost]).all()
    assert tips[n_lost, 1] == pytest.approx(0, abs=1e-9)
