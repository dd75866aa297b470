"""Setting up a FASTRAK: its commands mind upper and lower case, and most have no CR.

Source: FASTRAK User Manual OPM00PI002. What it answers to questions for settings is compared where it answers
at all; its status reply says for certain whether it sends binary and centimetres.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from shukotsu.errors import InputError
from shukotsu.trackers.families import FAMILIES
from shukotsu.trackers.fastrak.items import OUTPUT_ITEMS
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.record.settings_driver import FILTER_OFF, Setting, SettingsDriver, State

STATIONS = OUTPUT_ITEMS.stations

STOP, STREAM, STATUS, RESUME = b"c", b"C", b"S", b"\x11"
TEXT, BINARY, INCHES, CENTIMETRES = b"F", b"f", b"U", b"u"
ANSWER_S = 0.5

_STATUS = re.compile(rb"2[1-4 ]S([0-9A-Fa-f]{3}).{3} (F\d)(.)  (.{6})([^\r]*)\r\n", re.DOTALL)
_BINARY_FLAG, _CENTIMETRES_FLAG = 1, 2

SETTINGS = {
    "output_list": Setting(b"O", "columns", width=2, per_station=True),
    "hemisphere": Setting(b"H", "columns", width=7, per_station=True),
    "stylus": Setting(b"e", "columns", width=1, per_station=True),
    "alignment": Setting(b"A", "columns", width=7, per_station=True),
    "position_filter": Setting(b"x", "columns", width=7),
    "attitude_filter": Setting(b"v", "columns", width=7),
}
_SWITCH = Setting(b"l", "columns", width=1, per_station=True)
"""Whether a receiver is switched on; the answer has those of all."""


class FastrakDriver(SettingsDriver):
    """Driver of FASTRAK."""

    settings = SETTINGS
    answers_all = False

    def set_up(self) -> StreamSettings:
        """Identify the tracker, set it up and compare."""
        flags, present, whoami = self._find(self._attempt)
        self._before = {"flags": flags, **self._ask_all()}
        stations = self._choose(present)
        request, send = self._request, self._conversation.send
        send(CENTIMETRES)
        send(BINARY if request.mode == "binary" else TEXT)
        self._set_all(self._wanted(), STATIONS)
        for station in STATIONS if request.stations is not None else ():
            send(_SWITCH.assignment(int(station in stations), station))
        self._conversation.drain(0.1)
        after = self._ask_all()
        self._compare_status(stations)
        self._compare(after, self._wanted(), stations)
        self._warn_of_frames(after, stations)
        options = {"whoami": whoami, "before": self._before, "after": after, "warnings": self.warnings}
        return StreamSettings(
            "fastrak",
            request.mode,
            "cm",
            FAMILIES["fastrak"].rates_hz[0] / len(stations),  # all receivers together share the rate
            stations,
            dict.fromkeys(STATIONS, request.items),
            dict.fromkeys(STATIONS, request.hemisphere),
            options,
        )

    def start(self) -> Mapping[str, Any]:
        """Have it stream; it has no counters."""
        return {"sent_ns": self._conversation.send(STREAM)}

    def stop(self) -> None:
        """Have it stop."""
        self._conversation.send(STOP)

    def put_back(self) -> None:
        """Set what was changed to what it was before; a stream that was running stays off."""
        if not self._before:
            return
        send = self._conversation.send
        send(STOP)
        self._restore(self._wanted())
        for station in STATIONS if self._request.stations is not None and self._before["states"] else ():
            send(_SWITCH.assignment(int(station in self._before["states"]), station))
        send(CENTIMETRES if self._before["flags"] & _CENTIMETRES_FLAG else INCHES)
        send(BINARY if self._before["flags"] & _BINARY_FLAG else TEXT)
        self._conversation.drain(0.1)

    def _attempt(self) -> tuple[tuple[int, tuple[int, ...], str] | None, bytes]:
        """Stop it and ask for its status; what is left of a command is ended first."""
        heard = self._silence(b"\r" + RESUME + STOP)
        self._conversation.send(STATUS)
        came, _ = self._conversation.drain()
        return _status(came), heard + came

    def _ask_all(self) -> State:
        states = self._ask(_SWITCH, 1)
        on = states and tuple(station for station, each in zip(STATIONS, states, strict=False) if each)
        return {**super()._ask_all(), "states": on}

    def _ask(self, setting: Setting, station: int = 0) -> tuple[float, ...] | None:
        return self._conversation.ask(
            setting.question(station), lambda data: _answer(data, setting, station), ANSWER_S
        )

    def _wanted(self) -> dict[str, Any]:
        """Give the settings that a recording needs."""
        request = self._request
        wanted = {"output_list": request.items, "hemisphere": request.hemisphere, "stylus": (0,)}
        off = dict.fromkeys(("position_filter", "attitude_filter"), FILTER_OFF)
        return {**wanted, **(off if request.no_filters else {})}

    def _choose(self, present: tuple[int, ...]) -> tuple[int, ...]:
        wanted = self._request.stations
        if wanted is None:
            if not present:
                raise InputError(f"{self._conversation.port.name}: no receiver is connected; plug them in")
            return present
        absent = sorted(set(wanted) - set(STATIONS))
        if absent:
            raise InputError(f"--stations: a FASTRAK has receivers 1 to 4, and no {absent[0]}")
        return wanted

    def _compare_status(self, stations: tuple[int, ...]) -> None:
        """Raise InputError where format, units or active receivers are not what was sent."""
        request = self._request
        self._conversation.send(STATUS)
        came, _ = self._conversation.drain(0.1)
        status = _status(came)
        flags = None if status is None else status[0] & (_BINARY_FLAG | _CENTIMETRES_FLAG)
        self._require("format and units", flags, int(request.mode == "binary") | _CENTIMETRES_FLAG)
        if status is not None and request.stations is not None:
            self._require("active receivers", status[1], stations)


def _status(data: bytes) -> tuple[int, tuple[int, ...], str] | None:
    """Read the status reply: flags, active receivers, who it is; None where there is none."""
    status = _STATUS.search(data)
    if status is None:
        return None
    try:
        map_bits = int(status[3], 16)
    except ValueError:
        map_bits = 0
    active = tuple(station for station in STATIONS if map_bits & 1 << (station - 1))
    who = b" ".join((status[2], status[4], status[5])).decode("latin-1")
    return int(status[1], 16), active, " ".join(who.split())


def _answer(data: bytes, setting: Setting, station: int) -> tuple[float, ...] | None:
    """Find the answer to a question, and read its numbers: in columns, or else between blanks."""
    number = b"%d" % station if setting.per_station else b"."
    line = rb"2" + number + re.escape(setting.command) + rb"[ A-Za-z]([^\r\n]*)\r\n"
    answer = re.search(line, data)
    if answer is None:
        return None
    text = answer[1].decode("latin-1")
    columns = [text[at : at + setting.width] for at in range(0, len(text.rstrip()), setting.width)]
    for parts in (columns, text.split()):
        try:
            return tuple(float(part) for part in parts)
        except ValueError:
            continue
    return None
