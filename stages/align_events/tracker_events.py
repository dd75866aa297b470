"""The tracker's own events: its external sync input, and the buttons of its styluses."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.stages.align_events.event_list import Array, Events
from shukotsu.trackers.archive import open_archive
from shukotsu.trackers.decode.survey import UNUSABLE, flagged_records, survey_archive


def read_tracker_events(path: Path) -> Events:
    """Read when the sync input was on and when each stylus button was down, on the recording's clock.

    path : a raw capture. A flag that rises between two frames rose in the middle, to the interval over
    sqrt(12) (1-sigma). sync is the tracker's, the same of every station; button has the station as value. One
    that is on in the first frame began before, and is left out. Raises InputError where the file is none, or
    its tracker sends neither flag.
    """
    archive = open_archive(path)
    parts = [np.empty((4, 0))]
    for part in flagged_records(archive, survey_archive(archive)):
        good, records = ~part.flagged(*UNUSABLE), part.records
        flags = np.array([records.station, part.time_s, records.sync, records.button], float)
        parts.append(flags[:, good])
    station, time_s, sync, button = np.concatenate(parts, 1)
    if not (sync >= 0).any() and not (button >= 0).any():
        raise InputError(f"{path}: its tracker sent neither sync nor buttons; expected one of them")
    stations = np.unique(station)
    rows = list(_pulses(time_s, sync, station == stations[0], "sync", np.nan))
    for number in stations:
        rows += _pulses(time_s, button, station == number, "button", float(number))
    rows.sort(key=lambda row: row[1])
    return Events.of("tracker", False, rows)


def _pulses(
    time_s: Array, flag: Array, of_station: npt.NDArray[np.bool_], name: str, value: float
) -> Iterator[tuple[str, float, float, float, float]]:
    """Rows of events, of a flag (N,) that is negative where none was sent."""
    sent = np.flatnonzero(of_station & (flag >= 0))
    at, step = time_s[sent], np.diff((flag[sent] > 0).astype(int))
    change = np.flatnonzero(step)
    middle, gap = (at[change] + at[change + 1]) / 2, at[change + 1] - at[change]
    ends = np.append(middle[1:], np.nan)
    for rise in np.flatnonzero(step[change] > 0):
        begin = float(middle[rise])
        yield name, begin, float(ends[rise]) - begin, value, float(gap[rise] / np.sqrt(12))
