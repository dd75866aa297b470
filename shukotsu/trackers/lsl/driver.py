"""Recording an LSL stream: its description says where the poses are, and nothing can be set."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from shukotsu.errors import InputError
from shukotsu.files.limits import RATES_HZ
from shukotsu.files.xdf_streams import Channel, check_described, described, owners, pose_channels
from shukotsu.schemas.units import MM_PER_UNIT, UNIT_NAMES
from shukotsu.trackers.lsl.decoder import DESCRIPTION, OFFSET, LslDecoder, frames_in
from shukotsu.trackers.lsl.port import CONNECT_S, DESCRIBE, START, STOP
from shukotsu.trackers.protocols.records import Array
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.record.driver import Driver

LOOK_S = 1.0
EVEN, NEARLY_ALL = 0.25, 0.9
"""A stream is steady where nearly all samples are so near to a period apart [periods]."""

MOST_OBJECTS, MOST_HZ = 255, 9999.0
STAMP = "the sender's LSL time stamp: when it says that the pose was measured, received or sent"


class LslDriver(Driver):
    """Driver of LSL streams."""

    def set_up(self) -> StreamSettings:
        """Have the stream described; measure its rate where it names none."""
        answer = self._conversation.ask(DESCRIBE, lambda data: frames_in(data)[0] or None, 2 * CONNECT_S)
        bodies = {frame.kind: frame.body for frame in answer or ()}
        if DESCRIPTION not in bodies:
            raise InputError(f"{self._port_name}: the stream says nothing of itself; start its sender again")
        self._offset_known = OFFSET in bodies
        if not self._offset_known:
            self.warnings.append("the sender's clock does not answer (a firewall?); times are its own")
        stream = described(self._port_name, bodies[DESCRIPTION])
        check_described(self._port_name, stream)
        names = owners(stream)
        if not 0 < len(names) <= MOST_OBJECTS:
            raise InputError(
                f"{self._port_name}: has {len(names)} objects with poses; expected channels of type "
                "PositionX ... and OrientationA ..., each with its marker or object"
            )
        channels = [pose_channels(self._port_name, stream, name) for name in names]
        unit = self._unit([channel for own in channels for channel in own[:3]])
        stations = range(1, len(names) + 1)
        options = {
            "whoami": f"LSL stream {stream.name} ({stream.type})",
            "names": {str(station): names[station - 1] for station in stations},
            "stamps": True,
            "format": stream.format,
            "channel_count": stream.channel_count,
            "channels": {str(s): [channel.index for channel in channels[s - 1]] for s in stations},
            "warnings": self.warnings,
        }
        settings = StreamSettings("lsl", "binary", unit, 1.0, tuple(stations), options=options)
        step_s = self._steps_s(settings)
        rate_hz = stream.rate_hz or (1 / step_s.mean() if len(step_s) and step_s.mean() > 0 else 0.0)
        if not rate_hz:
            raise InputError(
                f"{self._port_name}: has no rate of its own, and no two poses have come in {LOOK_S:g} s; "
                "start its sender before the recorder"
            )
        steady = bool(stream.rate_hz and np.mean(np.abs(step_s * rate_hz - 1) < EVEN) > NEARLY_ALL)
        rate_hz = min(max(rate_hz, 2 * RATES_HZ[0]), MOST_HZ)
        return replace(settings, rate_hz=rate_hz, options={**options, "steady": steady})

    def start(self) -> Mapping[str, Any]:
        """Have it come; gives what its stamps are."""
        sent_ns = self._conversation.send(START)
        how = "corrected by the clock offsets beside them" if self._offset_known else "not corrected"
        return {"sent_ns": sent_ns, "stamps": f"{STAMP}; {how}"}

    def stop(self) -> None:
        """Have no more come."""
        self._conversation.send(STOP)

    def put_back(self) -> None:
        """Have no more come: nothing was set."""
        self.stop()
        self._conversation.drain(0.1)

    def _unit(self, positions: list[Channel]) -> str:
        """Give the unit of positions: the description's, or what the port's name says where that has none."""
        given = getattr(self._conversation.port, "unit", "")
        units = {UNIT_NAMES.get(channel.unit or given, channel.unit) for channel in positions}
        if len(units) > 1 or not units <= {*MM_PER_UNIT} or (given and {UNIT_NAMES.get(given)} != units):
            raise InputError(
                f"{self._port_name}: has positions in {', '.join(sorted(units)) or 'no unit'}; expected m, "
                "cm, mm or inch for all; where it says nothing give lsl:NAME?unit=mm"
            )
        return units.pop()

    def _steps_s(self, settings: StreamSettings) -> Array:
        """Let the stream come for a while; gives the times between its samples."""
        self._conversation.send(START)
        came, start = b"", time.perf_counter()
        while time.perf_counter() - start < LOOK_S:
            came += self._conversation.receive(0.05)
        self.stop()
        self._conversation.drain(0.1)
        records = LslDecoder(settings).feed(came, final=True).records
        _, rows = np.unique(records.cycle, return_index=True)
        return np.diff(records.stamp_ns[rows]) * 1e-9
