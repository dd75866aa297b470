"""Made-up tables of movement for a made-up study: ranges and statistics of two groups and sessions.

Of every range group A has 12 deg more in index_pip; the numbers of statistics are made, not computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from report_samples.made_study import write
from shukotsu.tables.catalogue import MOVEMENT_DIFFERENCES, MOVEMENT_RELIABILITY, RANGES_OF_MOTION

Row = dict[str, Any]
ANGLES = ("flexion", "abduction", "rotation")
JOINTS = ("thumb_mcp", "index_mcp", "index_pip", "middle_mcp", "middle_pip", "ring_pip", "little_pip")
LARGEST = ("index_pip", "flexion")
LEVELS = {"factor": "group", "level": "A", "other_level": "B"}
TASK = {"hand": "right", "task": "opposition"}


def write_movement(
    results: Path, subjects: Sequence[str], *, models: Sequence[str] = ("whole-hand",)
) -> None:
    """Write the tables, of two sessions of every subject."""
    rng = np.random.default_rng(11)
    ranges = [
        _range(subject, session, model, joint, angle, rng)
        for subject, session, model, joint, angle in product(subjects, "12", models, JOINTS, ANGLES)
    ]
    write(results / "ranges_of_motion.parquet", RANGES_OF_MOTION, ranges)
    of = [(f"{joint} {angle}", rank) for rank, (joint, angle) in enumerate(product(JOINTS, ANGLES))]
    n = len(subjects) // 2
    write(
        results / "movement_differences.parquet", MOVEMENT_DIFFERENCES, [_difference(*own, n) for own in of]
    )
    write(
        results / "movement_reliability.parquet", MOVEMENT_RELIABILITY, [_reliable(*own, 2 * n) for own in of]
    )


def _range(subject: str, session: str, model: str, joint: str, angle: str, rng: np.random.Generator) -> Row:
    large = {"flexion": 50.0, "abduction": 14.0, "rotation": 8.0}[angle] + 12.0 * ((joint, angle) == LARGEST)
    value = large + rng.normal(0.0, 0.1 * large)
    return {
        **TASK,
        "subject": subject,
        "session": session,
        "trial": "",
        "model": model,
        "joint": joint,
        "angle": angle,
        "range_deg": value,
        "low_deg": -5.0,
        "high_deg": value - 5.0,
        "full_range_deg": value + 2.0,
        "median_deg": value / 2,
        "range_sd_deg": 1.5,
        "median_sd_deg": 1.0,
        "range_session_sd_deg": 0.8,
        "median_session_sd_deg": 0.6,
        "speed_median_deg_s": value,
        "speed_p95_deg_s": 3.0 * value,
        "n_frames": 300,
        "valid_percent": 99.0,
        "status": "ok",
    }


def _difference(of: str, rank: int, n: int) -> Row:
    difference = 12.1 if of == " ".join(LARGEST) else 0.3 * (-1) ** rank
    shown = difference > 1
    return {
        **LEVELS,
        **TASK,
        "model": "whole-hand",
        "quantity": "range_deg",
        "of": of,
        "design": "between",
        "n": n,
        "n_other": n,
        "left_out": 1,
        "left_out_reason": "P9: suspect",
        "mean": 60.0 + difference,
        "other_mean": 60.0,
        "difference": difference,
        "low": difference - 4.0,
        "high": difference + 4.0,
        "effect_size": 0.1 * difference,
        "effect_size_name": "hedges_g",
        "p": 0.0001 if shown else 0.5,
        "p_holm": 0.0021 if shown else 1.0,
        "verdict": "shown" if shown else "not-shown",
        "test": "Welch's t",
        "unit": "deg",
    }


def _reliable(of: str, rank: int, n: int) -> Row:
    sem = 1.0 + 0.1 * rank
    return {
        **TASK,
        "across": "session",
        "model": "whole-hand",
        "quantity": "range_deg",
        "of": of,
        "n": n,
        "k": 2,
        "left_out": 0,
        "icc_2_1": 0.8,
        "icc_2_1_low": 0.5,
        "icc_2_1_high": 0.9,
        "icc_3_1": 0.82,
        "icc_3_1_low": 0.5,
        "icc_3_1_high": 0.92,
        "sem": sem,
        "mdc": 2.77 * sem,
        "unit": "deg",
    }
