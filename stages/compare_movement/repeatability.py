"""Measure how well every number repeats, between sessions and between trials of the first session.

A session or trial counts where at least half of the subjects have it, and a subject who has them all. How the
stated sd does is asked of every pair of sessions that a subject has.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.errors import listed
from shukotsu.schemas.quantities import Quantity
from shukotsu.sentences.messages import message_of
from shukotsu.stages.compare_movement.movement_values import SESSION, TRIAL, Recorded
from shukotsu.statistics.paired_statistics import Array
from shukotsu.statistics.reliability_statistics import (
    FEWEST_REPEATED,
    bland_altman,
    reliability,
    stated_against_seen,
)

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]

CELL = ["hand", "task", "model", "of"]


def reliability_rows(quantity: Quantity, numbers: pd.DataFrame, everything: Recorded) -> Iterator[Row]:
    """Rows of movement_reliability for one quantity; numbers : as `numbers_of` gives them."""
    reasons, units = _reasons(everything), dict(zip(numbers["of"], numbers["unit"], strict=True))
    for across, own in ((SESSION, numbers), (TRIAL, _first_sessions(numbers, everything))):
        if own.empty or own[across].nunique() < 2:
            continue
        means = own.groupby([*CELL, "subject", across], sort=False)[["value", "sd"]].mean()
        wide = means.unstack(across, sort=False)
        for key, cell in wide.groupby(CELL, sort=False):
            where = dict(zip(CELL, key, strict=True)) | {"across": across}
            present = set(cell.index.get_level_values("subject"))
            expected = reasons[where["hand"], where["task"]].items()
            absent = {subject: reason for subject, reason in expected if subject not in present}
            row = _row(cell["value"], cell["sd"], absent)
            if row:
                contains = everything.contained[across].get((where["hand"], where["task"]), "")
                named = {"quantity": quantity.name, "unit": units[where["of"]], "contains": contains}
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


def _row(values: pd.DataFrame, sd: pd.DataFrame, absent: dict[str, str]) -> Row:
    """One number. values, sd : a row a subject, a column a session or trial; empty where nothing is
    repeated.
    """
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
    } | _stated(values.to_numpy(), sd.to_numpy())
    if len(complete) < FEWEST_REPEATED or len(shared) < 2:
        few = message_of("few-repeated", n=len(complete), times=len(shared), least=FEWEST_REPEATED)
        return row | {"message": few}
    return row | _repeatability(complete.to_numpy())


def _repeatability(values: Array) -> Row:
    found, agreement = reliability(values), bland_altman(values)
    intervals = {
        "icc_2_1": (found.agreement.value, found.agreement.interval),
        "icc_3_1": (found.consistency.value, found.consistency.interval),
        "sem": (found.sem, found.sem_interval),
        "bias": (agreement.bias, agreement.bias_interval),
        "loa_low": (agreement.low, agreement.low_interval),
        "loa_high": (agreement.high, agreement.high_interval),
    }
    row: Row = {"mdc": found.mdc}
    for name, (value, (low, high)) in intervals.items():
        row |= {name: value, f"{name}_low": low, f"{name}_high": high}
    return row


def _stated(values: Array, sd: Array) -> Row:
    """Compare the stated sd with the differences between any two sessions of a subject."""
    pairs = list(combinations(range(values.shape[1]), 2))
    differences = np.concatenate([values[:, b] - values[:, a] for a, b in pairs])
    stated = np.concatenate([np.hypot(sd[:, a], sd[:, b]) for a, b in pairs])
    found = stated_against_seen(differences, stated)
    if found is None or math.isnan(found.stated):
        return {}
    return {
        "stated_sd": found.stated,
        "difference_to_stated": found.ratio,
        "held_percent": found.held_percent,
    }
