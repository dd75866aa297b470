"""The stage by a plan and alone: tips of every skeleton, and rows that say why there are none."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from pipeline import recording_numbers
from stage_runs import evaluate_tips as main

from shukotsu.study.layout import read_layout
from shukotsu.study.plan import SubjectPlan, read_plan
from shukotsu.tables.catalogue import METACARPALS, TIP_ERRORS, TIPS
from shukotsu.tables.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.tables.poses import read_poses
from shukotsu.tables.typed_table import Provenance, rows_of

WHOLE = Part("right", "rigid", "", "01")
DIGITS = ("thumb", "index", "middle", "ring", "little")


@pytest.fixture
def plan(plan_file: Path) -> SubjectPlan:
    return read_plan(plan_file)


def run(plan: SubjectPlan, out: Path, *options: object, **tables: Path) -> int:
    """Run the stage on the plan's tables, or others in their place, into a folder."""
    out.mkdir(exist_ok=True)
    read = {name: plan.table(name) for name in ("joint_centres", "bone_lengths", "metacarpals")} | tables
    argv = ["--joint-centres", read["joint_centres"], "--bone-lengths", read["bone_lengths"]]
    argv += ["--metacarpals", read["metacarpals"], *options]
    argv += ["--out", out / "tips.parquet", "--out-errors", out / "tip_errors.parquet"]
    return main([str(argument) for argument in argv])


def alone(plan: SubjectPlan, *tasks: str) -> list[object]:
    """Options of the right hand alone, evaluated in opposition and calibrated on those tasks."""
    poses = {r.task: plan.poses(r) for r in plan.recordings if r.hand.hand == "right"}
    options: list[object] = ["--layout", "liberty16", "--model", "rigid", "--poses", poses["opposition"]]
    return [*options, "--calibration", *(poses[task] for task in tasks)]


def test_every_skeleton_is_replayed_where_it_is_evaluated(plan: SubjectPlan) -> None:
    """What it was calibrated on is not held out; a skeleton made without the task is evaluated on it."""
    assert list(part_metadata(plan.table("tips"), TIPS)) == plan.parts()
    for part in plan.parts():
        errors = list(rows_of(read_part(plan.table("tip_errors"), TIP_ERRORS, part)))
        assert [row["digit"] for row in errors] == [digit for digit in DIGITS for _ in range(2)]
        assert {(row["task"], row["held_out"]) for row in errors} == {("opposition", bool(part.made_without))}
        assert all(row["n_frames"] == row["n_frames_total"] == 300 for row in errors)
        found = recording_numbers(
            plan.table("tips"), TIPS, part, "opposition", "", "digit", ["error_mm"], 300
        )
        for row in errors:
            if row["binding"] == "least-squares":
                assert row["mean_mm"] == pytest.approx(found[row["digit"]].mean(), rel=1e-12)


def test_errors_are_distances_of_the_tips(plan: SubjectPlan) -> None:
    columns = [f"tip_{axis}_mm" for axis in "xyz"] + ["error_mm"]
    layout = read_layout("liberty16")
    found = recording_numbers(plan.table("tips"), TIPS, WHOLE, "opposition", "", "digit", columns)
    recording = next(r for r in plan.recordings if (r.hand.hand, r.task) == ("right", "opposition"))
    poses = read_poses(plan.poses(recording), layout.measured)
    for name, values in found.items():
        receiver_mm = poses.position_mm[:, poses.index(layout.digits[name].tip)]
        np.testing.assert_allclose(
            np.linalg.norm(values[:, :3] - receiver_mm, axis=-1), values[:, 3], atol=1e-9
        )


def test_a_hand_alone_has_the_same_numbers(plan: SubjectPlan, tmp_path: Path) -> None:
    assert run(plan, tmp_path, *alone(plan, "opposition")) == 0
    for name, table in (("tips", TIPS), ("tip_errors", TIP_ERRORS)):
        found = read_part(tmp_path / f"{name}.parquet", table, WHOLE)
        assert found.equals(read_part(plan.table(name), table, WHOLE))
    assert run(plan, tmp_path, *alone(plan, "rom")) == 0
    assert all(read_part(tmp_path / "tip_errors.parquet", TIP_ERRORS, WHOLE)["held_out"].to_pylist())


def changed_metacarpals(out: Path, rows: pa.Table) -> Path:
    with parts_writer(out, METACARPALS, Provenance()) as writer:
        writer.columns(WHOLE, {name: rows.column(name) for name in rows.column_names})
    return out


def test_metacarpals_of_other_poses_are_refused(
    plan: SubjectPlan, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Never read out of step, nor recorded as a result of the subject's."""
    table = read_part(plan.table("metacarpals"), METACARPALS, WHOLE)
    few = changed_metacarpals(tmp_path / "few.parquet", table.filter(pc.less(table["frame"], 101)))
    assert run(plan, tmp_path / "out", *alone(plan, "rom"), "--record-failure", metacarpals=few) == 2
    message = "few.parquet: opposition, thumb: has 100 frames and the recording 300; remove it and run"
    assert message in capsys.readouterr().err
    assert list((tmp_path / "out").iterdir()) == []


def test_a_gap_is_in_no_statistic(plan: SubjectPlan, tmp_path: Path) -> None:
    """The posture is unknown in the first frames: the next one is what the paper's binding starts from."""
    table = read_part(plan.table("metacarpals"), METACARPALS, WHOLE)
    first = pc.and_(pc.less(table["frame"], 5), pc.equal(table["digit"], "index"))
    index = table.column_names.index("qw")
    table = table.set_column(index, "qw", pc.if_else(first, None, table["qw"]))
    path = changed_metacarpals(tmp_path / "gap.parquet", table)
    assert run(plan, tmp_path, *alone(plan, "rom"), metacarpals=path) == 0
    errors = read_part(tmp_path / "tip_errors.parquet", TIP_ERRORS, WHOLE).to_pylist()
    frames = {row["digit"]: row["n_frames"] for row in errors}
    n_lost = int(pc.sum(first).as_py())
    assert frames["index"] == 300 - n_lost
    assert frames["ring"] == 300
    names = ["error_mm", "error_first_frame_mm"]
    found = recording_numbers(tmp_path / "tips.parquet", TIPS, WHOLE, "opposition", "", "digit", names)[
        "index"
    ]
    assert np.isnan(found[:n_lost]).all()
    assert found[n_lost, 1] == pytest.approx(0, abs=1e-9)
