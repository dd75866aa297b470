"""An emulated LIBERTY or PATRIOT: its settings, its commands, and what it measures. No I/O.

The device lives in cycles: `cycle` is the number of the next one since power-up; time is what its caller
makes of them. A command is a function: device and arguments -> answer. An argument that is left out keeps its
value; a command that sets something answers nothing. `RefusedError` carries the manual's error number.
Source: LIBERTY User Manual URM03PH156, chapter of commands and reply framing. What no manual says is invented
and listed in docs/emulator.md.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from shukotsu.trackers.emulate.encoding import Measured, encode
from shukotsu.trackers.emulate.pose_sources import Motion
from shukotsu.trackers.liberty.items import DEFAULT_LIST, ITEMS, MOST_ITEMS, SINGLE, STREAMED, TAGS
from shukotsu.trackers.liberty.replies import ERRORS
from shukotsu.trackers.protocols.records import Array, Bools, Wholes
from shukotsu.trackers.protocols.stream_settings import MM_PER_UNIT

WRAP = 1 << 32
BLOCK_CYCLES = 120
FOLLOWING = (0.0, 0.0, 0.0)
"""The hemisphere that stands for "keep track of the receiver": no position flips."""

RATES_HZ = {2: 60, 3: 120, 4: 240}
"""Value of the rate command -> frames a second."""

Arguments = Sequence[str]
Command = Callable[["EmulatedLiberty", Arguments], bytes]

UNKNOWN_COMMAND, INVALID_STATION, INVALID, TOO_FEW, TOO_MANY, BELOW, ABOVE = range(1, 8)

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_BIT_WORDS_OF_ONE_BOARD_SET = 9
_FLAG = (0, 1)

_CR, _LF, _P = b"\r"[0], b"\n"[0], b"P"[0]


class RefusedError(Exception):
    """The device does not do it; `code` is the manual's error number."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


@dataclass
class StationSettings:
    """One station's settings; all but the hemisphere move nothing, and are only answered when asked."""

    items: tuple[int, ...]
    stylus: int = 0
    enabled: bool = True
    hemisphere: tuple[float, ...] = (1.0, 0.0, 0.0)
    alignment: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    boresight: tuple[float, ...] = (0.0, 0.0, 0.0)
    tip: tuple[float, ...] = (0.0, 0.0, 0.0)


