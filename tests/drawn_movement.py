"""Simulated tables of movement: subjects in groups and sessions with a known effect."""

from collections.abc import Iterable, Sequence
from itertools import product
from typing import Any

import numpy as np

from shukotsu.study.results import Results
from shukotsu.tables.catalogue import CYCLE_CURVES, FINGERTIP_PATHS, RANGES_OF_MOTION
from shukotsu.tables.typed_table import Provenance, Table, columns_from_rows, write_table

Row = dict[str, Any]
JOINTS = ("index_mcp", "index_pip")
MODELS = ("rigid", "whole-hand")
EFFECT_DEG = 12.0
"""The additional range of index_pip in group A."""
RETEST_SD_DEG = 2.0
"""Sd of sessions about the subject's mean."""


def recordings(
    n_subjects: int, sessions: Sequence[str] = ("1", "2", "3"), trials: int = 1, task: str = "play"
) -> list[Row]:
    """Return recordings of one task of the right hand, of subjects alternately in groups A and B."""
    numbers = [str(trial + 1) for trial in range(trials)] if trials > 1 else [""]
    constant = {"hand": "right", "task": task}
    return [
        constant | {"subject": f"P{n:02}", "session": session, "trial": trial, "group": "AB"[n % 2]}
        for n, session, trial in product(range(n_subjects), sessions, numbers)
    ]


def ranges(rows: Iterable[Row], seed: int = 1, models: Sequence[str] = MODELS) -> list[Row]:
    """Return rows of ranges_of_motion with effects of group, subject, session and trial."""
    rng = np.random.default_rng(seed)
    parts_deg: dict[tuple[str, ...], float] = {}
    drawn = []
    for row, joint in product(rows, JOINTS):
        subject, session = (row["subject"], joint), (row["subject"], row["session"], joint)
        parts_deg.setdefault(subject, rng.normal(60.0, 5.0))
        parts_deg.setdefault(session, rng.normal(0.0, RETEST_SD_DEG))
        effect = EFFECT_DEG * (row["group"] == "A") * (joint == "index_pip")
        value = parts_deg[subject] + parts_deg[session] + effect + rng.normal(0.0, 0.1)
        drawn += [
            range_row(row, model, joint, value + 1.5 * (model == "rigid"), RETEST_SD_DEG) for model in models
        ]
    return drawn


def range_row(row: Row, model: str, joint: str, value: float, sd: float | None) -> Row:
    """Return a row of ranges_of_motion with the range `value` in deg."""
    keys = {name: row[name] for name in ("subject", "session", "hand", "task", "trial")}
    numbers = {"range_deg": value, "full_range_deg": value + 3.0, "n_frames": 100}
    errors = {"range_sd_deg": sd, "range_session_sd_deg": sd, "status": "ok", "message": ""}
    return keys | {"model": model, "joint": joint, "angle": "flexion"} | numbers | errors


def curves(rows: Iterable[Row], models: Sequence[str] = MODELS) -> list[Row]:
    """Return rows of cycle_curves: subjects differ in level, groups in shape; the start is missing for
    P00.
    """
    drawn = []
    for n, (row, joint, model) in enumerate(product(rows, JOINTS, models)):
        keys = {name: row[name] for name in ("subject", "session", "hand", "task", "trial")}
        keys |= {"model": model, "event": "tap", "joint": joint, "angle": "flexion"}
        for percent in range(101):
            angle = 30.0 + n % 7 + (20.0 if row["group"] == "A" else 10.0) * np.sin(np.pi * percent / 100)
            missing = row["subject"] == "P00" and percent < 20
            numbers = {"mean_deg": None if missing else angle, "n_cycles": 0 if missing else 5}
            drawn.append(keys | {"cycle_percent": percent} | numbers)
    return drawn


def write_movement(results: Results, range_rows: Sequence[Row], curve_rows: Sequence[Row] = ()) -> None:
    """Write the study's tables of movement, with no fingertip paths."""
    write(results, RANGES_OF_MOTION, range_rows)
    write(results, CYCLE_CURVES, curve_rows)
    write(results, FINGERTIP_PATHS, ())


def write(results: Results, table: Table, rows: Sequence[Row]) -> None:
    path = results.study_table(table.name)
    write_table(path, table, columns_from_rows(table, list(rows)), Provenance())
