"""The benchmarks on tiny sizes: their tables have the rows and numbers expected; times are not looked at."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from benchmarks import (
    benchmark_table,
    bit_flips,
    fewer_receivers,
    hand_cost,
    joint_solve,
    paper_accuracy,
    peers,
    studies,
)
from benchmarks.__main__ import BENCHMARKS, main
from benchmarks.accuracy.score import JOINT_TYPES
from benchmarks.benchmark_table import Cell, TextTable
from benchmarks.cluster_plan import Line, fitted_line
from benchmarks.joint_solve import compare
from benchmarks.processes import run_process, run_python
from benchmarks.study_runs import OWN_MODEL, PAPER_MODELS, Study, hand_tasks, job_counts
from schemas.model import read_model
from schemas.study import read_study


def column(table: TextTable, name: str) -> list[Cell]:
    """One column's cells, top down."""
    return [row[table.heads.index(name)] for row in table.rows]


def test_a_table_aligns_its_columns_and_shows_what_is_missing() -> None:
    table = TextTable("title", ("name", "mm:.1f"), [("a", 12.34), ("longer", None)], "Meaning.")
    assert str(table).splitlines() == [
        "title",
        "name      mm",
        "------  ----",
        "a       12.3",
        "longer     -",
        "Meaning.",
    ]


def test_tables_go_into_their_page_with_the_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmark_table, "DOCS", tmp_path)
    page = tmp_path / "page.md"
    page.write_text(f"Prose.\n{benchmark_table.START}\nold\n{benchmark_table.END}\nMore.\n", "utf-8")
    benchmark_table.write_tables(
        "page.md", [TextTable("title", ("mm:.1f",), [(1.0,)], "Meaning.")], "make it"
    )
    written = page.read_text("utf-8")
    assert "As printed by `make it` on " in written
    assert "```text\ntitle\n mm\n---\n1.0\nMeaning.\n```" in written
    assert written.startswith("Prose.")
    assert written.endswith("More.\n")
    assert "old" not in written


def test_no_file_with_a_checksum_gives_other_numbers() -> None:
    """Of those without one, some flips do."""
    (table,) = bit_flips.run(flips=12 * 12, seed=3)
    silent = dict(zip(column(table, "file"), column(table, "other"), strict=True))
    assert silent.pop("recording (Parquet without)") != 0
    silent.pop("recording (CSV)")
    assert len(silent) == 10
    assert set(silent.values()) == {0}


def test_rivals_take_turns() -> None:
    turns: list[str] = []
    timings = compare({n: lambda n=n: turns.append(n) for n in "ab"}, "a", rounds=3, turn_s=0.0)
    assert turns == list("ababab")
    assert timings["a"].ratio == 1.0
    assert timings["b"].ratio > 0


def test_a_process_is_measured_with_its_children(tmp_path: Path) -> None:
    child = "data = bytearray(200_000_000); print('in', __import__('os').getcwd())"
    usage = run_process(
        [sys.executable, "-c", f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"],
        tmp_path,
    )
    assert usage.output.strip() == f"in {tmp_path}"
    assert usage.memory_mb > 200
    assert usage.processor_s > 0
    with pytest.raises(RuntimeError, match="ended with 3"):
        run_python("-c", "import sys; sys.exit(3)")


def test_our_solvers_agree_on_one_joint() -> None:
    timed, whole_hand, agreement = joint_solve.run(sizes=((300, 1),), seeds=2, hand_rounds=1)
    ours = [joint_solve.CLOSED, joint_solve.MOMENTS, joint_solve.STACKED]
    for table in (timed, whole_hand):
        assert column(table, "solver")[:3] == ours
        assert all(isinstance(cell, float) and cell > 0 for cell in column(table, "median ms")[:3])
    assert "15 joints of 16 receivers" in whole_hand.title
    apart = dict(zip(column(agreement, "solver"), column(agreement, agreement.heads[1]), strict=True))
    assert apart[joint_solve.STACKED] < 1e-6
    assert all(cell < 1.0 for cell in column(agreement, agreement.heads[2])[:2])


@pytest.mark.skipif(isinstance(peers.biobuddy(), str), reason="biobuddy is not installed")
def test_biobuddy_is_beside_ours() -> None:
    assert len(joint_solve.joint_times(300, 1).rows) == 7
    agreement = joint_solve.agreement(300, 2)
    apart = dict(zip(column(agreement, "solver"), column(agreement, agreement.heads[1]), strict=True))
    assert apart[peers.SCORE + ", without"] < 1e-6


def test_a_peer_that_cannot_be_imported_is_named_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joint_solve, "biobuddy", lambda: "cannot be imported: as this test says")
    for table in (joint_solve.joint_times(300, 1), joint_solve.agreement(300, 1)):
        assert column(table, "")[-2:] == ["cannot be imported: as this test says"] * 2


def test_the_papers_accuracy_has_a_row_per_joint_type_and_finds_what_is_there() -> None:
    joints, tips = map(pd.DataFrame, paper_accuracy.paper_hand(0, "right", 480))
    for task in paper_accuracy.TASKS:
        solved = joints[joints["calibration"] == task]
        assert len(solved) == 15
        table = paper_accuracy.centre_table(solved, "one hand")
        assert column(table, "joints") == [*JOINT_TYPES, paper_accuracy.ALL]
        assert column(table, "n") == [1, 1, 1, 2, 2, 4, 4, 15]
        np.testing.assert_allclose(np.hypot(solved["along_mm"], solved["across_mm"]), solved["error_mm"])
    assert len(paper_accuracy.verdict_table(joints, "one hand").rows) == 12
    table = paper_accuracy.tip_table(tips, "one hand")
    assert column(table, "skeleton") == [paper_accuracy.ESTIMATED, paper_accuracy.TRUE] * 4
    assert column(table, "held out") == ["no", "no", "yes", "yes"] * 2
    assert all(isinstance(cell, float) for row in table.rows for cell in row[4:])


