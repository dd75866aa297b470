"""Set up LIBERTY and PATRIOT, from any state in which an earlier program left them.

They keep their settings between programs and do not acknowledge assignments. Therefore the driver stops and
wakes the tracker, reads all settings, sets those that matter, reads them again and compares, all in binary.
Commands whose effect would outlast this recording or accumulate (saved settings, alignment, boresight) are
never sent. Source of the commands: LIBERTY User Manual URM03PH156.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from shukotsu.errors import InputError
from shukotsu.tracker import liberty as replies
from shukotsu.tracker.conversation import Conversation, RecordingRequest, TrackerDriver, format_setting
from shukotsu.tracker.families import FAMILIES
from shukotsu.tracker.liberty import ERRORS, HALVES, ITEMS, TAGS, Setting, Value
from shukotsu.tracker.records import TRACK, StreamSettings

State = dict[str, Any]
"""Name of a setting -> its value, or station -> value; None if the tracker did not answer."""
FILTER_OFF = (0.0, 1.0, 0.0, 0.0)
POLL = b"P"
"""Ends a stream and requests one record of each station; the only command without CR."""
STREAM = b"C\r"
BINARY = b"F1\r"
RESET_COUNTERS = b"Q0\r"
WHOAMI = b"\x16\r"
WHOAMI_NUMBERS = 3
"""Number of bytes before the text of the answer: ports, type, 0."""
RATES = {120: 3, 240: 4}
"""Frames per second -> argument of the rate command."""
SETTINGS = {
    "units": Setting(b"U"),
    "rate": Setting(b"R"),
    "stations": Setting(b"\x15", HALVES, 2),
    "source_frame": Setting(b"G", "<f4", 3),
    "external_sync": Setting(b"Z"),
    "position_filter": Setting(b"X", "<f4", 4),
    "attitude_filter": Setting(b"Y", "<f4", 4),
    "bit_errors": Setting(b"\x14", "<u4", 0),
    "echo": Setting(b"\x05"),
    "usb_buffering": Setting(b"@B"),
    "output_list": Setting(b"O", "<i4", 0, per_station=True),
    "hemisphere": Setting(b"H", "<f4", 3, per_station=True),
    "stylus": Setting(b"L", per_station=True),
    "boresight": Setting(b"B", "<f4", 3, per_station=True),
    "alignment": Setting(b"A", "<f4", 9, per_station=True),
    "tip_offset": Setting(b"N", "<f4", 3, per_station=True),
}
"""Settings that are queried before and after set-up, in this order."""
CENTIMETRES, ANSWER_S = 1, 1.0


class LibertyDriver(TrackerDriver):
    """Driver of LIBERTY and PATRIOT."""

    def __init__(self, conversation: Conversation, request: RecordingRequest) -> None:
        super().__init__(conversation, request)
        self._ports = FAMILIES[request.family].connectors
        self._switches: dict[int, bool] = {}

    def set_up(self) -> StreamSettings:
        """Identify the tracker, set it up and verify every setting. Raises InputError if any of it fails."""
        whoami = self._find(self._attempt)
        before = self._ask_all()
        stations = self._choose_stations(before["stations"])
        wanted = self._wanted(echo=bool(before["echo"]))
        for name, value in wanted.items():
            self._conversation.send(SETTINGS[name].assignment(value))
        for station, on in self._switches.items():
            self._conversation.send(SETTINGS["stations"].assignment(int(on), station))
        came, _ = self._conversation.drain(0.1)
        self._complaints = [ERRORS[r.error] for r in replies.binary_answers(came) if r.error in ERRORS]
        after = self._ask_all()
        # receivers that can send; an error if there are none, or if they differ from --stations
        halves = after["stations"]
        usable = None if halves is None else replies.stations_of(halves[0] & halves[1])
        active = tuple(station for station in stations if station in (usable or ()))
        if self._request.stations is not None or not active:
            self._require("active receivers", usable, stations)
        if off := [station for station in stations if station not in active]:
            self.warnings.append(f"receiver {', '.join(map(str, off))}: cannot be switched on; not recorded")
        stations = active
        if after["echo"] is not None:
            wanted["echo"] = 0
        self._compare(after, wanted, stations)
        self._warn_of(after, stations)
        request, every = self._request, range(1, self._ports + 1)  # receivers may be plugged in later
        items, hemisphere = dict.fromkeys(every, request.items), dict.fromkeys(every, request.hemisphere)
        options = {"whoami": whoami, "before": before, "after": after, "warnings": self.warnings}
        of_stream = float(request.rate_hz), stations, items, hemisphere, options
        return StreamSettings(request.family, "binary", "cm", *of_stream)

    def start(self) -> None:
        """Reset the counters and start streaming."""
        self._conversation.send(RESET_COUNTERS)
        self._conversation.send(STREAM)

    def stop(self) -> None:
        """Stop streaming; the tracker sends one more record of each station."""
        self._conversation.send(POLL)

    def _attempt(self) -> tuple[str | None, bytes]:
        """Stop a stream, wait for any reply, request the identification; return it and all bytes received."""
        # An incomplete command left by an aborted program would swallow the first poll.
        before = self._silence(POLL, b"\r" + POLL)
        answer = self._conversation.ask(b"\r", lambda data: data or None, ANSWER_S)
        rest, _ = self._conversation.drain(cap_s=2.0)
        heard = before + (answer or b"") + rest
        return (self._identify() if heard else None), heard

    def _identify(self) -> str | None:
        """Return the tracker's identification, None without an answer. InputError if the family is wrong."""

        def whoami(data: bytes) -> tuple[str, bytes] | None:
            for family, tag in TAGS.items():
                for reply in replies.binary_answers(data, [tag]):
                    if reply.command == WHOAMI[0] and reply.station == 0:
                        return family, reply.body
            return None

        self._conversation.send(BINARY)
        answer = self._conversation.ask(WHOAMI, whoami, ANSWER_S)
        if answer is None:
            return None
        family, body = answer
        if family != self._request.family:
            title = FAMILIES[family].title
            raise InputError(f"{self._port_name}: the tracker is a {title}; give --tracker {family}")
        if body and 1 <= body[0] <= 16:
            self._ports = min(body[0], self._ports)
        return " ".join(body[WHOAMI_NUMBERS:].decode("ascii", "replace").split())

    def _ask_all(self) -> State:
        every, state = range(1, self._ports + 1), State()
        for name, setting in SETTINGS.items():
            if setting.per_station:
                state[name] = {str(station): self._ask(setting, station) for station in every}
            else:
                state[name] = self._ask(setting)
        return state

    def _ask(self, setting: Setting, station: int = 0) -> Value | None:
        """Query a setting; return its value, or None if the query is refused or not answered."""

        def answer_in(data: bytes) -> tuple[Value | None] | None:
            for reply in replies.binary_answers(data, [TAGS[self._request.family]]):
                if reply.error in ERRORS and reply.command not in b"PC":
                    return (None,)
                value = replies.binary_value(setting, reply)
                if replies.answers(reply, setting, station) and value is not None:
                    return (value,)
            return None

        answer = self._conversation.ask(setting.question(station), answer_in, ANSWER_S)
        return None if answer is None else answer[0]

    def _choose_stations(self, halves: tuple[int, ...] | None) -> tuple[int, ...]:
        """Return the stations to record; without --stations all connected ones, even if switched off.

        Raises InputError if a requested station is not connected.
        """
        if halves is None:
            raise InputError(f"{self._port_name}: the tracker does not report which receivers are connected")
        # the manual is ambiguous about which mask is which; only stations in both can send
        usable, wanted = replies.stations_of(halves[0] & halves[1]), self._request.stations
        connected = {s for s in replies.stations_of(halves[0] | halves[1]) if s <= self._ports}
        absent = [] if wanted is None else sorted(set(wanted) - connected)
        if absent:
            raise InputError(
                f"{self._port_name}: receiver {absent[0]} of --stations is not connected; "
                f"connected are {', '.join(map(str, sorted(connected))) or 'none'}"
            )
        if not connected:
            raise InputError(f"{self._port_name}: no receiver is connected; plug them in and wait a second")
        if wanted is None:
            self._switches = dict.fromkeys(sorted(connected - set(usable)), True)
            return tuple(sorted(connected))
        self._switches = {station: station in wanted for station in range(1, self._ports + 1)}
        return wanted

    def _wanted(self, *, echo: bool) -> dict[str, Any]:
        """Return the settings that the recording needs, in the order in which they are sent."""
        request = self._request
        wanted: dict[str, Any] = {"echo": 0} if echo else {}
        wanted["units"] = CENTIMETRES
        if request.family == "liberty":
            wanted["rate"] = RATES[request.rate_hz]
        wanted |= {"output_list": request.items, "hemisphere": request.hemisphere, "stylus": 0}
        # With external sync off, the sync item would always be 0.
        wanted["external_sync"] = int(any("sync" in ITEMS[item][0] for item in request.items))
        if request.no_filters:
            wanted |= dict.fromkeys(("position_filter", "attitude_filter"), FILTER_OFF)
        return wanted

    def _compare(self, after: State, wanted: Mapping[str, Any], stations: tuple[int, ...]) -> None:
        """Raise InputError if a setting differs from the value sent."""
        for name, sent in wanted.items():
            title = "stylus mode" if name == "stylus" else name.replace("_", " ")
            values = {title: after[name]}
            if SETTINGS[name].per_station:
                values = {f"{title} of receiver {station}": after[name][str(station)] for station in stations}
            for what, reported in values.items():
                if name == "hemisphere" and reported and same_direction(reported, sent):
                    continue
                if name == "hemisphere" and sent == TRACK:  # the tracker may report its present hemisphere
                    continue
                # The tracker may report the limits of a filter in reverse order.
                answer, asked = (sorted(v) if name.endswith("filter") and v else v for v in (reported, sent))
                if answer != asked:
                    self._require(what, reported, sent)

    def _warn_of(self, after: State, stations: tuple[int, ...]) -> None:
        """Warn of faults, and of settings of earlier programs that a recorder must not undo."""
        for name, (is_default, text) in FRAMES.items():
            odd = [s for s in stations if after[name][str(s)] and not is_default(after[name][str(s)])]
            if odd:
                value = format_setting(after[name][str(odd[0])])
                self.warnings.append(f"receiver {', '.join(map(str, odd))}: {text} ({value}), left as it is")
        if after["source_frame"] and not is_zero(after["source_frame"]):
            turned = format_setting(after["source_frame"])
            self.warnings.append(f"the transmitter's mounting frame is turned by {turned} deg, left as it is")
        if any(after["bit_errors"] or ()):
            words = " ".join(f"{word:08x}" for word in after["bit_errors"])
            self.warnings.append(f"its built-in test has found faults (words {words}, see its manual)")
        if after["usb_buffering"] == 0:
            self.warnings.append("USB buffering is off, so that frames may be lost, left as it is")


