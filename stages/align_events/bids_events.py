"""Events of a BIDS dataset: `*_events.tsv`, onsets counted from the recording's first sample."""

from __future__ import annotations

import math
from pathlib import Path

from shukotsu.errors import InputError, listed
from shukotsu.motion_bids.dataset_files import read_rows
from shukotsu.stages.align_events.event_list import Clock, Events

NOTHING = ("", "n/a")


def read_bids_events(path: Path) -> Events:
    """Read onset, duration and, where they are there, trial_type (else value) as name, and value if a number.

    Raises InputError where a column is missing, a cell is no number or a duration is negative.
    """
    header, rows = read_rows(path)
    missing = [name for name in ("onset", "duration") if name not in header]
    if missing:
        raise InputError(
            f"{path}: row 1: column {', '.join(missing)} is missing; found {listed(header)}; expected an "
            "events file of BIDS with onset and duration in seconds"
        )
    events = []
    for line, cells in enumerate(rows, 2):
        row = dict(zip(header, cells, strict=True))
        name = next((row[key] for key in ("trial_type", "value") if row.get(key, "") not in NOTHING), "event")
        onset_s, duration_s = (_number(path, line, key, row[key]) for key in ("onset", "duration"))
        if math.isnan(onset_s):
            raise InputError(f"{path}: row {line}, column onset: is empty; expected seconds")
        if duration_s < 0:
            raise InputError(f"{path}: row {line}, column duration: is {duration_s:g}; expected 0 s or more")
        try:
            value = float(row.get("value", "nan"))
        except ValueError:  # a text, which is the name where nothing else is
            value = math.nan
        events.append((name, onset_s, duration_s, value if math.isfinite(value) else math.nan))
    return Events.of("motion-bids", Clock.START, events)


def _number(path: Path, line: int, column: str, text: str) -> float:
    """A cell's number, NaN where it says that there is none."""
    try:
        value = math.nan if text in NOTHING else float(text)
        if text not in NOTHING and not math.isfinite(value):
            raise ValueError
    except ValueError as error:
        raise InputError(f"{path}: row {line}, column {column}: is {text!r}; expected seconds") from error
    return value
