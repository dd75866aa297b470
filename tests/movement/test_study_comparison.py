"""A study's comparisons of simulated movement: known effects, repeatability, and subjects left out."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import drawn_movement as drawn
import numpy as np
import pandas as pd
import pytest
from small_study import write_study
from stage_runs import compare_movement as main

from shukotsu.movement.study_comparison import compare_study
from shukotsu.study.findings import STAGE, SUSPECT, Finding, problem_row
from shukotsu.study.results import MOVEMENT_COMPARISONS, Results
from shukotsu.tables.catalogue import MOVEMENT_DIFFERENCES, MOVEMENT_RELIABILITY, PROBLEMS
from shukotsu.tables.typed_table import read_metadata, read_table

Row = dict[str, Any]
TABLES = (MOVEMENT_DIFFERENCES, MOVEMENT_RELIABILITY)


def compared(
    folder: Path,
    recordings: Sequence[Row],
    ranges: Sequence[Row],
    *,
    factors: Sequence[str] = ("group", "session"),
    suspect: Sequence[Row] = (),
) -> dict[str, pd.DataFrame]:
    """Compare a study of the given recordings and return the two tables by name."""
    results = Results(folder)
    drawn.write_movement(results, ranges)
    finding = Finding("units", SUSPECT, "radians")
    drawn.write(results, PROBLEMS, [problem_row(STAGE, finding, **row) for row in suspect])
    compare_study(recordings, factors, results)
    return {table.name: read_table(results.study_table(table.name), table).to_pandas() for table in TABLES}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> dict[str, pd.DataFrame]:
    """Comparisons of twelve subjects in two groups with three sessions."""
    recordings = drawn.recordings(12)
    folder = tmp_path_factory.mktemp("study")
    return compared(folder, recordings, drawn.ranges(recordings))


def rows_of(table: pd.DataFrame, **where: str) -> pd.DataFrame:
    for column, value in where.items():
        table = table[table[column] == value]
    return table


def test_only_the_simulated_group_difference_is_shown(study: dict[str, pd.DataFrame]) -> None:
    rows = rows_of(study["movement_differences"], factor="group", quantity="range_deg", model="whole-hand")
    moved = rows[rows["of"] == "index_pip flexion"].iloc[0]
    assert (moved.level, moved.other_level, moved.design) == ("A", "B", "between")
    assert (moved.n, moved.n_other, moved.left_out, moved.unit) == (6, 6, 0, "deg")
    assert moved.test == "Welch's t, Cochran's p"
    assert moved.p < moved.p_holm <= 0.05
    assert moved.verdict == "shown"
    assert moved.low <= drawn.EFFECT_DEG <= moved.high
    assert moved.effect_low < moved.effect_size < moved.effect_high
    still = rows[rows["of"] == "index_mcp flexion"].iloc[0]
    assert still.p_holm > 0.05
    assert still.p_holm >= still.p


def test_sessions_are_compared_within_subjects(study: dict[str, pd.DataFrame]) -> None:
    rows = rows_of(study["movement_differences"], factor="session", quantity="range_deg", model="rigid")
    assert set(zip(rows["level"], rows["other_level"], strict=True)) == {("1", "2"), ("1", "3"), ("2", "3")}
    assert set(rows["design"]) == {"within"}
    assert set(rows["n"]) == {12}
    assert set(rows["effect_size_name"]) == {"d_z"}
    assert (rows["low"] < rows["difference"]).all()


def test_repeatability_agrees_with_the_simulated_sessions(study: dict[str, pd.DataFrame]) -> None:
    rows = rows_of(study["movement_reliability"], quantity="range_deg", model="whole-hand")
    assert set(rows["across"]) == {"session"}
    assert (rows["sem_low"] < drawn.RETEST_SD_DEG).all()
    assert (rows["sem_high"] > drawn.RETEST_SD_DEG).all()
    assert (rows["mdc"] / rows["sem"]).to_numpy() == pytest.approx(1.96 * np.sqrt(2), rel=1e-4)
    assert (rows["n"].eq(12) & rows["k"].eq(3)).all()


def test_a_subject_with_more_trials_or_sessions_counts_once(tmp_path: Path) -> None:
    """Trials are averaged within sessions, then sessions within subjects, whatever their number."""
    few = drawn.recordings(8, ("1",))
    values = {row["subject"]: float(index) for index, row in enumerate(few)}
    ranges = [drawn.range_row(row, "rigid", "index_pip", values[row["subject"]], None) for row in few]
    more = few + [few[0] | {"session": "2", "trial": trial} for trial in ("1", "2", "3")]
    extra = zip(more[8:], (6.0, 7.0, 11.0), strict=True)
    ranges += [drawn.range_row(row, "rigid", "index_pip", value, None) for row, value in extra]
    table = compared(tmp_path, more, ranges, factors=["group"])["movement_differences"]
    row = rows_of(table, quantity="range_deg").iloc[0]
    assert (row.n, row.n_other) == (4, 4)
    assert row["mean"] == pytest.approx(np.mean([(0.0 + 8.0) / 2, 2.0, 4.0, 6.0]))
    assert row.p == pytest.approx(row.p_holm)


def test_a_subject_without_a_level_is_left_out_with_the_reason(tmp_path: Path) -> None:
    recordings = drawn.recordings(10, ("",))
    recordings[4] |= {"group": ""}
    table = compared(tmp_path, recordings, drawn.ranges(recordings), factors=["group"])[
        "movement_differences"
    ]
    row = rows_of(table, quantity="range_deg").iloc[0]
    assert (row.n, row.n_other, row.left_out) == (4, 5, 1)
    assert row.left_out_reason == "no level of group: P04"


def test_a_study_without_factors_or_movement_has_empty_tables(tmp_path: Path) -> None:
    tables = compared(tmp_path, drawn.recordings(3, ("",)), [], factors=[])
    assert all(table.empty for table in tables.values())


def test_the_order_of_levels_and_the_design_are_the_same_for_both_hands(tmp_path: Path) -> None:
    """Only two left hands, not the first subject's, have both levels."""
    right = drawn.recordings(8, ("pre", "post"))
    left = [
        row | {"hand": "left"}
        for row in right
        if row["session"] == "post" or row["subject"] in ("P03", "P05")
    ]
    rows = [*right, *left]
    table = compared(tmp_path, rows, drawn.ranges(rows), factors=["session"])["movement_differences"]
    assert set(zip(table["hand"], table["level"], table["other_level"], table["design"], strict=True)) == {
        (hand, "pre", "post", "within") for hand in ("right", "left")
    }
    assert set(table.loc[table["hand"] == "left", "n"]) == {2}


