"""Numbers that are compared together: one that differs is shown among many."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from shukotsu.movement.study_comparison import Recorded, difference_rows, judge, level_column, level_pairs
from shukotsu.tables.quantities import QUANTITIES

SUBJECTS = [f"P{number}" for number in range(24)]
ANGLES = [f"joint{number} flexion" for number in range(51)]
HAND = {"hand": "right", "task": "rom", "session": "", "trial": ""}


def rows_of(values: np.ndarray, levels: dict[str, list[str]]) -> dict[str, dict[str, Any]]:
    """Rows by angle; values (subjects and levels, angles), NaN where there is none."""
    recordings = pd.DataFrame(
        [
            HAND | {"subject": s, level_column("group"): level, "left_out": ""}
            for level, own in levels.items()
            for s in own
        ]
    )
    numbers = pd.concat(
        recordings.assign(model="m", of=of, value=values[:, index]) for index, of in enumerate(ANGLES)
    )
    pairs = list(level_pairs(Recorded(recordings, ("group",))))
    found = list(difference_rows(QUANTITIES[0], numbers.dropna(subset="value"), pairs))
    judge(found)
    return {row["of"]: row for row in found}


def test_groups_show_one_of_many_differences_where_they_can() -> None:
    values = np.random.default_rng(3).normal(60.0, 3.0, (24, len(ANGLES)))
    values[:12, 7] += 20.0
    rows = rows_of(values, {"A": SUBJECTS[:12], "B": SUBJECTS[12:]})
    assert [of for of, row in rows.items() if row["verdict"] == "shown"] == [ANGLES[7]]
    assert rows[ANGLES[7]]["p"] < rows[ANGLES[7]]["p_holm"] <= 0.05


def test_what_too_few_subjects_have_is_not_tested_and_the_rest_is() -> None:
    values = np.random.default_rng(6).normal(0.0, 1.0, (24, len(ANGLES)))
    values[:12, 2] += 9.0
    values[:9, 5] = np.nan
    rows = rows_of(values, {"A": SUBJECTS[:12], "B": SUBJECTS[12:]})
    assert rows[ANGLES[5]]["p"] is None
    assert rows[ANGLES[5]]["p_holm"] is None
    assert rows[ANGLES[2]]["p_holm"] <= 0.05
