"""Convert a recording to motion that the emulated tracker can play."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu.errors import InputError
from shukotsu.readers.import_recording import read_parts

if TYPE_CHECKING:
    from shukotsu.tracker.emulated_device import PlayedMotion


def read_played_recording(path: Path, layout_name: str, *, loop: bool = False) -> PlayedMotion:
    """Read a recording in any format that needs no mapping, for playback on the stations of its segments.

    Segments without a station are left out, with a note. Raises InputError if the file is not a recording, or
    if none of its segments has a station.
    """
    import numpy as np

    from shukotsu.readers.samples import join_samples
    from shukotsu.study.layout import read_layout
    from shukotsu.tracker.emulated_device import MAX_STATION, recorded_motion

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
    return recorded_motion(samples.frame, station, samples.numbers, loop=loop, notes=notes)
