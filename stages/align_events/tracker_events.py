"""Read the tracker's own events: its external sync input, and the buttons of its styluses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.stages.align_events.event_list import Array, Clock, Events
from shukotsu.trackers.archive import open_archive
from shukotsu.trackers.decode.survey import UNUSABLE, flagged_records, survey_archive

SYNC, BUTTON = "sync", "button"


@dataclass(frozen=True)
class _Flags:
    """Station, device time and the two flags of records, (N,) each; a flag is NaN where none was sent."""

    station: Array
    time_s: Array
    sync: Array
    button: Array


def read_tracker_events(path: Path) -> Events:
    """Read when the sync input was on and when each stylus button was down, on the recording's clock.

    path : a raw capture. A flag that rises between two frames rose in the middle, to
    the interval over sqrt(12) (1-sigma). sync is the tracker's, the same of every station; button has the
    station as value. One that is on in the first frame began before, and is left out. Raises InputError where
    the file is none, or its tracker sends neither flag.
    """
    parts = list(_of_capture(path))
    station, time_s, sync, button = (
        np.concatenate([getattr(part, name) for part in parts]) if parts else np.zeros(0)
        for name in ("station", "time_s", "sync", "button")
    )
    if np.isnan(sync).all() and np.isnan(button).all():
        raise InputError(f"{path}: its tracker sent neither sync nor buttons; expected one of them")
    stations = np.unique(station)
    rows = list(_pulses(time_s, sync, station == stations[0], SYNC, np.nan))
    for number in stations:
        rows += _pulses(time_s, button, station == number, BUTTON, float(number))
    rows.sort(key=lambda row: row[1])
    return Events.of("tracker", Clock.RECORDING, rows)


def _pulses(
    time_s: Array, flag: Array, own: npt.NDArray[np.bool_], name: str, value: float
) -> Iterator[tuple[str, float, float, float, float]]:
    known = np.flatnonzero(own & ~np.isnan(flag))
    at, on = time_s[known], (flag[known] > 0).astype(int)
    change = np.flatnonzero(np.diff(on))
    middle, gap = (at[change] + at[change + 1]) / 2, at[change + 1] - at[change]
    rises = np.diff(on)[change] > 0
    for place in np.flatnonzero(rises):
        end = float(middle[place + 1]) if place + 1 < len(change) else np.nan
        yield name, float(middle[place]), end - float(middle[place]), value, float(gap[place] / np.sqrt(12))


def _of_capture(path: Path) -> Iterator[_Flags]:
    archive = open_archive(path)
    for part in flagged_records(archive, survey_archive(archive)):
        good = ~part.flagged(*UNUSABLE)
        records = part.records
        flags = (np.where(flag < 0, np.nan, flag)[good] for flag in (records.sync, records.button))
        yield _Flags(records.station[good].astype(float), part.time_s[good], *flags)
