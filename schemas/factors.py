"""Factors of a study: what its recordings differ in, and at which level each recording stands."""

from __future__ import annotations

from shukotsu.schemas.sheets import PARTICIPANTS, read_sheet
from shukotsu.schemas.study import OWN_FACTORS, Study

MISSING = ("", "n/a")
"""Cells that give no level."""


def factor_levels(study: Study) -> list[dict[str, str]]:
    """Give a row for every evaluated recording: subject, session, hand, task, trial, and a level a factor.

    Factors are named in the study file: session, hand, task, or a further column of the participants or the
    recordings sheet. A level is text; it is empty where the recording or the participant has none. Raises
    InputError where the participants sheet cannot be read.
    """
    participants = {
        row["subject"]: row.values for row in read_sheet(study.sheets.get("participants"), PARTICIPANTS)
    }
    rows = []
    for recording in study.shown:
        known = {**participants.get(recording.hand.subject, {}), **dict(recording.factors)}
        levels = {name: str(known.get(name, "")) for name in study.factors if name not in OWN_FACTORS}
        levels = {name: "" if level in MISSING else level for name, level in levels.items()}
        rows.append(recording.key | levels)
    return rows
