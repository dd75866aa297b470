"""An emulated FASTRAK: four stations that share 120 Hz, and commands that mind upper and lower case. No I/O.

Source: FASTRAK User Manual OPM00PI002. Answers are in ASCII whatever the format of records is. What no manual
says is invented and listed in docs/emulator.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np

from shukotsu.trackers.emulate.device import (
    OutputListDevice,
    RefusedError,
    StationSettings,
    World,
    parsed_numbers,
)
from shukotsu.trackers.emulate.encoding import Framing
from shukotsu.trackers.fastrak.items import ITEMS, OUTPUT_ITEMS
from shukotsu.trackers.protocols.records import Bools, Wholes

MISSING, NOT_A_NUMBER, OUT_OF_RANGE, UNKNOWN = -1, -2, -3, -99
"""The manual's error codes."""

_FRAMING = Framing(
    OUTPUT_ITEMS, {"zero": ord("0"), "error": ord(" ")}, station_byte=ord("0"), text_header="0%d "
)


class EmulatedFastrak(OutputListDevice):
    """FASTRAK. Its cycle is one record of one station: those that are active take turns."""

    earlier_list = (2, 11, 1)

    def __init__(self, world: World, *, family: str = "fastrak", ports: int = 4, rate_hz: int = 120) -> None:
        stations = {number: StationSettings((2, 4, 1), stylus=1) for number in range(1, ports + 1)}
        super().__init__(world, stations, (0.2, 0.2, 0.8, 0.8))
        self.family, self._rate = family, Fraction(rate_hz)

    @property
    def rate(self) -> Fraction:
        """Records a second, of all stations together."""
        return self._rate

    def receive(self, data: bytes) -> bytes:
        """Take bytes of the client; give the answers."""
        if self.deaf_until is not None:
            return b""
        return b"".join(self._take(bytes([byte])) for byte in data)

    def ready_text(self) -> bytes:
        """Return what the device sends when it has started."""
        return b"FASTRAK Ready!\r\n"

    def framing(self, *, single: bool) -> Framing:
        """Return the framing of records; they do not tell what they answer."""
        del single
        return _FRAMING

    def turns(self, cycles: Wholes, taking_part: Bools) -> Bools:
        """Tell which station sends in each cycle."""
        rank = np.cumsum(taking_part, 1) - 1
        return np.asarray(taking_part & (rank == (cycles % _shared_by(taking_part))[:, None]))

    def pose_counts(self, cycles: Wholes, taking_part: Bools) -> Wholes:
        """A whole round of the stations is one step of the motion."""
        return np.asarray(cycles // _shared_by(taking_part))

    def _take(self, typed: bytes) -> bytes:
        """Take one byte: some letters act at once, the others with what follows up to CR."""
        if not self._typed and typed in _AT_ONCE:
            self.leave_block()
            return _AT_ONCE[typed](self) or b""
        if typed not in (b"\r", b"\n"):
            self._typed += typed
            return b""
        text = self._typed.decode("latin-1")
        self._typed.clear()
        return self._obey(text) if text else b""

    def _obey(self, text: str) -> bytes:
        command = _WITH_ARGUMENTS.get(text[0])
        if command is None:
            return _error(text, UNKNOWN)
        self.leave_block()
        try:
            return command(self, [part.strip() for part in text[1:].split(",")]).encode()
        except RefusedError as refused:
            return _error(text, refused.code)

    def stop(self) -> None:
        """End continuous output."""
        self.streaming = False

    def status(self) -> bytes:
        """The answer to S, 55 bytes."""
        active = self.active()
        flags = self.binary | self.unit << 1 | self.streaming << 3
        stations = sum(1 << (station - 1) for station in active)
        first = active[0] if active else 1
        name = "FASTRAK (emulated)"
        return f"2{first}S{flags:03X}000 F3{stations:X}  {'EMU1':6}{name:32}\r\n".encode()


def _shared_by(taking_part: Bools) -> Wholes:
    return np.asarray(np.maximum(1, taking_part.sum(1)))


def _error(typed: str, code: int) -> bytes:
    return f"2 E*ERROR*{typed}*ERROR* EC {code}*PS 0*FL 0*ST 0\r\n".encode("latin-1")


def _station(device: EmulatedFastrak, arguments: Sequence[str]) -> tuple[int, StationSettings]:
    if not arguments[0]:
        raise RefusedError(MISSING)
    if not arguments[0].isdecimal():
        raise RefusedError(NOT_A_NUMBER)
    if int(arguments[0]) not in device.stations:
        raise RefusedError(OUT_OF_RANGE)
    return int(arguments[0]), device.stations[int(arguments[0])]


def _setting(
    letter: str, name: str, pattern: str, allowed: Sequence[int] = (), *, per_station: bool = True
) -> Callable[[EmulatedFastrak, Sequence[str]], str]:
    """Give the command that sets an attribute of a station or of the device, or answers what it is.

    allowed : of whole numbers, which they can be, and as many as there are; otherwise they are floats, of
    the device from 0 to 1.
    """

    def command(device: EmulatedFastrak, arguments: Sequence[str]) -> str:
        number, holder = _station(device, arguments) if per_station else (" ", device)
        texts = arguments[1:] if per_station else arguments
        present = getattr(holder, name)
        if not texts or texts == [""]:
            numbers = present if isinstance(present, tuple) else (present,)
            return f"2{number}{letter} " + "".join(pattern % value for value in numbers) + "\r\n"
        if allowed:
            if not all(text.isdecimal() for text in texts):
                raise RefusedError(NOT_A_NUMBER)
            if not {int(text) for text in texts} <= set(allowed):
                raise RefusedError(OUT_OF_RANGE)
            wholes = tuple(int(text) for text in texts)
            setattr(holder, name, wholes if isinstance(present, tuple) else wholes[0])
            return ""
        if len(texts) > len(present):
            raise RefusedError(OUT_OF_RANGE)
        values = parsed_numbers(texts, present, not_a_number=NOT_A_NUMBER, too_large=OUT_OF_RANGE)
        if not per_station and not all(0 <= value <= 1 for value in values):
            raise RefusedError(OUT_OF_RANGE)
        setattr(holder, name, values)
        return ""

    return command


def _state(device: EmulatedFastrak, arguments: Sequence[str]) -> str:
    """Switch a station on or off; the answer says of all stations whether they are on."""
    number, station = _station(device, arguments)
    if len(arguments) == 1:
        states = "".join(str(int(each.enabled)) for each in device.stations.values())
        return f"2{number}l {states}\r\n"
    if arguments[1] not in ("0", "1"):
        raise RefusedError(OUT_OF_RANGE)
    station.enabled = arguments[1] == "1"
    return ""


def _set(name: str, value: int) -> Callable[[EmulatedFastrak], None]:
    return lambda device: setattr(device, name, value)


_AT_ONCE: dict[bytes, Callable[[EmulatedFastrak], bytes | None]] = {
    b"P": EmulatedFastrak.single,
    b"C": EmulatedFastrak.start_stream,
    b"c": EmulatedFastrak.stop,
    b"F": _set("binary", 0),
    b"f": _set("binary", 1),
    b"U": _set("unit", 0),
    b"u": _set("unit", 1),
    b"S": EmulatedFastrak.status,
    b"\x11": lambda _: None,  # resumes an output that is suspended
}
"""Commands that act without CR."""

_WITH_ARGUMENTS: dict[str, Callable[[EmulatedFastrak, Sequence[str]], str]] = {
    "A": _setting("A", "alignment", "%7.2f"),
    "H": _setting("H", "hemisphere", "%7.2f"),
    "N": _setting("N", "tip", "%7.3f"),
    "O": _setting("O", "items", "%2d", tuple(ITEMS)),
    "e": _setting("e", "stylus", "%d", (0, 1)),
    "l": _state,
    "v": _setting("v", "attitude_filter", "%7.3f", per_station=False),
    "x": _setting("x", "position_filter", "%7.3f", per_station=False),
}
"""Commands that end with CR."""