def test_the_correction_covers_all_comparisons_of_two_levels(tmp_path: Path) -> None:
    """It covers hands, tasks and quantities, so corrected p values are larger with ten tasks than with
    one.
    """
    rows = [row | {"task": f"t{task}"} for task in range(10) for row in drawn.recordings(12, ("",))]
    of_tasks = [drawn.ranges(rows[start : start + 12], start, ["rigid"]) for start in range(0, 120, 12)]
    ranges = [row | {"full_range_deg": None} for task_rows in of_tasks for row in task_rows]
    alone = compared(tmp_path / "one", rows[:12], ranges[:24], factors=["group"])["movement_differences"]
    all_of_them = compared(tmp_path / "all", rows, ranges, factors=["group"])["movement_differences"]
    both = alone.merge(all_of_them, on=["task", "of", "quantity"], suffixes=("", "_all"))
    assert len(both) == len(alone) == 2
    assert (both["p_holm_all"] > np.minimum(4 * both["p_holm"], 0.9)).all()
    assert both["p"].equals(both["p_all"])


@pytest.mark.slow
def test_repeatability_names_the_factors_that_it_contains(tmp_path: Path) -> None:
    rows = drawn.recordings(6, ("1", "2"), trials=2)
    rows = [row | {"drug": "yes" if row["session"] == "2" else "no", "tempo": row["trial"]} for row in rows]
    ranges = drawn.ranges(rows, models=["rigid"])
    tables = {
        name: compared(tmp_path / name, rows, ranges, factors=[name])["movement_reliability"]
        for name in ("group", "session", "drug", "tempo")
    }
    contained = {
        name: dict(zip(table["across"], table["contains"], strict=True)) for name, table in tables.items()
    }
    assert contained == {
        "group": {"session": "", "trial": ""},
        "session": {"session": "session", "trial": ""},
        "drug": {"session": "drug", "trial": ""},
        "tempo": {"session": "", "trial": "tempo"},
    }


def test_the_stage_compares_groups_of_the_sheet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Eight subjects are in two groups; without its input tables the stage is refused."""
    recordings = drawn.recordings(8, ("",))
    rows = [f"{row['subject']} right play evaluation {row['subject']}.csv - - - -" for row in recordings]
    people = "\n".join(["subject group", *(f"{row['subject']} {row['group']}" for row in recordings)])
    study = write_study(tmp_path, *rows, more="factors: [group]\n", participants=people)
    results = Results(tmp_path / "results")
    argv = ["--study", str(study), "--results", str(results.folder)]
    assert main(argv) == 2
    assert "problems.parquet" in capsys.readouterr().err
    drawn.write_movement(results, drawn.ranges(recordings))
    drawn.write(results, PROBLEMS, [])
    assert main(argv) == 0
    assert all(results.study_table(name).is_file() for name in MOVEMENT_COMPARISONS)
    path = results.study_table(MOVEMENT_DIFFERENCES.name)
    names = ("level", "other_level", "n", "n_other")
    differences = read_table(path, MOVEMENT_DIFFERENCES).to_pylist()
    assert {tuple(row[name] for name in names) for row in differences} == {("A", "B", 4, 4)}
    assert "participants.tsv" in {entry["file"] for entry in read_metadata(path)["inputs"]}
