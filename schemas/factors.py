"""Factors of a study: what its recordings differ in, and at which level each recording stands."""

from __future__ import annotations

import math

from shukotsu.schemas.sheets import PARTICIPANTS, read_sheet
from shukotsu.schemas.study import OWN_FACTORS, Study, levels_of

MOST_LEVELS = 8
"""A factor with more levels than this is not compared pair by pair."""
MOST_NUMBERS = 4
"""Nor is one whose levels are more numbers than this: they were measured, and have an order."""


def factor_levels(study: Study) -> list[dict[str, str]]:
    """Return a row for every evaluated recording: subject, session, hand, task, trial, and a level a factor.

    Factors are named in the study file under `factors`: session, hand, task, or a further
    column of the participants or the recordings sheet. A level is text; it is empty where the recording or
    the participant has none. Raises InputError where the participants sheet cannot be read.
    """
    participants = read_sheet(study.sheets.get("participants"), PARTICIPANTS)
    return levels_of(study.shown, participants, study.factors)


def not_compared(study: Study) -> dict[str, str]:
    """Say of each factor whose levels are not compared pair by pair why they are not."""
    rows = factor_levels(study)
    found = {}
    for factor in study.factors:
        levels = {row[factor] for row in rows} - {""}
        if len(levels) < 2:
            found[factor] = f"has {len(levels)} level{'' if levels else 's'}, so nothing is compared"
        elif factor not in OWN_FACTORS and all(map(_is_number, levels)) and len(levels) > MOST_NUMBERS:
            found[factor] = f"has {len(levels)} numbers as levels, which are not compared pair by pair"
        elif len(levels) > MOST_LEVELS:
            found[factor] = (
                f"has {len(levels)} levels; at most {MOST_LEVELS} are compared pair by pair; put groups of "
                "them into the sheet's column"
            )
    return found


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
