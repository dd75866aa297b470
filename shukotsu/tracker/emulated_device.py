"""An emulated LIBERTY or PATRIOT: its settings, commands and measurements. No input or output.

The device counts cycles since power-up: `cycle` is the number of the next one, and the caller decides when it
happens. An omitted argument of a command keeps its value; a command that sets something is not answered.
Source: LIBERTY User Manual URM03PH156, chapters on commands and reply framing. Behaviour that the manual does
not describe is an assumption listed in docs/recording.md.
"""

from __future__ import annotations

import math
import re
import struct
from collections import deque
from collections.abc import Container, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.hand import rotations
from shukotsu.tracker import liberty
from shukotsu.tracker.liberty import ITEMS, MOST_ITEMS, TAGS
from shukotsu.tracker.records import MM_PER_UNIT, TRACK

MAX_STATION = 16
PERIOD_CYCLES = 960
"""Period of the built-in motion: 4 s at 240 Hz."""


@dataclass(frozen=True)
class PlayedMotion:
    """Poses of receivers in T frames, one per cycle.

    poses : (T, S, 7) positions in mm and quaternions, NaN if the recording has no pose. loop : whether to
    start again after the last frame; otherwise there are no poses after it. notes : parts of the file that
    cannot be played, one sentence each.
    """

    stations: tuple[int, ...]
    poses: Array
    loop: bool = False
    notes: tuple[str, ...] = ()

    def poses_of(self, station: int, count: Integers) -> Array:
        """Return a receiver's poses, (N, 7), NaN if there is none; count : (N,) numbers of cycles, from 0."""
        poses = np.full((len(count), 7), np.nan)
        rows = count % len(self.poses) if self.loop else count
        inside = rows < len(self.poses)
        if station in self.stations:
            poses[inside] = self.poses[rows[inside], self.stations.index(station)]
        return poses


def built_in_motion() -> PlayedMotion:
    """Return a loop of sixteen receivers that sway and bend smoothly, 0.15-0.45 m before the transmitter."""
    phase = 2 * np.pi * np.arange(PERIOD_CYCLES)[:, None] / PERIOD_CYCLES
    index = np.arange(MAX_STATION)
    finger, bone = index // 4, index % 4
    bend = np.sin(phase + 0.4 * finger) * (0.35 + 0.15 * bone)  # distal bones bend more
    x = 250 + 30 * bone + 40 * np.sin(phase)
    y = -45 + 30 * finger + 15 * np.cos(phase)
    position_mm = np.stack([x, y, -120 + 25 * bend + 20 * np.sin(2 * phase)], -1)
    about_y = rotations.about_axis(np.array([0.0, 1.0, 0.0]), bend)
    about_z = rotations.about_axis(np.array([0.0, 0.0, 1.0]), 0.5 * np.cos(phase) + 0.1 * finger)
    poses = np.concatenate([position_mm, rotations.multiply(about_z, about_y)], -1)
    return PlayedMotion(tuple(range(1, MAX_STATION + 1)), poses, loop=True)


WRAP, BLOCK_CYCLES = 1 << 32, 120
RATES_HZ = {3: 120, 4: 240}
"""Argument of the rate command -> frames per second."""
UNKNOWN_COMMAND, INVALID_STATION, INVALID = 1, 2, 3
Arguments = Sequence[str]

_DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_FLAG, ECHO = (0, 1), b"\x05"
_CR, _LF, _P = b"\r"[0], b"\n"[0], b"P"[0]
_CONSTANTS = {"blank": ord(" "), "cr": _CR, "lf": _LF, "button": 0, "distortion": 0, "sync": 0}


class RefusedError(Exception):
    """Raised if the device refuses a command; the argument is the manual's error number."""


