"""Set up a VIPER with command frames, each of which is answered.

The settings last until the tracker is switched off; nothing is stored in it. Source: Polhemus VIPER interface
header.
"""

from __future__ import annotations

import struct

from shukotsu.errors import InputError
from shukotsu.tracker import viper_decoder as viper
from shukotsu.tracker.conversation import TrackerDriver
from shukotsu.tracker.liberty import stations_of
from shukotsu.tracker.records import TRACK, Reply, StreamSettings
from shukotsu.tracker.viper_decoder import ANY, CONTINUOUS, GET, SENSORS, SET, command_frame

HEMISPHERE, FILTER, BORESIGHT, RATE, UNITS, STATION_MAP, STYLUS, WHOAMI = 0, 1, 4, 6, 7, 10, 11, 20
RATES = {120: 2, 240: 3}
CENTIMETRES, QUATERNION, MARK_ONLY, UNFILTERED = 2, 2, 0, 0
ORIENTATION, POSITION = 1, 2
ANSWER_S, _HEADER_BYTES = 1.0, 20

Key = tuple[int, ...]
"""Command, sensor (ANY for all) and argument of a setting."""


class ViperDriver(TrackerDriver):
    """Driver of VIPER."""

    def set_up(self) -> StreamSettings:
        """Identify the tracker, set it up and verify every setting. Raises InputError if any of it fails."""
        whoami = self._find(self._attempt)
        (bits,) = struct.unpack_from("<H", self._get(STATION_MAP, ANY, 0).ljust(2, b"\0"))
        stations = stations_of(bits)
        if not stations:
            raise InputError(f"{self._port_name}: no sensor is connected; plug them in")
        wanted = self._wanted(stations)
        before = {key: self._get(*key) for key in wanted}
        for key, payload in wanted.items():
            self._ask(SET, key, payload)
        after = {key: self._get(*key) for key in wanted}
        for key, payload in wanted.items():
            if not _same(key, after[key], payload):
                self._require(_name(key), after[key].hex(), payload.hex())
        unturned, turned = (struct.pack("<4f", 1, 0, 0, 0), bytes(16)), []
        for station in stations:
            payload = self._ask(GET, (BORESIGHT, station - 1, 0)) or b""
            turned += [str(station)] if len(payload) == 16 and payload not in unturned else []
        if turned:
            self.warnings.append(f"sensor {', '.join(turned)}: a boresight is in force, left as it is")
        named = [{_name(key): data.hex() for key, data in values.items()} for values in (before, after)]
        options = {"whoami": whoami, "before": named[0], "after": named[1], "warnings": self.warnings}
        hemisphere = dict.fromkeys(range(1, SENSORS + 1), self._request.hemisphere)
        rate_hz = float(self._request.rate_hz)
        return StreamSettings("viper", "binary", "cm", rate_hz, stations, {}, hemisphere, options)

    def start(self) -> None:
        """Reset the frame counter and start streaming."""
        self._conversation.send(command_frame(CONTINUOUS, SET, payload=struct.pack("<i", 0)))

    def stop(self) -> None:
        """Stop streaming."""
        self._conversation.send(command_frame(CONTINUOUS, viper.RESET))

    def _attempt(self) -> tuple[str | None, bytes]:
        heard = self._silence(*[command_frame(CONTINUOUS, viper.RESET)] * 2)
        self._conversation.send(command_frame(WHOAMI, GET))
        came, _ = self._conversation.drain()
        for reply in _replies(came):
            if reply.command == WHOAMI and not reply.error:
                text = reply.body[_HEADER_BYTES:].replace(b"\0", b" ").decode("latin-1")
                return " ".join(text.split()), came
        return None, heard + came

    def _wanted(self, stations: tuple[int, ...]) -> dict[Key, bytes]:
        """Return the settings that the recording needs; units are last, so values read before keep theirs."""
        request = self._request
        vector = (1.0, 0.0, 0.0) if request.hemisphere == TRACK else request.hemisphere
        hemisphere = struct.pack("<I3f", int(request.hemisphere == TRACK), *vector)
        wanted: dict[Key, bytes] = {(HEMISPHERE, station - 1, 0): hemisphere for station in stations}
        if request.no_filters:
            off = struct.pack("<I4f", UNFILTERED, 0, 0, 0, 0)
            for kind in (ORIENTATION, POSITION):
                wanted |= {(FILTER, station - 1, kind): off for station in stations}
        wanted[STYLUS, ANY, 0] = struct.pack("<I", MARK_ONLY)
        wanted[RATE, ANY, 0] = struct.pack("<I", RATES[request.rate_hz])
        wanted[UNITS, ANY, 0] = struct.pack("<2I", CENTIMETRES, QUATERNION)
        return wanted

    def _get(self, *key: int) -> bytes:
        payload = self._ask(GET, key)
        if payload is None:
            raise InputError(f"{self._port_name}: the tracker does not report its {_name(key)}")
        return payload

    def _ask(self, action: int, key: Key, payload: bytes = b"") -> bytes | None:
        """Send a command; return the answer's payload, or None if it is refused or not answered."""

        def answer_in(data: bytes) -> tuple[bytes | None] | None:
            for reply in _replies(data):
                if reply.command == key[0]:
                    return (None if reply.error == viper.REFUSED else reply.body[_HEADER_BYTES:],)
            return None

        frame = command_frame(key[0], action, key[1], key[2], payload)
        answer = self._conversation.ask(frame, answer_in, ANSWER_S)
        return None if answer is None else answer[0]


def _replies(data: bytes) -> tuple[Reply, ...]:
    decoded = viper.ViperDecoder().feed(data, final=True)
    return tuple(reply for reply in decoded.replies if reply.command not in (viper.SINGLE, CONTINUOUS))


def _same(key: Key, read: bytes, sent: bytes) -> bool:
    """Return whether a setting equals the value sent; for a filter only the level is compared."""
    if key[0] == FILTER:
        return read[:4] == sent[:4]
    if key[0] == HEMISPHERE and sent[0]:  # the vector changes while the hemisphere follows the sensor
        return bool(read) and bool(read[0] & 1)
    return read == sent


def _name(key: Key) -> str:
    filtered = f"filter of {'positions' if key[2] == POSITION else 'orientations'}"
    names = {HEMISPHERE: "hemisphere", FILTER: filtered, RATE: "rate", UNITS: "units"}
    names |= {STATION_MAP: "sensors", STYLUS: "stylus mode"}
    return names[key[0]] + ("" if key[1] == ANY else f" of sensor {key[1] + 1}")
