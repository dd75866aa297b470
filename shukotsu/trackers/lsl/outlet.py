"""Sending poses as LSL streams, for recorders of others: one of type MoCap, one of markers."""

from __future__ import annotations

import time

import numpy as np

from shukotsu.files.xdf_streams import POSITION, QUATERNION
from shukotsu.trackers.decode.stream import Block
from shukotsu.trackers.lsl.port import pylsl
from shukotsu.trackers.protocols.records import Array
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.record.statistics import device_ns

FITTED = "the tracker's clock, put on this computer's by the earliest arrivals of the last 10 s"


class Outlet:
    """The streams `name` and `name markers`; time_stamps : what the stamps are, for the description.

    Raises InputError where pylsl is not installed.
    """

    def __init__(self, name: str, settings: StreamSettings, time_stamps: str = FITTED) -> None:
        lsl = pylsl()
        self._stations, self._rate_hz = np.array(sorted(settings.stations)), settings.rate_hz
        self._held = np.empty((0, 10))
        count = 7 * len(self._stations)
        info = lsl.StreamInfo(name, "MoCap", count, self._rate_hz, "float32", f"shukotsu {name}")
        info.desc().append_child_value("time_stamps", time_stamps)
        channels = info.desc().append_child("channels")
        for station in self._stations.tolist():
            owner = settings.names.get(station, str(station))
            for kind in (*POSITION, *QUATERNION):
                kind = kind[:-1].capitalize() + kind[-1].upper()
                unit = "millimeters" if kind.startswith("Position") else "quaternion"
                channel = channels.append_child("channel")
                channel.append_child_value("label", f"{owner}_{kind}").append_child_value("object", owner)
                channel.append_child_value("type", kind).append_child_value("unit", unit)
        self._poses = lsl.StreamOutlet(info)
        own = (f"{name} markers", "Markers", 1, lsl.IRREGULAR_RATE, "string", f"shukotsu {name} markers")
        self._markers = lsl.StreamOutlet(lsl.StreamInfo(*own))
        self._ahead_s = lsl.local_clock() - time.perf_counter()

    def mark(self, text: str) -> None:
        """Send a marker, of now."""
        self._markers.push_sample([text])

    def push(self, poses: Array, host_s: Array) -> None:
        """Send poses (T, S, 7) in mm, NaN where there is none, and when they were by `time.perf_counter`."""
        if len(poses):
            self._poses.push_chunk(poses.reshape(len(poses), -1), (host_s + self._ahead_s).tolist())

    def add(self, block: Block, delay_ns: float, final: bool) -> None:
        """Send the cycles whose next one has begun; delay_ns : the host's time minus the tracker's."""
        records = block.records
        host_s = (device_ns(block, self._rate_hz) + delay_ns) * 1e-9
        own = (records.frame, records.station, host_s, records.position_mm, records.quaternion)
        known = block.good & np.isin(records.station, self._stations)
        rows = np.concatenate([self._held, np.column_stack(own)[known]])
        whole = (rows[:, 0] < rows[-1:, 0]) | final
        self._held, rows = rows[~whole], rows[whole]
        _, first, cycle = np.unique(rows[:, 0], return_index=True, return_inverse=True)
        poses = np.full((len(first), len(self._stations), 7), np.nan)
        poses[cycle, np.searchsorted(self._stations, rows[:, 1])] = rows[:, 3:]
        self.push(poses, rows[first, 2])