class EmulatedLiberty:
    """LIBERTY with up to 16 connectors, or PATRIOT with 2.

    motion : true poses of the receivers. plugged : stations with a receiver. rate_hz : rate at power-up.
    numbers : values of the settings by letter and station (0 for settings of the whole device); only format,
    unit, rate, output list and hemisphere affect the output. enabled : which stations are switched on.
    counted_from : cycle at which the counters and the motion started at 0.
    """

    def __init__(
        self,
        motion: PlayedMotion,
        plugged: frozenset[int],
        *,
        family: str = "liberty",
        ports: int = 16,
        rate_hz: int = 240,
    ) -> None:
        self.motion, self.plugged = motion, plugged
        self.family, self.ports = family, ports
        self.stations = tuple(range(1, ports + 1))
        self.enabled = dict.fromkeys(self.stations, True)
        self.numbers = {
            (code, station): setting.default
            for code, setting in SETTINGS.items()
            for station in (self.stations if setting.per_station else (0,))
        }
        if rate_hz == RATES_HZ[3]:
            self.numbers[b"R", 0] = (3,)
        self.cycle = self.counted_from = 0
        self.streaming = False
        self._typed = bytearray()
        self._ahead: deque[bytes] = deque()  # bytes of the next cycles of a stream, encoded ahead

    @property
    def rate(self) -> Fraction:
        """Cycles per second; a PATRIOT ignores the rate command."""
        return Fraction(60 if self.family == "patriot" else RATES_HZ[int(self.numbers[b"R", 0][0])])

    @property
    def _is_binary(self) -> bool:
        return self.numbers[b"F", 0] == (1,)

    @property
    def whoami(self) -> str:
        """The device's identification."""
        size = "" if self.family == "patriot" else f" 240/{16 if self.ports > 8 else 8}"
        return f"{self.family.upper()}{size} (emulated), {self.ports} ports, firmware EMU-1, serial EMU0001"

    def next_cycle(self) -> bytes:
        """Run one cycle; return the bytes that it sends."""
        if self.streaming and not self._ahead:
            self._ahead.extend(self._encoded(self.cycle + np.arange(BLOCK_CYCLES), liberty.STREAMED))
        self.cycle += 1
        return self._ahead.popleft() if self.streaming else b""

    def active(self) -> tuple[int, ...]:
        """Return the stations that are now plugged in and switched on."""
        return tuple(station for station in self.detected() if self.enabled[station])

    def detected(self) -> tuple[int, ...]:
        """Return the stations that are now plugged in."""
        plugged = self.present(np.array([self.cycle]))[0]
        return tuple(s for s, there in zip(self.stations, plugged.tolist(), strict=True) if there)

    def present(self, cycles: Integers) -> Bools:
        """Return whether each station of the device is plugged in at each cycle, (T, S)."""
        return np.tile(np.isin(list(self.stations), list(self.plugged)), (len(cycles), 1))

    def _encoded(self, cycles: Integers, command: int) -> list[bytes]:
        """Measure cycles; return the bytes of each. command : command byte of the records."""
        present = self.present(cycles) & list(self.enabled.values())
        passed = cycles - self.counted_from
        records: list[tuple[Bools, list[bytes]]] = []
        for column in np.flatnonzero(present.any(0)).tolist():
            station = self.stations[column]
            poses = self.motion.poses_of(station, passed)
            sent = present[:, column] & np.isfinite(poses).all(-1)
            numbers = self._numbers(station, passed, np.nan_to_num(poses))
            encoded = self._binary if self._is_binary else self._text
            records.append((sent, encoded(station, numbers, command)))
        rows = range(len(cycles))
        return [b"".join(data[row] for there, data in records if there[row]) for row in rows]

    def _numbers(self, station: int, passed: Integers, poses: Array) -> dict[str, Array | Integers]:
        """Return the numbers of a station's records, field name -> (T,); poses : (T, 7)."""
        position_mm, quaternion = poses[:, :3], poses[:, 3:]
        hemisphere = self.numbers[b"H", station]
        if hemisphere != TRACK:  # outside its hemisphere a receiver's position is reported mirrored
            position_mm = position_mm * np.where(position_mm @ np.array(hemisphere) < 0, -1.0, 1.0)[:, None]
        position = position_mm / MM_PER_UNIT["cm" if self.numbers[b"U", 0][0] else "inch"]
        cosines = rotations.matrix(quaternion)
        return {
            **{axis: position[:, i] for i, axis in enumerate("xyz")},
            **{f"q{part}": quaternion[:, i] for i, part in enumerate("wxyz")},
            "azimuth": np.degrees(np.arctan2(cosines[:, 1, 0], cosines[:, 0, 0])),
            "elevation": np.degrees(np.arcsin(np.clip(-cosines[:, 2, 0], -1, 1))),
            "roll": np.degrees(np.arctan2(cosines[:, 2, 1], cosines[:, 2, 2])),
            "frame": passed % WRAP,
            "device_ms": passed * 1000 * self.rate.denominator // self.rate.numerator % WRAP,
            **{name: np.full(len(passed), number) for name, number in _CONSTANTS.items()},
        }

    def _binary(self, station: int, numbers: dict[str, Array | Integers], command: int) -> list[bytes]:
        items = [int(item) for item in self.numbers[b"O", station]]
        kind = liberty.record_type(items)
        rows = np.zeros(len(numbers["frame"]), kind)
        rows["tag"], rows["station"], rows["command"] = TAGS[self.family], station, command
        rows["size"] = kind.itemsize - liberty.HEADER_BYTES
        fields = [field for item in items for field in ITEMS[item][0]]
        for name, field in zip((kind.names or ())[len(liberty.HEADER) :], fields, strict=True):
            rows[name] = numbers[field]
        return [row.tobytes() for row in rows]

    def _text(self, station: int, numbers: dict[str, Array | Integers], _command: int) -> list[bytes]:
        """Encode records as text; they always have the output list of power-up."""
        columns = [numbers[name] for name in ("x", "y", "z", "azimuth", "elevation", "roll")]
        pattern = f"{station:02d}  " + "%8.3f " * 6 + "\r\n"
        return [(pattern % row).encode() for row in zip(*columns, strict=True)]

    def receive(self, data: bytes) -> bytes:
        """Process the client's bytes; return the answers, with an echo of the bytes if echo is on."""
        out = bytearray()
        for byte in data:
            if self.numbers[ECHO, 0][0]:
                out.append(byte)
            out += self._take(byte)
        return bytes(out)

    def reply(self, command: int, text: str, binary: bytes = b"", station: int = 0) -> bytes:
        """Return a framed answer: in binary header and body, in ASCII station, letter, error and text."""
        if self._is_binary:
            return self._header(station, command, 0, len(binary)) + binary
        letter = chr(command + 0x60) if command < 0x20 else chr(command)
        return f"{station:02d}{letter}  {text}\r\n".encode("latin-1")

    def _header(self, station: int, command: int, error: int, size: int) -> bytes:
        return TAGS[self.family] + struct.pack("<BBBBh", station, command, error, 0, size)

    def _take(self, byte: int) -> bytes:
        """Process one byte: P acts at once, CR ends a command, LF is ignored."""
        if byte == _LF:
            return b""
        if not self._typed and byte in (_P, _P + 32):
            self.streaming = False
            self._ahead.clear()
            return self._encoded(np.array([self.cycle]), liberty.SINGLE)[0]
        if byte != _CR:
            self._typed.append(byte)
            return b""
        typed = bytes(self._typed)
        self._typed.clear()
        code = typed[:1].upper()
        if typed[:2].upper() == b"@B":
            code, typed = b"@", typed[1:]
        self._ahead.clear()
        arguments = [part.strip() for part in typed[1:].decode("latin-1").split(",")]
        try:
            arguments = [] if arguments == [""] else arguments
            if code in SETTINGS:
                return SETTINGS[code].obey(self, code, arguments)
            if code not in COMMANDS:
                raise RefusedError(UNKNOWN_COMMAND)
            return _obey(self, code, arguments)
        except RefusedError as refused:
            text = f"{liberty.ERRORS[refused.args[0]].title()}\r\n".encode()
            header = self._header(0, code[0] if code else _CR, refused.args[0], len(text))
            return header + text if self._is_binary else text