LEAST_COSINE = 0.9999


def same_direction(a: Sequence[float], b: Sequence[float]) -> bool:
    """Return whether two vectors have the same direction within 0.8 deg; False for a zero vector."""
    lengths = math.hypot(*a) * math.hypot(*b)
    return lengths > 0 and sum(x * y for x, y in zip(a, b, strict=True)) / lengths > LEAST_COSINE


def is_zero(values: Sequence[float]) -> bool:
    """Return whether an offset or a rotation is zero."""
    return all(abs(value) < 1e-4 for value in values)


def is_default_alignment(values: Sequence[float]) -> bool:
    """Return whether an alignment (origin, point on x, point on y: 9 numbers) is the transmitter's frame.

    The points may be at any distance, because it differs between trackers and units.
    """
    along_x, along_y = same_direction(values[3:6], (1, 0, 0)), same_direction(values[6:9], (0, 1, 0))
    return math.hypot(*values[:3]) < 1e-3 and along_x and along_y


FRAMES = {
    "boresight": (is_zero, "a boresight turns its orientations"),
    "alignment": (is_default_alignment, "an alignment moves its frame"),
    "tip_offset": (is_zero, "a tip offset moves its positions"),
}
"""Settings that an earlier program may have changed -> test for the default, effect of another value."""
