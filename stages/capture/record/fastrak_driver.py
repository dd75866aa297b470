"""Setting up a FASTRAK: its commands mind upper and lower case, and most have no CR.

Source: FASTRAK User Manual OPM00PI002. What it answers to questions for settings is compared where it answers
at all; its status reply says for certain whether it sends binary and centimetres.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from schemas.errors import InputError
from stages.capture.record.conversation import Conversation
from stages.capture.record.directions import is_default_alignment
from stages.capture.record.finding import find
from stages.capture.record.wishes import TRACK, Wishes
from stages.capture.trackers.settings import StreamSettings

STATIONS = range(1, 5)
SHARED_HZ = 120.0
"""Records a second, of all receivers together."""

STOP, STREAM, STATUS, RESUME = b"c", b"C", b"S", b"\x11"
TEXT, BINARY, INCHES, CENTIMETRES = b"F", b"f", b"U", b"u"
FILTER_OFF = (0.0, 1.0, 0.0, 0.0)
ANSWER_S = 0.5

_STATUS = re.compile(rb"2[1-4 ]S([0-9A-Fa-f]{3}).{3} (F\d)(.)  (.{6})([^\r]*)\r\n", re.DOTALL)
_BINARY_FLAG, _CENTIMETRES_FLAG = 1, 2

_ASKED = {"output_list": (b"O", 2), "hemisphere": (b"H", 7), "stylus": (b"e", 1), "alignment": (b"A", 7)}
"""Setting of each receiver -> its letter and the characters of a number in its answer."""


class FastrakDriver:
    """Driver of FASTRAK (see `wishes.Driver`)."""

    def __init__(self, talk: Conversation, wishes: Wishes) -> None:
        if wishes.hemisphere == TRACK:
            raise InputError("--hemisphere: a FASTRAK does not follow a receiver; give x,y,z")
        self.warnings: list[str] = []
        self._talk = talk
        self._wishes = wishes
        self._before: dict[str, Any] = {}

    def set_up(self) -> StreamSettings:
        """Find the tracker, set it up and compare."""
        flags, present, whoami = find(self._talk, "fastrak", self._attempt, self.warnings)
        self._before = {"flags": flags, **self._ask_all()}
        stations = self._choose(present)
        self._set_all(stations)
        after = self._ask_all()
        self._compare(after, stations)
        options = {"whoami": whoami, "before": self._before, "after": after, "warnings": self.warnings}
        wishes = self._wishes
        return StreamSettings(
            "fastrak",
            wishes.mode,
            "cm",
            SHARED_HZ / len(stations),
            stations,
            dict.fromkeys(STATIONS, wishes.items),
            dict.fromkeys(STATIONS, wishes.hemisphere),
            options,
        )

    def start(self) -> Mapping[str, Any]:
        """Have it stream; it has no counters."""
        return {"sent_ns": self._talk.send(STREAM)}

    def stop(self) -> None:
        """Have it stop."""
        self._talk.send(STOP)

    def put_back(self) -> None:
        """Set what was changed to what it was before; a stream that was running stays off."""
        if not self._before:
            return
        send = self._talk.send
        send(STOP)
        for name in ("output_list", "hemisphere", "stylus"):
            letter = _ASKED[name][0]
            for station, values in self._before[name].items():
                if values is not None:
                    send(_command(letter, int(station), values))
        for station in STATIONS if self._wishes.stations is not None and self._before["states"] else ():
            send(_command(b"l", station, (int(station in self._before["states"]),)))
        for name, letter in (("position_filter", b"x"), ("attitude_filter", b"v")):
            if self._wishes.no_filters and self._before[name] is not None:
                send(letter + _numbers(self._before[name]) + b"\r")
        send(CENTIMETRES if self._before["flags"] & _CENTIMETRES_FLAG else INCHES)
        send(BINARY if self._before["flags"] & _BINARY_FLAG else TEXT)
        self._talk.drain(0.1)

    def _attempt(self) -> tuple[tuple[int, tuple[int, ...], str] | None, bytes]:
        """Stop it and ask for its status; what is left of a command is ended first."""
        heard = b""
        for cap_s in (5.0, 2.0, 2.0):
            self._talk.send(b"\r" + RESUME + STOP)
            came, silent = self._talk.drain(cap_s=cap_s)
            heard += came
            if silent:
                break
        self._talk.send(STATUS)
        came, _ = self._talk.drain()
        return _status(came), heard + came

    def _ask_all(self) -> dict[str, Any]:
        state: dict[str, Any] = {
            name: {str(station): self._ask(letter, station, width) for station in STATIONS}
            for name, (letter, width) in _ASKED.items()
        }
        state["position_filter"] = self._ask(b"x", None, 7)
        state["attitude_filter"] = self._ask(b"v", None, 7)
        states = self._ask(b"l", 1, 1)
        state["states"] = states and tuple(s for s, on in zip(STATIONS, states, strict=False) if on)
        return state

    def _ask(self, letter: bytes, station: int | None, width: int) -> tuple[float, ...] | None:
        question = letter + (b"" if station is None else b"%d" % station) + b"\r"
        return self._talk.ask(question, _answer(letter, station, width), ANSWER_S)

    def _choose(self, present: tuple[int, ...]) -> tuple[int, ...]:
        wanted = self._wishes.stations
        if wanted is None:
            if not present:
                raise InputError(f"{self._talk.port.name}: no receiver is connected; plug them in")
            return present
        absent = sorted(set(wanted) - set(STATIONS))
        if absent:
            raise InputError(f"--stations: a FASTRAK has receivers 1 to 4, and no {absent[0]}")
        return wanted

    def _set_all(self, stations: tuple[int, ...]) -> None:
        wishes, send = self._wishes, self._talk.send
        send(CENTIMETRES)
        send(BINARY if wishes.mode == "binary" else TEXT)
        for station in STATIONS:
            send(_command(b"O", station, wishes.items))
            send(_command(b"H", station, wishes.hemisphere))
            send(_command(b"e", station, (0,)))
            if wishes.stations is not None:
                send(_command(b"l", station, (int(station in stations),)))
        if wishes.no_filters:
            send(b"x" + _numbers(FILTER_OFF) + b"\r")
            send(b"v" + _numbers(FILTER_OFF) + b"\r")
        self._talk.drain(0.1)

    def _compare(self, after: Mapping[str, Any], stations: tuple[int, ...]) -> None:
        """Raise InputError where a setting is not what was sent; note what it does not answer."""
        wishes = self._wishes
        self._talk.send(STATUS)
        came, _ = self._talk.drain(0.1)
        found = _status(came)
        flags = None if found is None else found[0] & (_BINARY_FLAG | _CENTIMETRES_FLAG)
        self._must("format and units", flags, int(wishes.mode == "binary") | _CENTIMETRES_FLAG)
        if found is not None and wishes.stations is not None:
            self._must("active receivers", found[1], stations)
        sent = {"output_list": wishes.items, "hemisphere": wishes.hemisphere, "stylus": (0,)}
        for name, values in sent.items():
            for station in stations:
                read = after[name][str(station)]
                if read is None:
                    self.warnings.append(f"receiver {station}: it does not say its {name.replace('_', ' ')}")
                else:
                    self._must(f"{name.replace('_', ' ')} of receiver {station}", read, values)
        odd = [
            s for s in stations if (frame := after["alignment"][str(s)]) and not is_default_alignment(frame)
        ]
        if odd:
            self.warnings.append(
                f"receiver {', '.join(map(str, odd))}: an alignment moves its frame, left as it is"
            )
        for name in ("position_filter", "attitude_filter") if wishes.no_filters else ():
            if after[name] is not None:
                self._must(name.replace("_", " "), after[name], FILTER_OFF)

    def _must(self, what: str, read: Any, sent: Sequence[float] | int) -> None:
        same = read == sent
        if isinstance(read, tuple) and not isinstance(sent, int):
            same = len(read) == len(sent) and all(abs(a - b) < 0.01 for a, b in zip(read, sent, strict=True))
        if not same:
            raise InputError(
                f"{self._talk.port.name}: the tracker did not take its {what}: sent was {sent}, and when "
                f"asked it says {read}; switch it off and on, and try again"
            )


def _status(data: bytes) -> tuple[int, tuple[int, ...], str] | None:
    """Read the status reply: flags, active receivers, who it is; None where there is none."""
    found = _STATUS.search(data)
    if found is None:
        return None
    try:
        map_bits = int(found[3], 16)
    except ValueError:
        map_bits = 0
    active = tuple(station for station in STATIONS if map_bits & 1 << (station - 1))
    who = b" ".join((found[2], found[4], found[5])).decode("latin-1")
    return int(found[1], 16), active, " ".join(who.split())


def _answer(letter: bytes, station: int | None, width: int) -> Callable[[bytes], tuple[float, ...] | None]:
    """Give what finds the answer to a question and reads its numbers, which stand in columns of `width`."""
    number = b"." if station is None else b"%d" % station
    line = re.compile(rb"2" + number + re.escape(letter) + rb"[ A-Za-z]([^\r\n]*)\r\n")

    def read(data: bytes) -> tuple[float, ...] | None:
        found = line.search(data)
        if found is None:
            return None
        text = found[1].decode("latin-1")
        columns = [text[at : at + width] for at in range(0, len(text.rstrip()), width)]
        try:
            return tuple(float(column) for column in columns)
        except ValueError:
            pass
        try:
            return tuple(float(word) for word in text.split())
        except ValueError:
            return None

    return read


def _command(letter: bytes, station: int, values: Sequence[float]) -> bytes:
    return letter + b"%d," % station + _numbers(values) + b"\r"


def _numbers(values: Sequence[float]) -> bytes:
    return ",".join(f"{value:g}" for value in values).encode()