def _whole(text: str, allowed: Container[int]) -> int:
    if not text.isdecimal() or int(text) not in allowed:
        raise RefusedError(INVALID)
    return int(text)


def _number(text: str) -> float:
    if not _DECIMAL.fullmatch(text) or not math.isfinite(float(text)):
        raise RefusedError(INVALID)
    return float(text)


def _count(arguments: Arguments, least: int, most: int) -> None:
    if not least <= len(arguments) <= most:
        raise RefusedError(INVALID)


def _stations(device: EmulatedLiberty, arguments: Arguments) -> list[int]:
    if arguments[:1] == ["*"]:
        return list(device.stations)
    if not arguments or not arguments[0].isdecimal() or int(arguments[0]) not in device.stations:
        raise RefusedError(INVALID_STATION)
    return [int(arguments[0])]


@dataclass(frozen=True)
class DeviceSetting:
    """A setting that can be set and queried.

    default : its numbers at power-up. text : format of its numbers, or of one group of them, which is
    repeated. allowed : valid whole numbers; None if the numbers are floats.
    """

    default: tuple[float, ...]
    text: str = "%d"
    allowed: Container[int] | None = None
    per_station: bool = False

    def obey(self, device: EmulatedLiberty, code: bytes, arguments: Arguments) -> bytes:
        """Set the value, or return an answer with it if there are no values."""
        values = arguments[1:] if self.per_station else arguments
        answer = b""
        for station in _stations(device, arguments) if self.per_station else [0]:
            numbers = device.numbers[code, station]
            _count(values, 0, MOST_ITEMS if code == b"O" else len(numbers))
            if not values:
                end = (-1,) if code == b"O" and len(numbers) < MOST_ITEMS else ()
                body = np.asarray((*numbers, *end), "<f4" if self.allowed is None else "<i4").tobytes()
                text = self.text * (len(numbers) // self.text.count("%")) % numbers
                answer += device.reply(code[0], text.rstrip() if code == b"O" else text, body, station)
            elif self.allowed is None:  # an omitted argument keeps its value
                read = [_number(text) if text else was for text, was in zip(values, numbers, strict=False)]
                device.numbers[code, station] = (*read, *numbers[len(read) :])
            else:
                device.numbers[code, station] = tuple(_whole(text, self.allowed) for text in values)
        return answer


def _obey(device: EmulatedLiberty, code: bytes, arguments: Arguments) -> bytes:
    """Execute a command (letter or control character) that is not a setting; return its answer."""
    if code == b"\x15" and arguments == ["0"]:
        halves = [sum(1 << (s - 1) for s in numbers) for numbers in (device.active(), device.detected())]
        return device.reply(0x15, f"{halves[1]:04x}{halves[0]:04x}", struct.pack("<HH", *halves))
    stations = _stations(device, arguments) if code == b"\x15" else []
    _count(arguments, COMMANDS[code], COMMANDS[code])
    if code == b"\x14":  # result of the built-in test: no fault
        words = 18 if device.ports > 8 else 9
        return device.reply(0x14, " ".join(["0x00000000"] * words), bytes(4 * words))
    if code == b"\x16":  # identification
        text = device.whoami
        return device.reply(0x16, text, bytes((device.ports, device.family == "patriot", 0)) + text.encode())
    if code == b"Q":
        _whole(arguments[0], (0,))
        device.counted_from = device.cycle
    elif code == b"C":
        device.streaming = True
    for number in stations:
        device.enabled[number] = bool(_whole(arguments[1], _FLAG))
    return b""


_UNALIGNED = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
SETTINGS = {
    b"A": DeviceSetting(_UNALIGNED, "%7.2f%7.2f%7.2f\r\n", per_station=True),
    b"B": DeviceSetting((0.0, 0.0, 0.0), "%7.2f ", per_station=True),
    b"F": DeviceSetting((0,), allowed=_FLAG),
    b"G": DeviceSetting((0.0, 0.0, 0.0), "%8.3f "),
    b"H": DeviceSetting((1.0, 0.0, 0.0), "%7.3f", per_station=True),
    b"L": DeviceSetting((0,), allowed=_FLAG, per_station=True),
    b"N": DeviceSetting((0.0, 0.0, 0.0), "%6.3f ", per_station=True),
    b"O": DeviceSetting(liberty.DEFAULT_LIST, "%d ", ITEMS, per_station=True),
    b"R": DeviceSetting((4,), allowed=RATES_HZ),
    b"U": DeviceSetting((0,), allowed=_FLAG),
    b"X": DeviceSetting((0.2, 0.2, 0.8, 0.95), "%6.3f "),
    b"Y": DeviceSetting((0.2, 0.2, 0.8, 0.95), "%6.3f "),
    b"Z": DeviceSetting((0,), allowed=_FLAG),
    ECHO: DeviceSetting((0,), allowed=_FLAG),
    b"@": DeviceSetting((1,), allowed=_FLAG),
}
COMMANDS = {b"C": 0, b"Q": 1, b"\x14": 0, b"\x15": 2, b"\x16": 0}
"""Other commands -> number of their arguments; P is missing because it acts without CR."""
