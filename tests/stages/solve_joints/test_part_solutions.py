"""All parts of a subject: each recording read once, each solver run once, a part that fails fails alone."""

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest
from long_poses import long_poses

from schemas.catalogue import JOINT_SOLUTIONS, POSES
from schemas.errors import InputError, TableError
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.parts import Part, part_metadata, read_part
from schemas.tables import Provenance, write_failure
from stages.solve_joints import part_solutions
from stages.solve_joints.__main__ import main
from stages.solve_joints.part_solutions import PartRequest, solve_parts
from stages.solve_joints.solve import HandDescription, SolverSettings

LAYOUT = read_layout("liberty16")


def request(model: str, *poses: Path, hand: str = "right", made_without: str = "") -> PartRequest:
    settings = SolverSettings.of(read_model(model))
    return PartRequest(Part(hand, model, made_without), poses, LAYOUT, settings, HandDescription(hand))


@pytest.fixture(scope="module")
def poses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return long_poses(tmp_path_factory.mktemp("poses") / "poses.parquet", 480)


def test_the_same_recordings_and_settings_are_solved_once(
    poses: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Models with equal settings share their solution; another setting or side gets its own."""
    streamed, solved = [], []
    stream, solve = part_solutions.stream_recordings, part_solutions.solve_recordings
    monkeypatch.setattr(
        part_solutions, "stream_recordings", lambda *a, **k: streamed.append(a) or stream(*a, **k)
    )
    monkeypatch.setattr(part_solutions, "solve_recordings", lambda *a: solved.append(a) or solve(*a))
    six = replace(request("paper-fig4", poses, made_without="x"), settings=SolverSettings("closed", 6))
    requests = [
        request("paper-fig4", poses),
        request("anatomical", poses),
        request("paper-fig3", poses),
        six,
        request("paper-fig4", poses, hand="left"),
        request("anatomical", poses, hand="left"),
    ]
    rows = solve_parts(requests)
    assert list(rows) == [one.part for one in requests]
    assert len(streamed) == 2
    assert len(solved) == 5
    index_pip = [next(row for row in own if row["joint"] == "index_pip") for own in rows.values()]
    fig4, right, fig3, of_six, left_fig4, left = index_pip
    assert fig4["parent_x_mm"] == fig3["parent_x_mm"] == left_fig4["parent_x_mm"]
    assert len({one["parent_x_mm"] for one in (fig4, right, of_six, left)}) == 4


def test_settings_hold_all_of_a_model_that_a_solution_depends_on() -> None:
    """The solver is given nothing else of a model, so a field added to models cannot be overlooked."""
    assert SolverSettings.of(read_model("paper-fig3")) == SolverSettings.of(read_model("paper-fig4"))
    assert SolverSettings.of(read_model("anatomical")) != SolverSettings.of(read_model("paper-fig4"))


def test_without_a_recording_every_joint_has_failed_and_says_why(poses: Path, tmp_path: Path) -> None:
    """A recording whose import failed is left out; without any other there is no centre."""
    failed = tmp_path / "failed.parquet"
    write_failure(failed, POSES, "the file is empty", Provenance())
    rows = solve_parts([request("paper-fig4", poses, failed), request("paper-fig4", failed, hand="left")])
    usable, unusable = rows.values()
    assert isinstance(usable, list)
    assert isinstance(unusable, list)
    assert {row["status"] for row in usable} <= {"ok", "weak"}
    assert {row["status"] for row in unusable} == {"failed"}
    assert unusable[0]["message"] == "no calibration recording: the file is empty"


def test_a_file_that_is_no_table_is_no_result(tmp_path: Path) -> None:
    """Nobody's hand is to blame for a damaged file, so it is refused and not recorded."""
    damaged = tmp_path / "damaged.parquet"
    damaged.write_bytes(b"PAR1")
    with pytest.raises(TableError, match="not a readable Parquet file"):
        solve_parts([request("paper-fig4", damaged)])


def test_a_hand_alone_is_one_part(poses: Path, tmp_path: Path) -> None:
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
def test_a_failed_part_is_recorded_or_raised(
    error: Exception, poses: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With --record-failure the part says why it failed, bug or not; without, the command fails."""

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
