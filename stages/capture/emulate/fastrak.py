"""An emulated FASTRAK: four stations that share 120 Hz, and commands that mind upper and lower case. No I/O.

Source: FASTRAK User Manual OPM00PI002. Answers are in ASCII whatever the format of records is. What no manual
says is invented and listed in docs/emulator.md.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from stages.capture.emulate.device import Device, World
from stages.capture.emulate.encode import (
    FASTRAK_FIELDS,
    FASTRAK_FRAMING,
    Block,
    Measured,
    encode,
    from_euler_deg,
)
from stages.capture.emulate.frames import DEFAULT_HEMISPHERE, StationFrames
from stages.capture.trackers.settings import MM_PER_UNIT

STATIONS = 4
SHARED_HZ = 120
DEFAULT_LIST = (2, 4, 1)
OLD_LIST = (2, 11, 1)
MAX_ITEMS = 32
MAX_COMMAND_CHARACTERS = 255

Wholes = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

MISSING, NOT_A_NUMBER, OUT_OF_RANGE, BUFFER, UNKNOWN = -1, -2, -3, -5, -99
"""The manual's error codes."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_STRAIGHT = np.array([1.0, 0.0, 0.0, 0.0])
_FILTER = (0.2, 0.2, 0.8, 0.8)
_NO_FILTER = (0.0, 1.0, 0.0, 0.0)


class _RefusedError(Exception):
    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


@dataclass
class StationSettings:
    """What can be set of one station; a stylus' press starts and stops the stream unless `e` says else."""

    items: tuple[int, ...] = DEFAULT_LIST
    hemisphere: tuple[float, ...] = DEFAULT_HEMISPHERE
    frames: StationFrames = field(default_factory=StationFrames)
    boresight_target: tuple[float, ...] = (0.0, 0.0, 0.0)
    increment: float = 0.0
    stylus: int = 1
    enabled: bool = True


@dataclass
class Settings:
    """What can be set of the device, as the factory leaves it."""

    stations: dict[int, StationSettings]
    binary: bool = False
    centimetres: bool = False
    compensated: bool = False
    position_filter: tuple[float, ...] = _FILTER
    attitude_filter: tuple[float, ...] = _FILTER


