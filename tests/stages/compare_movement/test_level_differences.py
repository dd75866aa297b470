"""Numbers that are compared together: one that differs is shown among many."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shukotsu.schemas.quantities import QUANTITIES
from shukotsu.stages.compare_movement.level_differences import difference_rows
from shukotsu.stages.compare_movement.movement_values import Recorded, level_column

SUBJECTS = [f"P{number}" for number in range(12)]
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
        recordings.assign(model="m", of=of, value=values[:, index], sd=1.0) for index, of in enumerate(ANGLES)
    )
    found = difference_rows(QUANTITIES[0], numbers.dropna(subset="value"), Recorded(recordings, ("group",)))
    return {row["of"]: row for row in found}


def test_two_groups_of_six_can_show_one_of_many_differences() -> None:
    """Holm's correction cannot: 51 times the smallest p that 6 and 6 subjects have is over 5 %."""
    values = np.random.default_rng(3).normal(60.0, 3.0, (12, len(ANGLES)))
    values[:6, 7] += 20.0
    rows = rows_of(values, {"A": SUBJECTS[:6], "B": SUBJECTS[6:]})
    assert rows[ANGLES[7]]["p_holm"] == pytest.approx(51 * 2 / 924)
    assert rows[ANGLES[7]]["p_max_t"] == pytest.approx(2 / 924)
    assert [of for of, row in rows.items() if row["p_max_t"] <= 0.05] == [ANGLES[7]]


def test_what_too_few_subjects_have_is_not_tested_and_the_rest_is() -> None:
    values = np.random.default_rng(6).normal(0.0, 1.0, (12, len(ANGLES)))
    values[:6, 2] += 9.0
    values[:3, 5] = np.nan
    rows = rows_of(values, {"A": SUBJECTS[:6], "B": SUBJECTS[6:]})
    assert rows[ANGLES[5]]["p"] is None
    assert rows[ANGLES[5]]["p_max_t"] is None
    assert rows[ANGLES[2]]["p_max_t"] <= 0.05
