"""Convert a recording to motion that the emulated tracker can play."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shukotsu.errors import InputError
from shukotsu.readers.import_recording import read_parts
from shukotsu.readers.samples import join_samples
from shukotsu.study.layout import read_layout
from shukotsu.tracker.emulated_device import MAX_STATION, PlayedMotion


def read_played_recording(path: Path, layout_name: str, *, loop: bool = False) -> PlayedMotion:
    """Read a recording in any format that needs no mapping, for playback on the stations of its segments.

    Segments without a station are left out, with a note. Frame numbers are divided by their median step and
    counted from the first; missing numbers stay gaps. Raises InputError if the file is not a recording, or if
    none of its segments has a station.
    """
    layout = read_layout(layout_name)
    samples = join_samples(read_parts(path, layout))
    receivers = np.array([layout.segments[name].receiver or 0 for name in samples.segments])
    receivers[receivers > MAX_STATION] = 0
    station = receivers[samples.segment]
    if not station.any():
        raise InputError(
            f"{path}: none of its segments has a station from 1 to {MAX_STATION} in layout {layout.name}; "
            "add such `receiver:` numbers to the layout's segments"
        )
    notes = [
        f"segment {samples.segments[index]} has no station from 1 to {MAX_STATION}; not played"
        for index in np.unique(samples.segment[station == 0])
    ]
    numbers, rows = np.unique(samples.frame, return_inverse=True)
    remark: list[str] = []
    if len(numbers) > 1:
        step = max(1, int(np.median(np.diff(numbers))))
        counted = np.rint((numbers - numbers[0]) / step).astype(np.int64)
        if counted[-1] >= 10 * len(numbers) or (np.diff(counted) == 0).any():
            remark = ["its frame numbers do not count frames; its frames are played one after another"]
        else:
            rows = counted[rows]
    played = station > 0
    stations = sorted(set(station[played].tolist()))
    motion = np.full((int(rows.max()) + 1, len(stations), 7), np.nan)
    motion[rows[played], np.searchsorted(stations, station[played])] = samples.numbers[played]
    return PlayedMotion(tuple(stations), motion, loop, (*remark, *notes))
