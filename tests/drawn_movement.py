"""Tables of movement whose numbers are drawn: subjects in groups and sessions, with a known effect."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from typing import Any

import numpy as np

from shukotsu.schemas.movement_tables import (
    EVENT_MEASURES,
    FINGERTIP_DISTANCES,
    FINGERTIP_PATHS,
    MOVEMENT_CURVES,
    RANGES_OF_MOTION,
)
from shukotsu.schemas.results import Results
from shukotsu.schemas.tables import Provenance, Table, columns_from_rows, write_table

Row = dict[str, Any]
JOINTS = ("index_mcp", "index_pip")
MODELS = ("rigid", "whole-hand")
EFFECT_DEG = 12.0
"""What group A moves index_pip more than group B."""
RETEST_SD_DEG = 2.0
"""How far a session differs from the subject's own number."""


def recordings(n_subjects: int, sessions: Sequence[str] = ("1", "2", "3"), trials: int = 1) -> list[Row]:
    """Recordings of subjects who are in group A and B in turn, all of the right hand's task `play`."""
    numbers = [str(trial + 1) for trial in range(trials)] if trials > 1 else [""]
    return [
        {
            "subject": f"P{index:02}",
            "session": session,
            "hand": "right",
            "task": "play",
            "trial": trial,
            "group": "AB"[index % 2],
        }
        for index, session, trial in product(range(n_subjects), sessions, numbers)
    ]


def ranges(rows: Iterable[Row], seed: int = 1, models: Sequence[str] = MODELS) -> list[Row]:
    """Rows of ranges_of_motion: the group's effect, the subject's, session's and trial's own part."""
    rng = np.random.default_rng(seed)
    own: dict[tuple[str, ...], float] = {}
    made = []
    for row, joint in product(rows, JOINTS):
        subject, session = (row["subject"], joint), (row["subject"], row["session"], joint)
        own.setdefault(subject, rng.normal(60.0, 5.0))
        own.setdefault(session, rng.normal(0.0, RETEST_SD_DEG))
        effect = EFFECT_DEG * (row["group"] == "A") * (joint == "index_pip")
        value = own[subject] + own[session] + effect + rng.normal(0.0, 0.1)
        made += [
            range_row(row, model, joint, value + 1.5 * (model == "rigid"), RETEST_SD_DEG) for model in models
        ]
    return made


def range_row(row: Row, model: str, joint: str, value: float, sd: float | None) -> Row:
    """A row of ranges_of_motion: its range is `value`."""
    return {
        **recording_of(row),
        "model": model,
        "joint": joint,
        "angle": "flexion",
        "range_deg": value,
        "range_sd_deg": sd,
        "range_session_sd_deg": sd,
        "full_range_deg": value + 3.0,
        "n_frames": 100,
        "status": "ok",
        "message": "",
    }


def recording_of(row: Row) -> Row:
    """The columns that name the recording."""
    return {name: row[name] for name in ("subject", "session", "hand", "task", "trial")}


def curves(rows: Iterable[Row], seed: int = 2, bump_deg: float = 15.0) -> list[Row]:
    """Rows of movement_curves of index_pip: group A has a bump at 50 %."""
    rng = np.random.default_rng(seed)
    percent = np.arange(101)
    bump = bump_deg * np.exp(-(((percent - 50) / 8.0) ** 2))
    made = []
    for row in rows:
        noise = rng.normal(size=4) @ np.cos(np.arange(4)[:, None] * np.pi * percent / 100)
        curve = 30.0 + 2.0 * noise + bump * (row["group"] == "A")
        made += [
            {
                **recording_of(row),
                "model": "whole-hand",
                "joint": "index_pip",
                "angle": "flexion",
                "event": "key",
                "percent": int(at),
                "mean_deg": float(curve[at]),
                "n_cycles": 5,
            }
            for at in percent
        ]
    return made


def write_movement(results: Results, range_rows: Sequence[Row], curve_rows: Sequence[Row] = ()) -> None:
    """Write the study's tables of movement, those of fingertips empty."""
    for table, rows in (
        (RANGES_OF_MOTION, range_rows),
        (MOVEMENT_CURVES, curve_rows),
        (FINGERTIP_PATHS, ()),
        (FINGERTIP_DISTANCES, ()),
        (EVENT_MEASURES, ()),
    ):
        write(results, table, rows)


def write(results: Results, table: Table, rows: Sequence[Row]) -> None:
    """Write one of the study's tables."""
    path = results.study_table(table.name)
    write_table(path, table, columns_from_rows(table, list(rows)), Provenance())
