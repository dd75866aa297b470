"""The benchmarks on tiny sizes: their tables have the rows and numbers expected; times are not looked at."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from benchmarks import demo_study, joint_solve, paper_accuracy, simulated_hand, solve_hand, start_up
from benchmarks.__main__ import BENCHMARKS, main
from benchmarks.interleaved import compare
from benchmarks.text_table import Cell, TextTable


def column(table: TextTable, name: str) -> list[Cell]:
    """One column's cells, top down."""
    index = [head for head, _ in table.columns].index(name)
    return [row[index] for row in table.rows]


def test_a_table_aligns_its_columns_and_shows_what_is_missing() -> None:
    table = TextTable("title", (("name", ""), ("mm", ".1f")), [("a", 12.34), ("longer", None)], "Meaning.")
    assert str(table).splitlines() == [
        "title",
        "name      mm",
        "------  ----",
        "a       12.3",
        "longer     -",
        "Meaning.",
    ]


def test_rivals_take_turns() -> None:
    turns: list[str] = []
    found = compare({n: lambda n=n: turns.append(n) for n in "ab"}, "a", rounds=3, turn_s=0.0)
    assert turns == list("ababab")
    assert found["a"].ratio == 1.0
    assert found["b"].ratio > 0


def test_our_solvers_agree_on_one_joint() -> None:
    timed, whole_hand, agreement = joint_solve.run(sizes=((300, 1),), seeds=2, hand_rounds=1)
    ours = [joint_solve.CLOSED, joint_solve.MOMENTS, joint_solve.STACKED]
    assert column(timed, "solver")[:3] == ours
    assert all(isinstance(cell, float) and cell > 0 for cell in column(timed, "median ms")[:3])
    assert column(whole_hand, "joints")[0] == 15
    apart = dict(zip(column(agreement, "solver"), column(agreement, agreement.columns[1][0]), strict=True))
    assert apart[joint_solve.STACKED] < 1e-6
    assert all(cell < 1.0 for cell in column(agreement, agreement.columns[2][0])[:2])


def test_biobuddy_is_beside_ours_or_says_why_not() -> None:
    peer = joint_solve.peer_solvers()
    table = joint_solve.times(300, 1)
    if isinstance(peer, str):
        assert column(table, "")[3:] == [peer, peer]
        pytest.skip(f"biobuddy {peer}")
    assert len(table.rows) == 7
    found = joint_solve.agreement(300, 2)
    apart = dict(zip(column(found, "solver"), column(found, found.columns[1][0]), strict=True))
    assert apart[joint_solve.SCORE + joint_solve.WITHOUT_OUTLIERS] < 1e-6


def test_a_peer_that_cannot_be_imported_is_named_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joint_solve, "peer_solvers", lambda: "cannot be imported: as this test says")
    timed, _, agreement = joint_solve.run(sizes=((300, 1),), seeds=1, hand_rounds=1)
    for table in (timed, agreement):
        assert column(table, "")[-2:] == ["cannot be imported: as this test says"] * 2


def test_a_whole_hand_is_solved_by_both() -> None:
    (table,) = solve_hand.run(n_frames=240, rounds=1)
    assert column(table, "solver") == [solve_hand.CLOSED, solve_hand.MOMENTS, solve_hand.STACKED]
    assert "15 joints of 16 receivers" in table.title


def test_a_tiny_study_names_every_stage(tmp_path: Path) -> None:
    assert sorted(job.stage for job in start_up.tiny(tmp_path)) == start_up.stages()


def test_the_papers_accuracy_has_a_row_per_joint_type_and_finds_what_is_there() -> None:
    found = simulated_hand.hand_errors(0, "right", 480)
    for task in simulated_hand.TASKS:
        joints = [joint for joint in found.joints if joint.calibration == task]
        assert len(joints) == 15
        table = paper_accuracy.centres(joints, "one hand")
        assert column(table, "joints") == [*paper_accuracy.JOINT_TYPES, paper_accuracy.ALL]
        assert column(table, "n") == [1, 1, 1, 2, 2, 4, 4, 15]
        for joint in joints:
            assert math.isclose(math.hypot(joint.along_mm, joint.across_mm), joint.child_mm, rel_tol=1e-9)
            assert joint.worse_mm >= joint.child_mm
    assert len(paper_accuracy.statuses(found.joints, "one hand").rows) == 8
    tips = paper_accuracy.tips(found.tips, "one hand")
    assert column(tips, "skeleton") == [simulated_hand.ESTIMATED, simulated_hand.TRUE] * 4
    assert column(tips, "held out") == ["no", "no", "yes", "yes"] * 2
    assert all(isinstance(cell, float) for row in tips.rows for cell in row[4:])


def test_a_failed_joint_is_counted_and_not_averaged() -> None:
    nothing = [float("nan")] * 5
    failed = simulated_hand.JointError("rom", "thumb_ip", "failed", *nothing)
    table = paper_accuracy.centres([failed], "nobody")
    assert table.rows[2] == ("thumb IP", 1, 1, *[None] * 9)


def test_job_counts_are_read_from_the_log() -> None:
    counts = ["job        count", "-------  -------", "all            1", "capture        8", "total   9"]
    log = "\n".join(["Building", "Job stats:", *counts, ""])
    assert demo_study.jobs_by_rule(log) == {"capture": 8}
    assert demo_study.jobs_by_rule("Nothing to be done (all requested files are present).") == {}
    with pytest.raises(RuntimeError, match="no job counts"):
        demo_study.jobs_by_rule("something else")


def test_the_demo_study_is_copied_whole(tmp_path: Path) -> None:
    from schemas.study import read_study

    study = read_study(demo_study.copy_study(tmp_path))
    original = read_study(demo_study.ROOT / "config" / "demo.yaml")
    assert list(study.models) == list(original.models)
    assert [r.file_as_written for r in study.recordings] == [r.file_as_written for r in original.recordings]
    assert all(tmp_path in r.file.resolve().parents for r in study.recordings)
    assert study.models[demo_study.CHANGED_MODEL].resolve().is_relative_to(tmp_path)


def test_command_line_lists_the_benchmarks(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["--help"])
    assert stopped.value.code == 0
    told = capsys.readouterr().out
    assert all(name in told for name in BENCHMARKS)
    with pytest.raises(SystemExit) as stopped:
        main(["no_such"])
    assert stopped.value.code == 2
    assert "is no benchmark" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [("--hands 7", "even"), ("--hands none", "even"), ("--seeds 9-3", "5000-5009"), ("--seeds a", "range")],
)
def test_wrong_options_are_refused(words: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["accuracy", *words.split()])
    assert stopped.value.code == 2
    assert told in capsys.readouterr().err