class Fastrak(Device):
    """FASTRAK. Its cycle is one record of one station: those that are active take turns."""

    ports = STATIONS

    def __init__(self, world: World) -> None:
        self._typed = bytearray()
        self._saved: Settings | None = None
        self._factory()
        super().__init__(world)

    @property
    def rate(self) -> Fraction:
        """Records a second, of all stations together."""
        return Fraction(SHARED_HZ)

    @property
    def all_stations(self) -> tuple[int, ...]:
        """Stations 1 to 4."""
        return tuple(range(1, STATIONS + 1))

    def receive(self, data: bytes) -> bytes:
        """Take bytes of the client; give the answers."""
        if self.deaf_until is not None:
            return b""
        out = bytearray()
        for byte in data:
            out += self._take(bytes([byte]))
        return bytes(out)

    def power_up_streaming(self) -> None:
        """Be as an earlier client left it: streaming in binary, centimetres, an output list of its own."""
        self.settings.binary, self.settings.centimetres = True, True
        for station in self.settings.stations.values():
            station.items = OLD_LIST
        self.start_stream()

    def ready_text(self) -> bytes:
        """What the device says when it has started."""
        return b"FASTRAK Ready!\r\n"

    def enabled(self, station: int) -> bool:
        """Whether the station's state is on."""
        return self.settings.stations[station].enabled

    def frames_of(self, station: int) -> StationFrames:
        """The reference frames of a station."""
        return self.settings.stations[station].frames

    def hemisphere_of(self, station: int) -> tuple[float, ...]:
        """Its hemisphere."""
        return self.settings.stations[station].hemisphere

    def new_share(self) -> float:
        """Halfway between the least and the most that the position filter lets in."""
        _, low, high, _ = self.settings.position_filter
        return 1.0 if self.settings.position_filter == _NO_FILTER else (low + high) / 2

    def mounting(self) -> npt.NDArray[np.float64]:
        """The transmitter's own frame."""
        return _STRAIGHT

    def mm_per_unit(self) -> float:
        """Millimetres of the unit."""
        return MM_PER_UNIT["cm"] if self.settings.centimetres else MM_PER_UNIT["inch"]

    def button_toggles(self, station: int) -> bool:
        """Unless `e st,0` says otherwise."""
        return self.settings.stations[station].stylus == 1

    def encoded(self, measured: Measured, *, single: bool) -> Block:
        """Encode cycles as the settings of the moment say; a record does not tell what it answers."""
        del single
        lists = {number: station.items for number, station in self.settings.stations.items()}
        return encode(measured, lists, FASTRAK_FRAMING, binary=self.settings.binary)

    def turns(self, cycles: Wholes, taking_part: Flags) -> Flags:
        """Which station sends in each cycle; none while the client has suspended the output."""
        rank = np.cumsum(taking_part, 1) - 1
        mine = taking_part & (rank == (cycles % _shared_by(taking_part))[:, None])
        return np.asarray(mine & (not self._held))

    def pose_counts(self, cycles: Wholes, taking_part: Flags) -> Wholes:
        """A whole round of the stations is one step of the motion."""
        return np.asarray(cycles // _shared_by(taking_part))

    def _factory(self) -> None:
        self.settings = Settings({number: StationSettings() for number in range(1, STATIONS + 1)})
        self._held = False

    def _take(self, typed: bytes) -> bytes:
        """Take one byte: some letters act at once, the others with what follows up to CR."""
        if not self._typed and typed in _AT_ONCE:
            self.leave_block()
            return _AT_ONCE[typed](self)
        if typed not in (b"\r", b"\n"):
            self._typed += typed
            if len(self._typed) <= MAX_COMMAND_CHARACTERS:
                return b""
            self._typed.clear()
            return _error("", BUFFER)
        text = self._typed.decode("latin-1")
        self._typed.clear()
        return self._obey(text) if text else b""

    def _obey(self, text: str) -> bytes:
        command = _WITH_ARGUMENTS.get(text[0])
        if command is None:
            return _error(text, UNKNOWN)
        self.leave_block()
        arguments = [part.strip() for part in text[1:].split(",")]
        try:
            return command(self, arguments).encode()
        except _RefusedError as refused:
            return _error(text, refused.code)

    def stop(self) -> None:
        """End continuous output."""
        self.streaming = False

    def hold(self, held: bool) -> None:
        """Suspend the output, or resume it; what is measured meanwhile is lost."""
        self._held = held

    def save(self) -> None:
        """Keep the settings for the next start."""
        self._saved = copy.deepcopy(self.settings)

    def reinitialise(self) -> None:
        """Start again with the settings that were saved, or else the factory's."""
        self._factory()
        if self._saved is not None:
            self.settings = copy.deepcopy(self._saved)
        self._typed.clear()
        self.restart()

    def status(self) -> bytes:
        """The answer to S, 55 bytes."""
        active = self.active()
        settings = self.settings
        flags = settings.binary | settings.centimetres << 1 | settings.compensated << 2 | self.streaming << 3
        failed = "001" if self.failed_channels() else "000"
        stations = sum(1 << (station - 1) for station in active)
        first = active[0] if active else 1
        name = "FASTRAK (emulated)"
        return f"2{first}S{flags:03X}{failed} F3{stations:X}  {'EMU1':6}{name:32}\r\n".encode()


def _shared_by(taking_part: Flags) -> Wholes:
    return np.asarray(np.maximum(1, taking_part.sum(1)))


def _error(typed: str, code: int) -> bytes:
    return f"2 E*ERROR*{typed}*ERROR* EC {code}*PS 0*FL 0*ST 0\r\n".encode("latin-1")


def _station(device: Fastrak, arguments: Sequence[str]) -> tuple[int, StationSettings]:
    if not arguments[0]:
        raise _RefusedError(MISSING)
    if not arguments[0].isdecimal():
        raise _RefusedError(NOT_A_NUMBER)
    if int(arguments[0]) not in device.all_stations:
        raise _RefusedError(OUT_OF_RANGE)
    return int(arguments[0]), device.settings.stations[int(arguments[0])]


def _reals(texts: Sequence[str], kept: Sequence[float]) -> tuple[float, ...]:
    if len(texts) > len(kept):
        raise _RefusedError(OUT_OF_RANGE)
    if any(text and not _NUMBER.fullmatch(text) for text in texts):
        raise _RefusedError(NOT_A_NUMBER)
    given = [*texts, *[""] * (len(kept) - len(texts))]
    return tuple(float(text) if text else old for text, old in zip(given, kept, strict=True))


def _switch(texts: Sequence[str]) -> int:
    if texts[0] not in ("0", "1"):
        raise _RefusedError(OUT_OF_RANGE)
    return int(texts[0])


def _told(station: int | str, letter: str, values: Sequence[float], pattern: str = "%7.2f") -> str:
    return f"2{station}{letter} " + "".join(pattern % value for value in values) + "\r\n"


def _output(device: Fastrak, arguments: Sequence[str]) -> str:
    number, station = _station(device, arguments)
    if len(arguments) == 1:
        return _told(number, "O", station.items, "%2d")
    if len(arguments) > 1 + MAX_ITEMS:
        raise _RefusedError(BUFFER)
    if not all(text.isdecimal() for text in arguments[1:]):
        raise _RefusedError(NOT_A_NUMBER)
    items = tuple(int(text) for text in arguments[1:])
    if not set(items) <= set(FASTRAK_FIELDS):
        raise _RefusedError(OUT_OF_RANGE)
    station.items = items
    return ""


def _hemisphere(device: Fastrak, arguments: Sequence[str]) -> str:
    number, station = _station(device, arguments)
    if len(arguments) == 1:
        return _told(number, "H", station.hemisphere)
    station.hemisphere = _reals(arguments[1:], station.hemisphere)
    return ""


def _align(device: Fastrak, arguments: Sequence[str]) -> str:
    number, station = _station(device, arguments)
    unit = device.mm_per_unit()
    kept = (station.frames.alignment_mm(unit) / unit).ravel().tolist()
    if len(arguments) == 1:
        return _told(number, "A", kept)
    points = np.array(_reals(arguments[1:], kept)).reshape(3, 3) * unit
    if not station.frames.align(points):
        raise _RefusedError(OUT_OF_RANGE)
    return ""


def _reset_alignment(device: Fastrak, arguments: Sequence[str]) -> str:
    _station(device, arguments)[1].frames.reset_alignment()
    return ""


def _boresight(device: Fastrak, arguments: Sequence[str]) -> str:
    number, station = _station(device, arguments)
    now = device.orientation(number)
    if np.isfinite(now).all():
        azimuth, elevation, roll = station.boresight_target
        target = from_euler_deg(azimuth, elevation, roll)
        station.frames.point(now, station.boresight_target, target)
    return ""


def _unboresight(device: Fastrak, arguments: Sequence[str]) -> str:
    _station(device, arguments)[1].frames.reset_boresight()
    return ""


def _boresight_target(device: Fastrak, arguments: Sequence[str]) -> str:
    number, station = _station(device, arguments)
    if len(arguments) == 1:
        return _told(number, "G", station.boresight_target)
    station.boresight_target = _reals(arguments[1:], station.boresight_target)
    return ""


def _tip(device: Fastrak, arguments: Sequence[str]) -> str:
    number, station = _station(device, arguments)
    unit = device.mm_per_unit()
    kept = (station.frames.tip_mm / unit).tolist()
    if len(arguments) == 1:
        return _told(number, "N", kept, "%7.3f")
    station.frames.tip_mm = np.array(_reals(arguments[1:], kept)) * unit
    return ""


def _increment(device: Fastrak, arguments: Sequence[str]) -> str:
    number, station = _station(device, arguments)
    if len(arguments) == 1:
        return _told(number, "I", (station.increment,))
    (station.increment,) = _reals(arguments[1:], (station.increment,))
    return ""


def _state(device: Fastrak, arguments: Sequence[str]) -> str:
    number, station = _station(device, arguments)
    if len(arguments) == 1:
        states = "".join(str(int(device.enabled(each))) for each in device.all_stations)
        return f"2{number}l {states}\r\n"
    station.enabled = bool(_switch(arguments[1:]))
    return ""


def _stylus(device: Fastrak, arguments: Sequence[str]) -> str:
    number, station = _station(device, arguments)
    if len(arguments) == 1:
        return _told(number, "e", (station.stylus,), "%d")
    station.stylus = _switch(arguments[1:])
    return ""


def _filter(letter: str, name: str) -> Callable[[Fastrak, Sequence[str]], str]:
    def command(device: Fastrak, arguments: Sequence[str]) -> str:
        kept = getattr(device.settings, name)
        if arguments == [""]:
            return _told(" ", letter, kept, "%7.3f")
        values = _reals(arguments, kept)
        if not all(0 <= value <= 1 for value in values):
            raise _RefusedError(OUT_OF_RANGE)
        setattr(device.settings, name, values)
        return ""

    return command


def _line(_device: Fastrak, _arguments: Sequence[str]) -> str:
    """Line settings are taken and change nothing here."""
    return ""


def _set(name: str, value: bool) -> Callable[[Fastrak], bytes]:
    def command(device: Fastrak) -> bytes:
        setattr(device.settings, name, value)
        return b""

    return command


def _do(act: Callable[[Fastrak], None]) -> Callable[[Fastrak], bytes]:
    def command(device: Fastrak) -> bytes:
        act(device)
        return b""

    return command


_AT_ONCE: dict[bytes, Callable[[Fastrak], bytes]] = {
    b"P": Fastrak.single,
    b"C": _do(Fastrak.start_stream),
    b"c": _do(Fastrak.stop),
    b"F": _set("binary", False),
    b"f": _set("binary", True),
    b"U": _set("centimetres", False),
    b"u": _set("centimetres", True),
    b"D": _set("compensated", True),
    b"d": _set("compensated", False),
    b"S": Fastrak.status,
    b"\x0b": _do(Fastrak.save),
    b"\x11": _do(lambda device: device.hold(False)),
    b"\x13": _do(lambda device: device.hold(True)),
    b"\x14": _do(Fastrak.clear_bit_errors),
    b"\x19": _do(Fastrak.reinitialise),
}
"""Commands that act without CR."""

_WITH_ARGUMENTS: dict[str, Callable[[Fastrak, Sequence[str]], str]] = {
    "A": _align,
    "B": _boresight,
    "G": _boresight_target,
    "H": _hemisphere,
    "I": _increment,
    "N": _tip,
    "O": _output,
    "R": _reset_alignment,
    "b": _unboresight,
    "e": _stylus,
    "l": _state,
    "o": _line,
    "v": _filter("v", "attitude_filter"),
    "x": _filter("x", "position_filter"),
}
"""Commands that end with CR."""
