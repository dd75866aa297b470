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
    for across, own in ((SESSION, numbers), (TRIAL, _first_sessions(numbers, everything))):
        if own.empty or own[across].nunique() < 2:
            continue
        means = own.groupby([*CELL, "subject", across], sort=False)["value"].mean()
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


def _first_sessions(numbers: pd.DataFrame, everything: Recorded) -> pd.DataFrame:
    """Numbers of the first session of every subject, hand and task, as the sheet has them."""
    place = ["subject", "hand", "task"]
    first = everything.counted.drop_duplicates(place)[[*place, SESSION]]
    return numbers.merge(first, on=[*place, SESSION])


def _reasons(everything: Recorded) -> dict[tuple[str, str], dict[str, str]]:
    """By hand and task, every subject who was recorded, and why they would have no value."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for row in everything.rows.itertuples():
        subjects = found.setdefault((row.hand, row.task), {})
        known = subjects.setdefault(row.subject, row.left_out)
        subjects[row.subject] = known if known and row.left_out else ""
    return {
        place: {subject: reason or "no value" for subject, reason in subjects.items()}
        for place, subjects in found.items()
    }


def _row(values: pd.DataFrame, absent: dict[str, str]) -> Row:
    """One number. values : a row a subject, a column a session or trial; empty where nothing is repeated."""
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
        "left_out_reason": "; ".join(f"{reason}: {listed(own)}" for reason, own in by_reason.items()),
        "message": "",
    }
    if len(complete) < FEWEST_REPEATED or len(shared) < 2:
        few = f"not stated: {len(complete)} in all {len(shared)}, it takes {FEWEST_REPEATED} subjects"
        return row | {"message": few}
    found = reliability(complete.to_numpy())
    intervals = {
        "icc_2_1": (found.agreement.value, found.agreement.interval),
        "icc_3_1": (found.consistency.value, found.consistency.interval),
        "sem": (found.sem, found.sem_interval),
    }
    for name, (value, (low, high)) in intervals.items():
        row |= {name: value, f"{name}_low": low, f"{name}_high": high}
    return row | {"mdc": found.mdc}