class EmulatedLiberty:
    """LIBERTY with up to 16 connectors, or PATRIOT with 2.

    motion : where the receivers truly are. plugged : the stations that have one. rate_hz : at power-up.
    binary, unit : whether records are binary, and positions in centimetres (1) or inches (0).
    position_filter, attitude_filter : are answered when asked for; motions are taken for what they gave.
    counted_from : the cycle in which the counters and the motion began at 0.
    """

    def __init__(
        self,
        motion: Motion,
        plugged: frozenset[int],
        *,
        family: str = "liberty",
        ports: int = 16,
        rate_hz: int = 240,
    ) -> None:
        self.motion, self.plugged = motion, plugged
        self.family, self.ports = family, ports
        self.stations = {number: StationSettings(DEFAULT_LIST) for number in range(1, ports + 1)}
        self.rate_code = next(code for code, hz in RATES_HZ.items() if hz == rate_hz)
        self.position_filter: tuple[float, ...] = (0.2, 0.2, 0.8, 0.95)
        self.attitude_filter = self.position_filter
        self.mounting_deg: tuple[float, ...] = (0.0, 0.0, 0.0)
        self.binary = self.unit = self.sync = self.echo = 0
        self.buffered = 1
        self.cycle = 0
        self.streaming = False
        self.counted_from = 0
        self._typed = bytearray()
        self._ahead: tuple[int, list[bytes]] = (
            0,
            [],
        )  # cycles that were encoded ahead, and the first of them

    @property
    def rate(self) -> Fraction:
        """Cycles a second; a PATRIOT does not heed the rate command."""
        return Fraction(60 if self.family == "patriot" else RATES_HZ[self.rate_code])

    # --- cycles ---------------------------------------------------------------------------------------

    def next_cycle(self) -> bytes:
        """Let one cycle pass; return what it sent."""
        first, ahead = self._ahead
        if self.streaming and not 0 <= self.cycle - first < len(ahead):
            cycles = self.cycle + np.arange(BLOCK_CYCLES)
            first, ahead = self._ahead = (self.cycle, self._encoded(cycles, STREAMED))
        self.cycle += 1
        return ahead[self.cycle - 1 - first] if self.streaming else b""

    def single(self) -> bytes:
        """One record of every active station, now."""
        return self._encoded(np.array([self.cycle]), SINGLE)[0]

    def active(self) -> tuple[int, ...]:
        """Stations that are plugged in now and switched on."""
        return tuple(station for station in self.detected() if self.stations[station].enabled)

    def detected(self) -> tuple[int, ...]:
        """Stations that are plugged in now."""
        plugged = self.present(np.array([self.cycle]))[0]
        return tuple(s for s, there in zip(self.stations, plugged.tolist(), strict=True) if there)

    def present(self, cycles: Wholes) -> Bools:
        """Whether each station of the device is plugged in, (T, S)."""
        return np.tile(np.isin(list(self.stations), list(self.plugged)), (len(cycles), 1))

    def leave_block(self) -> None:
        """Drop what was encoded ahead, as before a setting changes."""
        self._ahead = (0, [])

    def _encoded(self, cycles: Wholes, command: int) -> list[bytes]:
        """Measure cycles and encode them; command : what they answer."""
        enabled = np.array([settings.enabled for settings in self.stations.values()])
        present = self.present(cycles) & enabled
        taking_part = present.any(0)
        stations = tuple(s for s, there in zip(self.stations, taking_part.tolist(), strict=True) if there)
        passed = cycles - self.counted_from
        position_mm, quaternion = self.motion.poses(passed, stations)
        present = present[:, taking_part] & np.isfinite(position_mm).all(-1) & np.isfinite(quaternion).all(-1)
        position_mm = np.nan_to_num(position_mm)
        for column, station in enumerate(stations):
            position_mm[:, column] *= _side(position_mm[:, column], self.stations[station].hemisphere)
        measured = Measured(
            stations,
            passed % WRAP,
            passed * 1000 * self.rate.denominator // self.rate.numerator % WRAP,
            position_mm / MM_PER_UNIT["cm" if self.unit else "inch"],
            np.nan_to_num(quaternion),
            present,
        )
        lists = {number: settings.items for number, settings in self.stations.items()}
        return encode(measured, lists, TAGS[self.family], command, binary=bool(self.binary))

    # --- commands -------------------------------------------------------------------------------------

    def receive(self, data: bytes) -> bytes:
        """Take bytes of the client; return the answers, echo among them where that is on."""
        out = bytearray()
        for byte in data:
            if self.echo:
                out.append(byte)
            out += self._take(byte)
        return bytes(out)

    def reply(self, command: int, text: str, binary: bytes = b"", station: int = 0) -> bytes:
        """Frame an answer: in binary 8 bytes and the body, in ASCII station, letter, error, blank, text."""
        if self.binary:
            return self._header(station, command, 0, len(binary)) + binary
        letter = chr(command + 0x60) if command < 0x20 else chr(command)
        return f"{station:02d}{letter}  {text}\r\n".encode("latin-1")

    def _header(self, station: int, command: int, error: int, size: int) -> bytes:
        return TAGS[self.family] + struct.pack("<BBBBh", station, command, error, 0, size)

    def _take(self, byte: int) -> bytes:
        """Take one byte: P acts at once, CR ends a command, LF is nothing."""
        if byte == _LF:
            return b""
        if not self._typed and byte in (_P, _P + 32):
            self.streaming = False
            return self.single()
        if byte != _CR:
            self._typed.append(byte)
            return b""
        typed = bytes(self._typed)
        self._typed.clear()
        return self._obey(typed)

    def _obey(self, typed: bytes) -> bytes:
        code = typed[:1].upper()
        if typed[:2].upper() == b"@B":
            code, typed = b"@", typed[1:]
        command = COMMANDS.get(code)
        first = code[0] if code else _CR
        if command is None:
            return self._error(first, UNKNOWN_COMMAND)
        self.leave_block()
        arguments = [part.strip() for part in typed[1:].decode("latin-1").split(",")]
        try:
            return command(self, [] if arguments == [""] else arguments)
        except RefusedError as refused:
            return self._error(first, refused.code)

    def _error(self, command: int, code: int) -> bytes:
        text = f"{ERRORS[code].title()}\r\n".encode()
        return self._header(0, command, code, len(text)) + text if self.binary else text


def _side(position_mm: Array, hemisphere: Sequence[float]) -> Array:
    """Sign with which positions (T, 3) are reported, (T, 1): -1 where they are outside the hemisphere."""
    if tuple(hemisphere) == FOLLOWING:
        return np.ones((len(position_mm), 1))
    return np.where(position_mm @ np.array(hemisphere) < 0, -1.0, 1.0)[:, None]


def _floats(texts: Sequence[str], present: Sequence[float]) -> tuple[float, ...]:
    """Read a command's numbers; one that is left out keeps its present value."""
    values = list(present)
    for place, text in enumerate(texts):
        if text and not _NUMBER.fullmatch(text):
            raise RefusedError(INVALID)
        if text and not math.isfinite(float(text)):
            raise RefusedError(ABOVE)
        values[place] = float(text) if text else values[place]
    return tuple(values)


def _whole(text: str, allowed: Sequence[int]) -> int:
    if not text.isdecimal():
        raise RefusedError(INVALID)
    if int(text) not in allowed:
        raise RefusedError(BELOW if int(text) < min(allowed) else ABOVE)
    return int(text)


def _at_most(arguments: Arguments, count: int) -> None:
    if len(arguments) > count:
        raise RefusedError(TOO_MANY)


def _stations(device: EmulatedLiberty, arguments: Arguments) -> list[int]:
    if not arguments or not arguments[0]:
        raise RefusedError(TOO_FEW)
    if arguments[0] == "*":
        return list(device.stations)
    if not arguments[0].isdecimal() or int(arguments[0]) not in device.stations:
        raise RefusedError(INVALID_STATION)
    return [int(arguments[0])]


