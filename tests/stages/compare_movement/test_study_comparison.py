"""A study's comparisons on drawn movement: the effect that is there, who is left out, and the same bytes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import drawn_movement as drawn
import numpy as np
import pandas as pd
import pytest

from schemas.catalogue import PROBLEMS
from schemas.findings import STAGE, SUSPECT, Finding, problem_row
from schemas.movement_tables import (
    CURVE_DIFFERENCES,
    MODEL_DEPENDENCE,
    MOVEMENT_DIFFERENCES,
    MOVEMENT_RELIABILITY,
)
from schemas.results import Results
from schemas.tables import read_table
from stages.compare_movement.study_comparison import compare_study

Row = dict[str, Any]
FOUR = (MOVEMENT_DIFFERENCES, MOVEMENT_RELIABILITY, CURVE_DIFFERENCES, MODEL_DEPENDENCE)


def compared(
    folder: Path,
    recordings: Sequence[Row],
    ranges: Sequence[Row],
    curves: Sequence[Row] = (),
    *,
    factors: Sequence[str] = ("group", "session"),
    suspect: Sequence[Row] = (),
) -> dict[str, pd.DataFrame]:
    """Compare a study of these recordings; give the four tables by name."""
    results = Results(folder)
    drawn.write_movement(results, ranges, curves)
    found = Finding("units", SUSPECT, "radians")
    drawn.write(results, PROBLEMS, [problem_row(STAGE, found, **row) for row in suspect])
    compare_study(recordings, factors, results)
    return {table.name: read_table(results.study_table(table.name), table).to_pandas() for table in FOUR}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> dict[str, pd.DataFrame]:
    """Twelve subjects in two groups, three sessions, one number and one curve."""
    recordings = drawn.recordings(12)
    folder = tmp_path_factory.mktemp("study")
    return compared(folder, recordings, drawn.ranges(recordings), drawn.curves(recordings))


def rows_of(table: pd.DataFrame, **where: str) -> pd.DataFrame:
    for column, value in where.items():
        table = table[table[column] == value]
    return table


def test_the_groups_differ_where_they_do(study: dict[str, pd.DataFrame]) -> None:
    rows = rows_of(study["movement_differences"], factor="group", quantity="range_deg", model="whole-hand")
    moved = rows[rows["of"] == "index_pip flexion"].iloc[0]
    assert (moved.level, moved.other_level, moved.design) == ("A", "B", "between")
    assert (moved.n, moved.n_other, moved.left_out, moved.unit) == (6, 6, 0, "deg")
    assert moved.test == "exact permutation"
    assert moved.p_holm <= 0.05
    assert moved.p_max_t <= 0.05
    assert moved.low <= drawn.EFFECT_DEG <= moved.high
    assert moved.effect_low < moved.effect_size < moved.effect_high
    still = rows[rows["of"] == "index_mcp flexion"].iloc[0]
    assert still.p_holm > 0.05
    assert still.p_holm >= still.p
    assert still.p_max_t > 0.05


def test_sessions_are_compared_within_subjects(study: dict[str, pd.DataFrame]) -> None:
    rows = rows_of(study["movement_differences"], factor="session", quantity="range_deg", model="rigid")
    assert set(zip(rows["level"], rows["other_level"], strict=True)) == {("1", "2"), ("1", "3"), ("2", "3")}
    assert set(rows["design"]) == {"within"}
    assert set(rows["n"]) == {12}
    assert set(rows["effect_size_name"]) == {"d_z"}
    assert (rows["low"] < rows["difference"]).all()


def test_repeatability_is_that_of_the_sessions(study: dict[str, pd.DataFrame]) -> None:
    rows = rows_of(study["movement_reliability"], quantity="range_deg", model="whole-hand")
    assert set(rows["across"]) == {"session"}
    assert (rows["sem_low"] < drawn.RETEST_SD_DEG).all()
    assert (rows["sem_high"] > drawn.RETEST_SD_DEG).all()
    assert (rows["mdc"] / rows["sem"]).to_numpy() == pytest.approx(1.96 * np.sqrt(2), rel=1e-4)
    assert rows["stated_sd"].to_numpy() == pytest.approx(drawn.RETEST_SD_DEG * np.sqrt(2))
    assert (rows["held_percent"] > 80).all()
    assert (rows["n"].eq(12) & rows["k"].eq(3)).all()
    assert rows_of(study["movement_reliability"], quantity="full_range_deg")["stated_sd"].isna().all()


def test_models_that_differ_by_a_constant_agree(study: dict[str, pd.DataFrame]) -> None:
    rows = rows_of(study["model_dependence"], quantity="range_deg")
    assert set(rows["question"]) == {"difference", "reliability"}
    assert set(rows["models"]) == {"rigid;whole-hand"}
    assert rows["agree"].all()
    assert rows["widest_difference"].to_numpy() == pytest.approx(0.0, abs=1e-9)


def test_curves_differ_where_they_do(study: dict[str, pd.DataFrame]) -> None:
    rows = rows_of(study["curve_differences"], factor="group").set_index("percent")
    assert len(rows) == 101
    assert rows.loc[50, "significant"]
    assert rows.loc[50, "p_holm"] <= 0.05
    assert not rows.loc[[0, 100], "significant"].any()
    assert (rows["significant"] == (rows["t"].abs() >= rows["t_threshold"] - 1e-9)).all()
    sessions = rows_of(study["curve_differences"], factor="session")
    assert len(sessions) == 3 * 101
    assert set(sessions["n"]) == {12}


def test_the_same_tables_give_the_same_bytes(tmp_path: Path) -> None:
    recordings = drawn.recordings(8, ("1", "2"))
    for name in ("one", "other"):
        compared(tmp_path / name, recordings, drawn.ranges(recordings), drawn.curves(recordings))
    for table in FOUR:
        one, other = (Results(tmp_path / name).study_table(table.name) for name in ("one", "other"))
        assert one.read_bytes() == other.read_bytes()


def test_trials_and_sessions_do_not_make_a_subject_count_twice(tmp_path: Path) -> None:
    """Trials of another number are averaged first; who has one session stands beside who has three."""
    few = drawn.recordings(8, ("1",))
    values = {row["subject"]: float(place) for place, row in enumerate(few)}
    ranges = [drawn.range_row(row, "rigid", "index_pip", values[row["subject"]], None) for row in few]
    more = few + [few[0] | {"session": "2", "trial": trial} for trial in ("1", "2", "3")]
    extra = zip(more[8:], (6.0, 7.0, 11.0), strict=True)
    ranges += [drawn.range_row(row, "rigid", "index_pip", value, None) for row, value in extra]
    table = compared(tmp_path, more, ranges, factors=["group"])["movement_differences"]
    row = rows_of(table, quantity="range_deg").iloc[0]
    assert (row.n, row.n_other) == (4, 4)
    assert row["mean"] == pytest.approx(np.mean([(0.0 + 8.0) / 2, 2.0, 4.0, 6.0]))
    assert row.p == pytest.approx(row.p_holm)


def test_sessions_are_in_the_order_of_the_sheet_though_its_first_subject_lacks_one(tmp_path: Path) -> None:
    """Bias is of a session to the next: 10 each, and not 20 and -10."""
    recordings = [row for row in drawn.recordings(8) if (row["subject"], row["session"]) != ("P00", "2")]
    noise = np.random.default_rng(2).normal(0.0, 0.1, len(recordings))
    ranges = [
        drawn.range_row(row, "rigid", "index_pip", 10.0 * int(row["session"]) + own, None)
        for row, own in zip(recordings, noise, strict=True)
    ]
    tables = compared(tmp_path, recordings, ranges, factors=["session"])
    pairs = rows_of(tables["movement_differences"], quantity="range_deg")
    assert list(zip(pairs["level"], pairs["other_level"], strict=True)) == [
        ("1", "2"),
        ("1", "3"),
        ("2", "3"),
    ]
    row = rows_of(tables["movement_reliability"], quantity="range_deg").iloc[0]
    assert (row.n, row.k, row.left_out) == (7, 3, 1)
    assert row.left_out_reason == "not in every one of 1, 2, 3: P00"
    assert row.bias == pytest.approx(10.0, abs=0.2)
    assert row.loa_high - row.loa_low < 2.0


def test_the_reason_is_that_of_the_recording_that_does_not_count(tmp_path: Path) -> None:
    recordings = drawn.recordings(8, ("1", "2"))
    suspect = [{"subject": "P01", "session": "2", "hand": "right", "task": "play"}]
    tables = compared(tmp_path, recordings, drawn.ranges(recordings), factors=["session"], suspect=suspect)
    row = rows_of(tables["movement_differences"], quantity="range_deg").iloc[0]
    assert (row.n, row.left_out, row.left_out_reason) == (7, 1, "suspect in part: P01")


def test_who_has_no_level_is_left_out_and_said(tmp_path: Path) -> None:
    recordings = drawn.recordings(10, ("",))
    recordings[4] |= {"group": ""}
    table = compared(tmp_path, recordings, drawn.ranges(recordings), factors=["group"])[
        "movement_differences"
    ]
    row = rows_of(table, quantity="range_deg").iloc[0]
    assert (row.n, row.n_other, row.left_out) == (4, 5, 1)
    assert row.left_out_reason == "no level of group: P04"


def test_who_is_left_out_is_counted_with_the_reason(tmp_path: Path) -> None:
    recordings = drawn.recordings(14, ("",))
    ranges = [row for row in drawn.ranges(recordings) if row["subject"] != "P03"]
    suspect = [{"subject": "P00", "session": "", "hand": "right", "task": "play"}]
    table = compared(tmp_path, recordings, ranges, factors=["group"], suspect=suspect)["movement_differences"]
    row = rows_of(table, quantity="range_deg").iloc[0]
    assert (row.n, row.n_other, row.left_out) == (6, 6, 2)
    assert row.left_out_reason == "suspect: P00; no value: P03"


def test_too_few_subjects_have_numbers_and_no_test(tmp_path: Path) -> None:
    recordings = drawn.recordings(5, ("1", "2"))
    tables = compared(tmp_path, recordings, drawn.ranges(recordings), drawn.curves(recordings))
    rows = tables["movement_differences"]
    assert rows[["p", "p_holm", "low", "high"]].isna().all(axis=None)
    assert set(rows["test"]) == {""}
    assert set(rows_of(rows, factor="session")["message"]) == {
        "not tested: 5 subjects have both levels, a test needs 6"
    }
    assert set(rows_of(rows, factor="group")["message"]) == {
        "not tested: groups of 3 and 2 subjects, a test needs 4 in each"
    }
    assert rows_of(rows, quantity="range_deg")["difference"].notna().all()
    assert tables["model_dependence"].query("question == 'difference'")["agree"].isna().all()
    curves = tables["curve_differences"]
    assert curves[["t", "p", "t_threshold"]].isna().all(axis=None)
    assert curves["difference"].notna().all()
    assert not curves["significant"].any()


def test_hands_are_compared_within_subjects(tmp_path: Path) -> None:
    right = drawn.recordings(7, ("",))
    left = [row | {"hand": "left"} for row in right]
    ranges = drawn.ranges(right) + [row | {"range_deg": row["range_deg"] + 4.0} for row in drawn.ranges(left)]
    rows = compared(tmp_path, [*right, *left], ranges, factors=["hand"])["movement_differences"]
    rows = rows_of(rows, quantity="range_deg")
    assert set(rows["hand"]) == {""}
    assert set(rows["task"]) == {"play"}
    assert set(rows["design"]) == {"within"}
    assert rows["difference"].to_numpy() == pytest.approx(-4.0)


def test_a_study_without_factors_or_movement_has_empty_tables(tmp_path: Path) -> None:
    tables = compared(tmp_path, drawn.recordings(3, ("",)), [], factors=[])
    assert all(table.empty for table in tables.values())


def test_a_measured_factor_is_named_and_not_compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recordings = [row | {"age": str(20 + place)} for place, row in enumerate(drawn.recordings(9, ("",)))]
    tables = compared(tmp_path, recordings, drawn.ranges(recordings), factors=["age"])
    assert tables["movement_differences"].empty
    assert "factor age: has 9 levels" in capsys.readouterr().err
