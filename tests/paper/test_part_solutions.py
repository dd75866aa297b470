"""Solving all parts of a subject: shared reading and solving, and failures that stay with their part."""

from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from simulated_poses import recorded, write_poses
from stage_runs import solve_joints as main

from shukotsu.errors import InputError, TableError
from shukotsu.paper import part_solutions
from shukotsu.paper.part_solutions import solve_parts
from shukotsu.study.layout import read_layout
from shukotsu.study.model import JointSolving, read_model
from shukotsu.tables.catalogue import JOINT_SOLUTIONS, POSES
from shukotsu.tables.parts import Part, part_metadata, read_part
from shukotsu.tables.typed_table import Provenance, write_failure

LAYOUT = read_layout("liberty16")


Rows = dict[Part, list[dict[str, Any]] | Exception]


def solve(poses_of: dict[Part, tuple[Path, ...]], **settings: JointSolving) -> Rows:
    """Solve parts made from these recordings; settings : of models that do not ship."""
    solving = {part.model: settings.get(part.model) or read_model(part.model).solving for part in poses_of}
    plan: Any = SimpleNamespace(
        parts=lambda: list(poses_of),
        calibrating=lambda *key: poses_of[Part(*key)],
        poses=lambda recording: recording,
        layouts={"right": LAYOUT, "left": LAYOUT},
        models={model: SimpleNamespace(solving=solving[model]) for model in solving},
    )
    return solve_parts(plan)


@pytest.fixture(scope="module")
def poses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    simulated = recorded("right", "rom", seed=1, n_frames=480)[0]
    return write_poses(tmp_path_factory.mktemp("poses") / "poses.parquet", simulated, "right", "rom")


def test_equal_recordings_and_settings_are_solved_once(poses: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Models with equal settings share a solution; another setting or hand is solved separately."""
    streamed, solved = [], []
    stream, solve_recordings = part_solutions.stream_recordings, part_solutions.solve_recordings
    monkeypatch.setattr(
        part_solutions, "stream_recordings", lambda *a, **k: streamed.append(a) or stream(*a, **k)
    )
    monkeypatch.setattr(
        part_solutions, "solve_recordings", lambda *a: solved.append(a) or solve_recordings(*a)
    )
    parts = [
        *(Part("right", model) for model in ("paper-fig4", "paper-fig3", "six")),
        Part("left", "paper-fig4"),
    ]
    rows = solve(
        dict.fromkeys(parts, (poses,)), six=replace(read_model("paper-fig4").solving, singular_values=6)
    )
    assert list(rows) == parts
    assert len(streamed) == 2
    assert len(solved) == 3
    fig4, fig3, of_six, left = map(_x_of_index_pip, rows.values())
    assert fig4 == fig3 == left != of_six


@dataclass(frozen=True)
class Constrained(JointSolving):
    """Settings `joints` of a model file with one additional key."""

    made_up_mm: float


def test_parts_with_other_settings_are_solved_apart(poses: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two models that differ in one new key alone are solved separately, each with its value."""
    solve_recordings = part_solutions.solve_recordings

    def obeying(recordings: Any, settings: Constrained) -> Any:
        solved = solve_recordings(recordings, settings)
        solution = solved["index_pip"]
        assert not isinstance(solution, str)
        return {**solved, "index_pip": replace(solution, p_mm=solution.p_mm + settings.made_up_mm)}

    monkeypatch.setattr(part_solutions, "solve_recordings", obeying)
    settings = vars(read_model("paper-fig4").solving)
    models = {name: Constrained(**settings, made_up_mm=mm) for name, mm in (("none", 0.0), ("some", 1.0))}
    rows = solve({Part("right", name): (poses,) for name in models}, **models)
    without, constrained = map(_x_of_index_pip, rows.values())
    assert constrained == pytest.approx(without + 1.0)


def _x_of_index_pip(rows: list[dict[str, Any]] | Exception) -> float:
    assert isinstance(rows, list)
    return float(next(row["parent_x_mm"] for row in rows if row["joint"] == "index_pip"))


def test_the_whole_hand_fit_always_starts_from_closed_form_joints() -> None:
    """The solver named in the model does not change the joint-by-joint solutions of the whole-hand fit."""
    fitted = read_model("whole-hand")
    literal = replace(fitted, joints=replace(fitted.joints, solver="stacked-svd"))
    assert literal.solving == fitted.solving
    assert (fitted.solving.solver, fitted.solving.singular_values) == ("closed", 6)


def test_without_a_usable_recording_every_joint_fails_with_the_reason(poses: Path, tmp_path: Path) -> None:
    """A recording whose import failed is left out; if it is the only one, every joint has failed."""
    failed = tmp_path / "failed.parquet"
    write_failure(failed, POSES, "the file is empty", Provenance())
    rows = solve({Part("right", "paper-fig4"): (poses, failed), Part("left", "paper-fig4"): (failed,)})
    usable, unusable = rows.values()
    assert isinstance(usable, list)
    assert isinstance(unusable, list)
    assert {row["status"] for row in usable} <= {"ok", "weak"}
    assert {row["status"] for row in unusable} == {"failed"}
    assert unusable[0]["message"] == "no calibration recording: the file is empty"


def test_a_damaged_poses_file_is_refused(tmp_path: Path) -> None:
    """It is an error of the whole command, not a failure recorded for a part."""
    damaged = tmp_path / "damaged.parquet"
    damaged.write_bytes(b"PAR1")
    with pytest.raises(TableError, match="not a readable Parquet file"):
        solve({Part("right", "paper-fig4"): (damaged,)})


def test_a_hand_without_a_plan_is_one_part(poses: Path, tmp_path: Path) -> None:
    out = tmp_path / "joints.parquet"
    argv = ["--poses", str(poses), "--layout", "liberty16", "--out", str(out)]
    assert main([*argv, "--model", "paper-fig4"]) == 0
    part = Part("right", "paper-fig4", subject="01")
    assert list(part_metadata(out, JOINT_SOLUTIONS)) == [part]
    rows = read_part(out, JOINT_SOLUTIONS, part).to_pylist()
    assert len(rows) == 15
    assert {(row["subject"], row["made_without"]) for row in rows} == {("01", "")}
    assert main(argv) == 2


@pytest.mark.parametrize("error", [InputError("the field is too strong"), ZeroDivisionError()])
def test_a_failure_is_recorded_only_when_asked_for(
    error: Exception, poses: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With --record-failure the table holds the reason, even of an internal error; without it the command
    fails.
    """

    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(part_solutions, "stream_recordings", fail)
    out = tmp_path / "joints.parquet"
    argv = ["--poses", str(poses), "--layout", "liberty16", "--model", "rigid", "--out", str(out)]
    with pytest.raises(ZeroDivisionError) if isinstance(error, ZeroDivisionError) else nullcontext():
        assert main(argv) == 2
    assert not out.exists()
    assert main([*argv, "--record-failure"]) == 0
    with pytest.raises(InputError, match=r"the field is too strong|internal error"):
        read_part(out, JOINT_SOLUTIONS, Part("right", "rigid", subject="01"))
