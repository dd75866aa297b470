"""The tracker's own sync input and buttons, from its records."""

from pathlib import Path

import numpy as np
from event_files import flags_of

from shukotsu.stages.align_events.event_list import Events
from shukotsu.stages.align_events.tracker_events import read_tracker_events

FRAMES = 10
RATE_HZ = 240.0


def records(
    tmp_path: Path, sync: list[int], buttons: dict[int, list[int]], lost: tuple[int, ...] = ()
) -> Events:
    """Two stations' records, frame by frame."""
    rows = [
        (frame, station, sync[frame], buttons.get(station, [0] * FRAMES)[frame])
        for frame in range(FRAMES)
        for station in (1, 2)
        if frame not in lost
    ]
    return read_tracker_events(flags_of(tmp_path / "records.arrows", rows))


def test_sync_rises_between_two_frames(tmp_path: Path) -> None:
    """Once for the tracker, though every station says it; a button is its station's."""
    events = records(tmp_path, [0, 0, 1, 1, 0, 0, 0, 1, 0, 0], {2: [0, 0, 0, 1, 1, 1, 0, 0, 0, 0]})
    assert events.names == ("sync", "button", "sync")
    np.testing.assert_allclose(events.time_s * RATE_HZ, [1.5, 2.5, 6.5])
    np.testing.assert_allclose(events.duration_s * RATE_HZ, [2, 3, 1])
    np.testing.assert_array_equal(events.value, [np.nan, 2, np.nan])
    np.testing.assert_allclose(events.sd_s * RATE_HZ, np.full(3, 12**-0.5))
    assert not events.own_clock


def test_lost_frames_leave_the_time_less_sure(tmp_path: Path) -> None:
    events = records(tmp_path, [0, 0, 0, 0, 1, 1, 1, 1, 1, 1], {}, lost=(2, 3))
    np.testing.assert_allclose(events.time_s * RATE_HZ, [2.5])
    np.testing.assert_allclose(events.sd_s * RATE_HZ, [3 / np.sqrt(12)])
    assert np.isnan(events.duration_s).all()
