"""Measure how well every number repeats, between sessions and between trials of the first session.

A session or trial counts where at least half of the subjects have it, and a subject who has them all.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from shukotsu.errors import listed
from shukotsu.schemas.quantities import Quantity
from shukotsu.stages.compare_movement.movement_values import SESSION, TRIAL, Recorded
from shukotsu.statistics.reliability_statistics import FEWEST_REPEATED, reliability

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]

CELL = ["hand", "task", "model", "of"]


def reliability_rows(quantity: Quantity, numbers: pd.DataFrame, everything: Recorded) -> Iterator[Row]:
    """Rows of movement_reliability for one quantity; numbers : as `numbers_of` gives them."""
    reasons = _reasons(everything)
    keys = ["subject", "hand", "task"]
    first = everything.counted.drop_duplicates(keys)[[*keys, SESSION]]
    first_sessions = numbers.merge(first, on=[*keys, SESSION])
    for across, measured in ((SESSION, numbers), (TRIAL, first_sessions)):
        if measured.empty or measured[across].nunique() < 2:
            continue
        means = measured.groupby([*CELL, "subject", across], sort=False)["value"].mean()
        wide = means.unstack(across, sort=False)
        for key, cell in wide.groupby(CELL, sort=False):
            where = dict(zip(CELL, key, strict=True)) | {"across": across}
            present = set(cell.index.get_level_values("subject"))
            expected = reasons[where["hand"], where["task"]].items()
            absent = {subject: reason for subject, reason in expected if subject not in present}
            row = _row(cell, absent)
            if row:
                contains = everything.contained[across].get((where["hand"], where["task"]), "")
                named = {"quantity": quantity.name, "unit": quantity.unit, "contains": contains}
                yield where | named | row


def _reasons(everything: Recorded) -> dict[tuple[str, str], dict[str, str]]:
    """Return by hand and task every subject who was recorded, and why they would have no value."""
    subjects_of: dict[tuple[str, str], dict[str, str]] = {}
    for row in everything.rows.itertuples():
        subjects = subjects_of.setdefault((row.hand, row.task), {})
        reason = subjects.setdefault(row.subject, row.left_out)
        subjects[row.subject] = reason if reason and row.left_out else ""
    return {
        key: {subject: reason or "no value" for subject, reason in subjects.items()}
        for key, subjects in subjects_of.items()
    }


def _row(values: pd.DataFrame, absent: dict[str, str]) -> Row:
    """Return one number's row, empty where nothing repeats. values : a row a subject, a column a session."""
    shared = values.columns[values.notna().sum() * 2 >= len(values)]
    if values.notna().sum(axis=1).max() < 2:
        return {}
    complete = values[shared].dropna()
    dropped = [str(key[-1]) for key in values.index.difference(complete.index, sort=False)]
    reasons = {subject: f"not in every one of {listed(list(shared))}" for subject in dropped} | absent
    by_reason: dict[str, list[str]] = {}
    for subject, reason in reasons.items():
        by_reason.setdefault(reason, []).append(subject)
    row: Row = {
        "n": len(complete),
        "k": len(shared),
        "left_out": len(reasons),
        "left_out_reason": "; ".join(f"{reason}: {listed(names)}" for reason, names in by_reason.items()),
        "message": "",
    }
    if len(complete) < FEWEST_REPEATED or len(shared) < 2:
        few = f"not stated: {len(complete)} in all {len(shared)}, it takes {FEWEST_REPEATED} subjects"
        return row | {"message": few}
    result = reliability(complete.to_numpy())
    intervals = {
        "icc_2_1": (result.agreement.value, result.agreement.interval),
        "icc_3_1": (result.consistency.value, result.consistency.interval),
        "sem": (result.sem, result.sem_interval),
    }
    for name, (value, (low, high)) in intervals.items():
        row |= {name: value, f"{name}_low": low, f"{name}_high": high}
    return row | {"mdc": result.mdc}
