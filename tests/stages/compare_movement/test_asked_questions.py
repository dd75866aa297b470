"""Questions are answered by the numbers that anyone computes, of whichever design, and by one test each."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import drawn_movement as drawn
import numpy as np
import pandas as pd
import pytest
from scipy import stats

from shukotsu.schemas.catalogue import PROBLEMS
from shukotsu.schemas.movement_tables import QUESTIONS
from shukotsu.schemas.questions import Question
from shukotsu.schemas.results import Results
from shukotsu.schemas.tables import read_table
from shukotsu.stages.compare_movement.study_comparison import Questions, compare_study

Row = dict[str, Any]
N = 20


def question(name: str, factor: str, levels: tuple[str, ...] = (), **more: Any) -> Question:
    """Ask about the range of index_pip, unless `more` says otherwise."""
    known = {"quantity": "range_deg", "curve": "", "of": ("index_pip", "flexion"), "crossed_with": ""}
    known |= {"crossed_levels": (), "hand": "right", "task": "play", "design": "", "model": ""}
    return Question(name, factor=factor, levels=levels, **(known | more))  # type: ignore[arg-type]


ASKED = (
    question("groups", "group", ("A", "B")),
    question("sessions", "session", ("2", "1")),
    question("group by session", "group", ("A", "B"), crossed_with="session", crossed_levels=("2", "1")),
    question("session by group", "session", ("2", "1"), crossed_with="group", crossed_levels=("A", "B")),
    question("session by tempo", "session", ("2", "1"), crossed_with="tempo", crossed_levels=("90", "60")),
    question("group by sex", "group", ("A", "B"), crossed_with="sex", crossed_levels=("m", "f")),
    question("years", "years"),
    question("tempo", "tempo"),
    question("curves", "group", ("A", "B"), quantity="curve", curve="key"),
)


def recordings() -> list[Row]:
    """Twenty subjects, two sessions, three tempi as trials; the group in turn, the sex by pairs."""
    rows = drawn.recordings(N, ("1", "2"), trials=3)
    return [
        row | {
            "sex": "mf"[index // 2 % 2],
            "years": str(3 * index),
            "tempo": {"1": "60", "2": "90", "3": "120"}[row["trial"]],
        }
        for row in rows
        for index in [int(row["subject"][1:])]
    ]  # fmt: skip


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The table by question, and a row a recording with its value."""
    results, rows = Results(tmp_path_factory.mktemp("asked")), recordings()
    rng = np.random.default_rng(5)
    for row in rows:
        gained = 12.0 * (row["group"] == "A") * (row["session"] == "2")
        row["y"] = 50.0 + gained + 0.1 * float(row["tempo"]) + 0.4 * float(row["years"]) + rng.normal()
    ranges = [drawn.range_row(row, "whole-hand", "index_pip", row["y"], None) for row in rows]
    drawn.write_movement(results, ranges, drawn.curves(rows))
    drawn.write(results, PROBLEMS, [])
    asked = {ASKED[0].digest: ("2026-11-24 10:00:00", True)}
    compare_study(rows, [], results, questions=Questions(ASKED, "whole-hand", asked))
    table = read_table(results.study_table("questions"), QUESTIONS).to_pandas().set_index("question")
    return table, pd.DataFrame(rows)


def test_each_difference_is_that_of_the_subjects_means(answers: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    table, rows = answers
    y = rows.pivot_table("y", ["subject", "group", "sex"], ["session", "tempo"])
    session = y["2"].mean(axis=1) - y["1"].mean(axis=1)
    own = y.mean(axis=1)
    a, b = (own.xs(group, level="group") for group in "AB")
    gained = [session.xs(group, level="group") for group in "AB"]
    crossed = (y["2"]["90"] - y["1"]["90"]) - (y["2"]["60"] - y["1"]["60"])
    cells = {key: own.xs(key, level=("group", "sex")).mean() for key in product("AB", "mf")}
    years = rows.groupby("subject")["years"].first().astype(float)
    slopes = [np.polyfit(r["tempo"].astype(float), r["y"], 1)[0] for _, r in rows.groupby("subject")]
    wanted = {
        "groups": a.mean() - b.mean(),
        "sessions": session.mean(),
        "group by session": gained[0].mean() - gained[1].mean(),
        "session by group": gained[0].mean() - gained[1].mean(),
        "session by tempo": crossed.mean(),
        "group by sex": cells["A", "m"] - cells["A", "f"] - cells["B", "m"] + cells["B", "f"],
        "years": np.polyfit(years, own.droplevel([1, 2]), 1)[0],
        "tempo": np.mean(slopes),
    }  # fmt: skip
    for name, value in wanted.items():
        assert table.loc[name, "difference"] == pytest.approx(value), name
    designs = dict(table["design"])
    assert designs == {
        "groups": "between", "sessions": "within", "group by session": "between;within",
        "session by group": "within;between", "session by tempo": "within;within",
        "group by sex": "between;between", "years": "between", "tempo": "within", "curves": "between",
    }  # fmt: skip
    interval = stats.ttest_ind(*gained, equal_var=False).confidence_interval()
    assert tuple(table.loc["group by session", ["low", "high"]]) == pytest.approx(tuple(interval))
    for name, counts in {
        "groups": (10, 10),
        "sessions": (N, N),
        "group by sex": (10, 10),
        "years": (N, 0),
    }.items():
        assert tuple(table.loc[name, ["n", "n_other"]]) == counts


def test_verdicts_find_what_is_there_and_are_of_all_questions(
    answers: tuple[pd.DataFrame, pd.DataFrame],
) -> None:
    table, _ = answers
    shown = {"group by session", "session by group", "years", "tempo", "curves"}
    assert set(table.index[table["verdict"] == "shown"]) >= shown
    assert table.loc["session by tempo", "verdict"] == "not-shown"
    assert (table["p_corrected"] >= table["p"]).all()
    assert (table["detectable"] > 0).all()
    assert 40 < table.loc["curves", "percent"] < 60
    assert tuple(table.loc["groups", ["first_asked", "asked_after_results"]]) == ("2026-11-24 10:00:00", True)
    assert table.loc["years", "asked_after_results"] is None
    assert set(table["model"]) == {"whole-hand"}


def test_what_nobody_has_is_said_and_no_error(tmp_path: Path) -> None:
    """No curve and no number of whom it is about; and groups in which there are too few."""
    results, rows = Results(tmp_path), drawn.recordings(6, ("1",))
    drawn.write_movement(results, drawn.ranges(rows))
    drawn.write(results, PROBLEMS, [])
    asked = [*ASKED[::8], question("none", "group", ("A", "B"), of=("thumb_ip", "flexion"))]
    asked += [question("slope", "years"), question("few", "group", ("A", "B"), crossed_with="session",
                                                   crossed_levels=("1", "2"))]  # fmt: skip
    compare_study([row | {"years": ""} for row in rows], [], results, questions=Questions(asked, "rigid"))
    table = read_table(results.study_table("questions"), QUESTIONS).to_pandas().set_index("question")
    assert set(table["verdict"]) == {""}
    assert table.loc["groups", "message"] == "not tested: groups of 3, 3 subjects, a test needs 4 in each"
    assert table.loc["curves", "message"] == "not tested: groups of 0, 0 subjects, a test needs 4 in each"
    assert table.loc["groups", "difference"] == pytest.approx(drawn.EFFECT_DEG, abs=8.0)
    assert table["p"].isna().all()