def test_a_failed_joint_is_counted_and_not_averaged() -> None:
    failed = pd.DataFrame([{"calibration": "rom", "joint": "thumb_ip", "status": "failed"}])
    table = paper_accuracy.centre_table(failed, "nobody")
    assert table.rows[2] == ("thumb IP", 1, 1, *[None] * 9)


def test_job_counts_are_read_from_the_output() -> None:
    counts = ["job        count", "-------  -------", "all            1", "capture        8", "total   9"]
    output = "\n".join(["Building", "Job stats:", *counts, ""])
    assert job_counts(output) == {"capture": 8}
    assert job_counts("Nothing to be done (all requested files are present).") == {}
    with pytest.raises(RuntimeError, match="no job counts"):
        job_counts("something else")


@pytest.fixture
def simulated(tmp_path: Path) -> Path:
    """Recordings of two subjects that hold frame numbers alone."""
    folder = tmp_path / "simulated"
    folder.mkdir()
    for subject in ("01", "02"):
        for hand, task in hand_tasks():
            pq.write_table(pa.table({"frame": [1, 2, 2]}), folder / f"{subject}_{hand}_{task}.parquet")
    return folder


def test_a_study_is_written_and_changed(tmp_path: Path, simulated: Path) -> None:
    study = Study(tmp_path / "study")
    study.write_subjects(simulated, 3)
    written = read_study(study.file)
    assert list(written.subjects) == ["0000", "0001", "0002"]
    assert list(written.models) == list(PAPER_MODELS)
    assert all(recording.file.exists() for recording in written.recordings)
    changes = studies.changes(study, simulated, 3)
    changes["one subject more"]()
    assert len(read_study(study.file).subjects) == 4
    changes["one recording changed"]()
    assert pq.read_table(study.recording(0, "right", "opposition")).num_rows == 1
    assert pq.read_table(study.recording(2, "right", "opposition")).num_rows == 3
    changes["one model changed"]()
    assert read_model(study.model_file).twist_factor == 0.5


def test_a_line_is_fitted_and_never_falls() -> None:
    assert fitted_line((1, 3), (5.0, 9.0)) == Line(3.0, 2.0)
    assert fitted_line((1, 3), (9.0, 5.0)) == Line(7.0, 0.0)
    assert Line(3.0, 2.0).reaches(11.0) == 4.0
    assert Line(3.0, 0.0).reaches(11.0) == math.inf


@pytest.mark.slow
def test_the_jobs_of_a_study_are_those_that_snakemake_names(tmp_path: Path) -> None:
    study = Study(tmp_path, [OWN_MODEL])
    run_python(
        "-m",
        "stages.simulate",
        *["--subject=01", "--hand=right", "--task=opposition", "--frames=240"],
        f"--out={tmp_path}/tiny.parquet",
    )
    study.write([("01", "right", "opposition", "both", "tiny.parquet")])
    counts = job_counts(study.run().output)
    jobs = study.jobs()
    assert {job.rule for job in jobs} == set(counts)
    assert len(jobs) == sum(counts.values())
    costs = studies.rule_costs(study, counts)
    assert set(costs) == set(counts)
    assert all(cost.processor_s > 0 and cost.memory_mb > 0 for cost in costs.values())


@pytest.mark.parametrize("name", [None, *BENCHMARKS])
def test_help_lists_the_benchmarks_or_the_options_of_one(
    name: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([name, "--help"] if name else ["--help"])
    assert stopped.value.code == 0
    output = capsys.readouterr().out
    assert all(text in output for text in ([f"python -m benchmarks {name}"] if name else BENCHMARKS))


@pytest.mark.parametrize(
    ("argv", "expected"),
    [
        ("no_such", "is no benchmark"),
        ("accuracy --hands 7", "even"),
        ("accuracy --hands none", "even"),
        ("accuracy --seeds 9-3", "5000-5009"),
        ("accuracy --seeds a", "range"),
    ],
)
def test_wrong_options_are_refused(argv: str, expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(argv.split())
    assert stopped.value.code == 2
    assert expected in capsys.readouterr().err


def test_the_cost_of_a_hand_is_told_with_how_far_the_compiled_equations_are_off() -> None:
    stages, twins, start = hand_cost.run(1, frames=(600, 60))
    assert all(isinstance(ms, float) and ms > 0 for ms in column(stages, "ms"))
    assert all(isinstance(off, float) and off < 1e-9 for off in column(twins, "largest difference"))
    assert len(start.rows) == 3


@pytest.mark.slow
def test_fewer_receivers_are_compared_with_all_and_with_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fewer_receivers, "FEWER", {6: ("hand",)})
    monkeypatch.setattr(fewer_receivers, "EVERY", 60)
    pairs = list(fewer_receivers.hand_errors(1, "left", 2400))
    assert [(kind, one.calibrated, one.worn) for kind, one in pairs] == [
        ("fitted", 16, 16), ("fitted", 16, 6), ("fitted", 6, 6), ("bound", 6, 6),
    ]  # fmt: skip
    shown = fewer_receivers.table(fewer_receivers.PIP, pairs, "one hand")
    assert column(shown, "task with") == [16, 6, 6]
    with_all, with_six, calibrated_with_six = column(shown, "stated sd")
    assert with_all < with_six < calibrated_with_six  # type: ignore[operator]
    assert column(shown, "sd at the truth")[:2] == [None, None]