def _wholes(*values: int) -> bytes:
    return np.asarray(values, np.int64).astype("<i4").tobytes()


def _setting(
    code: int, name: str, text: str = "%d", allowed: Sequence[int] = (), *, per_station: bool = False
) -> Command:
    """Return the command that sets an attribute of the device or of stations, or answers what it is.

    text : how its numbers are written, as many as it has or one after the other in such groups. allowed :
    of a whole number, which it can be; otherwise they are floats.
    """

    def command(device: EmulatedLiberty, arguments: Arguments) -> bytes:
        stations = _stations(device, arguments) if per_station else [0]
        values = arguments[1:] if per_station else arguments
        answer = b""
        for number in stations:
            holder = device.stations[number] if per_station else device
            present = getattr(holder, name)
            numbers = (present,) if allowed else present
            _at_most(values, len(numbers))
            if values and allowed:
                setattr(holder, name, _whole(values[0], allowed))
            elif values:
                kept = _floats(values, present)
                setattr(holder, name, kept)
            else:
                body = _wholes(present) if allowed else np.asarray(present, "<f4").tobytes()
                shown = text * (len(numbers) // text.count("%")) % tuple(numbers)
                answer += device.reply(code, shown, body, number)
        return answer

    return command


def _output_list(device: EmulatedLiberty, arguments: Arguments) -> bytes:
    chosen = _stations(device, arguments)
    _at_most(arguments, 1 + MOST_ITEMS)
    answer = b""
    for number in chosen:
        station = device.stations[number]
        if len(arguments) > 1:
            items = [_whole(text, tuple(ITEMS)) for text in arguments[1:]]
            station.items = tuple(items)
        else:
            end = (-1,) if len(station.items) < MOST_ITEMS else ()
            text = " ".join(map(str, station.items))
            answer += device.reply(0x4F, text, _wholes(*station.items, *end), number)
    return answer


def _continuous(device: EmulatedLiberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 0)
    device.streaming = True
    return b""


def _reset_counters(device: EmulatedLiberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 1)
    if not arguments:
        raise RefusedError(TOO_FEW)
    _whole(arguments[0], (0,))
    device.counted_from = device.cycle
    return b""


def _bit_errors(device: EmulatedLiberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 0)
    words = [0] * _BIT_WORDS_OF_ONE_BOARD_SET * (2 if device.ports > 8 else 1)
    text = " ".join(f"0x{word:08x}" for word in words)
    return device.reply(0x14, text, struct.pack(f"<{len(words)}I", *words))


def _station_state(device: EmulatedLiberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 2)
    if arguments == ["0"]:
        detected, active = _bits(device.detected()), _bits(device.active())
        return device.reply(0x15, f"{detected:04x}{active:04x}", struct.pack("<I", detected << 16 | active))
    stations = _stations(device, arguments)
    if len(arguments) < 2:
        raise RefusedError(TOO_FEW)
    state = _whole(arguments[1], _FLAG)
    for number in stations:
        device.stations[number].enabled = bool(state)
    return b""


def _bits(stations: Iterable[int]) -> int:
    return sum(1 << (station - 1) for station in stations)


def _whoami(device: EmulatedLiberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 0)
    kind = 1 if device.family == "patriot" else 0
    size = "" if kind else f" 240/{16 if device.ports > 8 else 8}"
    text = f"{device.family.upper()}{size} (emulated), {device.ports} ports, firmware EMU-1, serial EMU0001"
    return device.reply(0x16, text, bytes((device.ports, kind, 0)) + text.encode())


COMMANDS: dict[bytes, Command] = {
    b"A": _setting(0x41, "alignment", "%7.2f%7.2f%7.2f\r\n", per_station=True),
    b"B": _setting(0x42, "boresight", "%7.2f ", per_station=True),
    b"C": _continuous,
    b"F": _setting(0x46, "binary", allowed=_FLAG),
    b"G": _setting(0x47, "mounting_deg", "%8.3f "),
    b"H": _setting(0x48, "hemisphere", "%7.3f", per_station=True),
    b"L": _setting(0x4C, "stylus", allowed=_FLAG, per_station=True),
    b"N": _setting(0x4E, "tip", "%6.3f ", per_station=True),
    b"O": _output_list,
    b"Q": _reset_counters,
    b"R": _setting(0x52, "rate_code", allowed=(3, 4)),
    b"U": _setting(0x55, "unit", allowed=_FLAG),
    b"X": _setting(0x58, "position_filter", "%6.3f "),
    b"Y": _setting(0x59, "attitude_filter", "%6.3f "),
    b"Z": _setting(0x5A, "sync", allowed=_FLAG),
    b"\x05": _setting(0x05, "echo", allowed=_FLAG),
    b"\x14": _bit_errors,
    b"\x15": _station_state,
    b"\x16": _whoami,
    b"@": _setting(0x40, "buffered", allowed=_FLAG),
}
"""Command letter, or control character, -> what it does. P has no place here: it acts without an end."""
