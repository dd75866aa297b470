"""Setting up LIBERTY and PATRIOT, whatever state an earlier program left them in.

They keep streaming, units, output lists, hemispheres and offsets from one program to the next, and do not
answer when something is set. So: stop, wake, ask for everything, set what matters, ask again and compare.
What would last beyond this recording, or add up (saved settings, alignment, boresight), is never sent.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from schemas.errors import InputError
from stages.capture.record.conversation import Conversation
from stages.capture.record.directions import is_default_alignment, is_zero, same_direction
from stages.capture.record.finding import NAMES, find
from stages.capture.record.wishes import TRACK, Wishes
from stages.capture.trackers.liberty import commands
from stages.capture.trackers.liberty.commands import QUESTIONS, Question, question_bytes
from stages.capture.trackers.liberty.items import ITEMS, STATIONS, TAGS
from stages.capture.trackers.liberty.replies import (
    ERRORS,
    Value,
    answers_question,
    binary_answers,
    binary_value,
    error_text,
    half_stations,
    ports_of,
    text_answers,
    text_value,
    usable_stations,
)
from stages.capture.trackers.records import Reply
from stages.capture.trackers.settings import StreamSettings

ANSWER_S = 1.0
WAKE_ATTEMPTS = 3
PATRIOT_HZ = 60
PATRIOT_STATIONS = 2

State = dict[str, Any]
"""Name of a question -> its value, or station -> value; None where the tracker did not say."""


class LibertyDriver:
    """Driver of LIBERTY and PATRIOT (see `wishes.Driver`)."""

    def __init__(self, talk: Conversation, wishes: Wishes) -> None:
        self.warnings: list[str] = []
        self._talk = talk
        self._wishes = wishes
        self._binary = wishes.mode == "binary"
        self._was_binary = False
        self._ports = STATIONS[-1] if wishes.family == "liberty" else PATRIOT_STATIONS
        self._before: State = {}
        self._touched: set[str] = set()
        self._switches: dict[int, bool] = {}
        self._complaints: list[str] = []

    @property
    def _name(self) -> str:
        return self._talk.port.name

    def set_up(self) -> StreamSettings:
        """Find the tracker, set it up and make sure that it took everything."""
        whoami = find(self._talk, self._wishes.family, self._attempt, self.warnings)
        self._ask_ports()
        self._talk.send(commands.BINARY if self._binary else commands.TEXT)
        self._talk.drain(0.1)
        self._before = self._ask_all(range(1, self._ports + 1))
        stations = self._choose_stations()
        self._set_all(self._before)
        came, _ = self._talk.drain(0.1)
        self._complaints = [error_text(r.error) for r in binary_answers(came) if r.error in ERRORS]
        after = self._ask_all(range(1, self._ports + 1))
        if self._wishes.stations is None:
            stations = self._switched_on(after["stations"], stations)
        self._compare(after, stations)
        self._warn_of(after, stations)
        return self._settings(whoami, after, stations)

    def start(self) -> Mapping[str, Any]:
        """Set the counters to 0 and have it stream; gives the host's time before and after the first."""
        before_ns = self._talk.send(commands.RESET_COUNTERS)
        after_ns = time.monotonic_ns()
        self._talk.send(commands.STREAM)
        return {"counters_reset_after_ns": before_ns, "counters_reset_before_ns": after_ns}

    def stop(self) -> None:
        """Have it stop; it sends one more record of each station."""
        self._talk.send(commands.POLL)

    def put_back(self) -> None:
        """Set what was changed to what it was before; a stream that was running stays off."""
        self.stop()
        self._talk.drain()
        before, send = self._before, self._talk.send
        if not before:
            return
        single: dict[str, Any] = {
            "units": commands.set_units,
            "rate": commands.set_rate,
            "external_sync": commands.set_external_sync,
            "echo": commands.set_echo,
            "position_filter": commands.set_position_filter,
            "attitude_filter": commands.set_attitude_filter,
        }
        each: dict[str, Any] = {
            "output_list": commands.set_output_list,
            "hemisphere": commands.set_hemisphere,
            "stylus": commands.set_stylus,
        }
        for name in (*each, *single):  # units last: hemispheres have none
            if name in each and name in self._touched:
                for station, value in before[name].items():
                    if value is not None:
                        send(each[name](value, int(station)))
            elif name in self._touched and before.get(name) is not None:
                send(single[name](before[name]))
        for station in self._switches:
            send(commands.set_station(station, int(station in usable_stations(before["stations"]))))
        send(commands.BINARY if self._was_binary else commands.TEXT)
        self._talk.drain(0.1)

    # --- finding it -----------------------------------------------------------------------------------

    def _attempt(self) -> tuple[str | None, bytes]:
        """Wake it and ask who it is."""
        heard = self._wake()
        return (self._identify() if heard else None), heard

    def _wake(self) -> bytes:
        """Stop a stream, and have it say anything at all; gives what it said."""
        before = b""
        for attempt in range(WAKE_ATTEMPTS):
            # What a program that broke off has left of a command would swallow the poll.
            self._talk.send(commands.POLL if attempt == 0 else commands.CR + commands.POLL)
            came, silent = self._talk.drain(cap_s=5.0 if attempt == 0 else 2.0)
            before += came
            self._was_binary |= bool(binary_answers(came))
            if silent:
                break
        heard = self._talk.ask(commands.CR, lambda data: data or None, ANSWER_S)
        rest, _ = self._talk.drain(cap_s=2.0)
        return before + (heard or b"") + rest

    def _identify(self) -> str | None:
        """Have it speak text and say who it is; None where that is not understood."""
        self._talk.send(commands.TEXT)
        self._talk.send(commands.WHOAMI)
        came, _ = self._talk.drain()
        for reply in text_answers(came):
            if reply.command == commands.WHOAMI[0]:
                return " ".join(reply.body.decode("ascii", "replace").split())
        return None

    def _ask_ports(self) -> None:
        """Ask in binary how many ports it has, and see whether it is the tracker that was said."""
        self._talk.send(commands.BINARY)
        answer = self._talk.ask(commands.WHOAMI, _whoami, ANSWER_S)
        if answer is None:
            raise InputError(f"{self._name}: the tracker was told to answer in binary and does not")
        family, reply = answer
        if family != self._wishes.family:
            raise InputError(f"{self._name}: the tracker is a {NAMES[family]}; give --tracker {family}")
        self._ports = min(ports_of(reply) or self._ports, self._ports)

    # --- asking ---------------------------------------------------------------------------------------

    def _ask_all(self, stations: range) -> State:
        """Ask for every setting; a question that is not answered gives None."""
        state: State = {}
        for name, question in QUESTIONS.items():
            if question.per_station:
                state[name] = {str(station): self._ask(question, station) for station in stations}
            else:
                state[name] = self._ask(question)
        return state

    def _ask(self, question: Question, station: int = 0) -> Value | None:
        asked = question_bytes(question, station)
        if question.kind == "words" and not self._binary:  # so many lines that only silence ends them
            self._talk.send(asked)
            came, _ = self._talk.drain(0.1)
            answer = self._answer(came, question, station)
        else:
            answer = self._talk.ask(asked, lambda data: self._answer(data, question, station), ANSWER_S)
        return None if answer is None else answer[0]

    def _answer(self, data: bytes, question: Question, station: int) -> tuple[Value | None] | None:
        """Find the answer to a question: its value, None in its place where it is refused."""
        tag = TAGS[self._wishes.family]
        for reply in binary_answers(data, [tag]) if self._binary else text_answers(data):
            if reply.error in ERRORS and reply.command not in b"PC":
                return (None,)
            if answers_question(reply, question, station):
                value = (binary_value if self._binary else text_value)(question, reply)
                if value is not None:
                    return (value,)
        return None if self._binary or b"nvalid" not in data else (None,)

    # --- setting --------------------------------------------------------------------------------------

    def _choose_stations(self) -> tuple[int, ...]:
        """Give the stations to record; without --stations all that are connected, switched off or not.

        Raises InputError where those asked for are not connected.
        """
        halves = self._before["stations"]
        if halves is None:
            raise InputError(f"{self._name}: the tracker does not say which receivers are connected")
        usable, wanted = usable_stations(halves), self._wishes.stations
        connected = {s for s in (*usable, *half_stations(halves)) if s <= self._ports}
        absent = [] if wanted is None else sorted(set(wanted) - connected)
        if absent:
            raise InputError(
                f"{self._name}: receiver {absent[0]} of --stations is not connected; "
                f"connected are {_listed(sorted(connected))}"
            )
        if not connected:
            raise InputError(f"{self._name}: no receiver is connected; plug them in and wait a second")
        if wanted is None:
            self._switches = dict.fromkeys(sorted(connected - set(usable)), True)
            return tuple(sorted(connected))
        self._switches = {station: station in wanted for station in range(1, self._ports + 1)}
        return wanted

    def _switched_on(self, halves: tuple[int, ...] | None, stations: tuple[int, ...]) -> tuple[int, ...]:
        """Give those of the connected stations that can send, and note the others.

        Raises InputError where there is none.
        """
        usable = () if halves is None else usable_stations(halves)
        off = [station for station in stations if station not in usable]
        if len(off) == len(stations):
            self._must("active receivers", None if halves is None else usable, stations)
        if off:
            self.warnings.append(f"receiver {_listed(off)}: cannot be switched on; not recorded")
        return tuple(station for station in stations if station in usable)

    def _set_all(self, before: Mapping[str, Any]) -> None:
        wishes, send = self._wishes, self._talk.send
        if before["echo"]:
            self._touched.add("echo")
            send(commands.set_echo(0))
        send(commands.set_units(commands.CENTIMETRES))
        if wishes.family == "liberty":
            self._touched.add("rate")
            send(commands.set_rate(commands.RATES[wishes.rate_hz or 240]))
        send(commands.set_output_list(wishes.items))
        send(commands.set_hemisphere(wishes.hemisphere))
        send(commands.set_stylus(0))
        send(commands.set_external_sync(self._sync))
        self._touched |= {"units", "output_list", "hemisphere", "stylus", "external_sync"}
        if wishes.no_filters:
            self._touched |= {"position_filter", "attitude_filter"}
            send(commands.set_position_filter(commands.FILTER_OFF))
            send(commands.set_attitude_filter(commands.FILTER_OFF))
        for station, on in self._switches.items():
            send(commands.set_station(station, int(on)))

    @property
    def _sync(self) -> int:
        """Without it the sync item would always be 0."""
        return int(any("sync" in ITEMS[item].fields for item in self._wishes.items))

    def _compare(self, after: Mapping[str, Any], stations: tuple[int, ...]) -> None:
        """Raise InputError where a setting is not what was sent."""
        wishes = self._wishes
        self._must("units", after["units"], commands.CENTIMETRES)
        if wishes.family == "liberty":
            self._must("rate", after["rate"], commands.RATES[wishes.rate_hz or 240])
        if after["echo"] is not None:
            self._must("echo", after["echo"], 0)
        self._must("external sync", after["external_sync"], self._sync)
        if wishes.stations is not None:
            found = None if after["stations"] is None else usable_stations(after["stations"])
            self._must("active receivers", found, stations)
        for station in stations:
            mine = {name: after[name][str(station)] for name in ("output_list", "hemisphere", "stylus")}
            self._must(f"output list of receiver {station}", mine["output_list"], wishes.items)
            self._must(f"stylus mode of receiver {station}", mine["stylus"], 0)
            vector = mine["hemisphere"]
            # While it follows the receiver it may well tell the present half instead of 0, 0, 0.
            if wishes.hemisphere != TRACK and not (vector and same_direction(vector, wishes.hemisphere)):
                self._must(f"hemisphere of receiver {station}", vector, wishes.hemisphere)
        if wishes.no_filters:
            for name in ("position_filter", "attitude_filter"):
                # The manual gives the lowest and the highest in another order when it is asked for.
                found = after[name] and tuple(sorted(after[name]))
                self._must(name.replace("_", " "), found, tuple(sorted(commands.FILTER_OFF)))

    def _must(self, what: str, read: Any, sent: Any) -> None:
        if read != sent:
            complaints = f" (it complained: {', '.join(self._complaints)})" if self._complaints else ""
            told = "says nothing about it" if read is None else f"says {_shown(read)}"
            raise InputError(
                f"{self._name}: the tracker did not take its {what}: sent was {_shown(sent)}, and when "
                f"asked it {told}{complaints}; switch it off and on, and try again"
            )

    # --- telling --------------------------------------------------------------------------------------

    def _warn_of(self, after: Mapping[str, Any], stations: tuple[int, ...]) -> None:
        """Note what an earlier program has left in force, which is not for a recorder to undo."""
        left = ", left as it is"
        for name, is_default, text in (
            ("boresight", is_zero, "a boresight turns its orientations"),
            ("alignment", is_default_alignment, "an alignment moves its frame"),
            ("tip_offset", is_zero, "a tip offset moves its positions"),
        ):
            odd = [s for s in stations if after[name][str(s)] and not is_default(after[name][str(s)])]
            if odd:
                values = _shown(after[name][str(odd[0])])
                self.warnings.append(f"receiver {_listed(odd)}: {text} ({values}){left}")
        if after["source_frame"] and not is_zero(after["source_frame"]):
            self.warnings.append(
                f"the transmitter's mounting frame is turned by {_shown(after['source_frame'])} deg{left}"
            )
        if any(after["bit_errors"] or ()):
            words = " ".join(f"{word:08x}" for word in after["bit_errors"])
            self.warnings.append(f"its built-in test has found faults (words {words}, see its manual)")
        if after["usb_buffering"] == 0:
            self.warnings.append(f"USB buffering is off, so that frames may be left out{left}")

    def _settings(self, whoami: str, after: State, stations: tuple[int, ...]) -> StreamSettings:
        wishes = self._wishes
        every = range(1, self._ports + 1)  # a receiver that is plugged in later has the same list
        options = {"whoami": whoami, "before": self._before, "after": after, "warnings": self.warnings}
        return StreamSettings(
            wishes.family,
            wishes.mode,
            "cm",
            float((wishes.rate_hz or 240) if wishes.family == "liberty" else PATRIOT_HZ),
            stations,
            dict.fromkeys(every, wishes.items),
            dict.fromkeys(every, wishes.hemisphere),
            options,
        )


def _whoami(data: bytes) -> tuple[str, Reply] | None:
    """Find the binary answer to "who are you": of which family it is, and the answer."""
    for family, tag in TAGS.items():
        for reply in binary_answers(data, [tag]):
            if reply.command == commands.WHOAMI[0] and reply.station == 0:
                return family, reply
    return None


def _shown(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(f"{round(part, 4):g}" for part in value) or "nothing"
    return str(value)


def _listed(stations: Any) -> str:
    return ", ".join(map(str, stations)) or "none"
