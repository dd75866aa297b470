"""The commands of LIBERTY and PATRIOT, a function each: device and arguments -> answer.

Source: LIBERTY User Manual URM03PH156, chapter of commands. An argument that is left out keeps its value; a
command that sets something answers nothing. `RefusedError` carries the manual's error number.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from stages.capture.emulate.encode import from_euler_deg
from stages.capture.emulate.liberty_settings import NO_FILTER, RefusedError, StationSettings, floats, wholes
from stages.capture.trackers.liberty.items import ITEMS, MAX_ITEMS, MAX_RECORD_BYTES, record_bytes

if TYPE_CHECKING:
    from stages.capture.emulate.liberty import Liberty

Arguments = Sequence[str]
Command = Callable[["Liberty", Arguments], bytes]

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_BAUD_CODES = {384: 5, 576: 6, 1152: 7}
_PARITIES = "NOE"
_SLOTS = 3
_CONFIGURATION_BYTES = 80 + 16 * 64 + 16 * 80
_BIT_WORDS_OF_ONE_BOARD_SET, _SECOND_SET = 9, 1 << 31
_NAME_CHARACTERS = 15


def arguments_of(code: bytes, typed: bytes) -> list[str]:
    """Split a command's arguments at its commas, blanks around them off; a name (^X) is one argument."""
    text = typed.decode("latin-1")
    if code == b"\x18":
        return [text.strip()] if text.strip() else []
    parts = [part.strip() for part in text.split(",")]
    return [] if parts == [""] else parts


def _real(text: str, kept: float) -> float:
    if not text:
        return kept
    if not _NUMBER.fullmatch(text):
        raise RefusedError(3)
    if not math.isfinite(float(text)):
        raise RefusedError(7)
    return float(text)


def _whole(text: str, allowed: Sequence[int]) -> int:
    if not text.isdecimal():
        raise RefusedError(3)
    if int(text) < min(allowed):
        raise RefusedError(6)
    if int(text) > max(allowed):
        raise RefusedError(7)
    if int(text) not in allowed:
        raise RefusedError(3)
    return int(text)


def _at_most(arguments: Arguments, count: int) -> None:
    if len(arguments) > count:
        raise RefusedError(5)


def _stations(device: Liberty, arguments: Arguments) -> list[int]:
    if not arguments or not arguments[0]:
        raise RefusedError(4)
    if arguments[0] == "*":
        return list(device.all_stations)
    if not arguments[0].isdecimal() or int(arguments[0]) not in device.all_stations:
        raise RefusedError(2)
    return [int(arguments[0])]


def _rows(values: Sequence[float], pattern: str) -> str:
    return "".join(pattern % value for value in values)


def _choice(code: int, name: str, allowed: Callable[[Liberty], Sequence[int]]) -> Command:
    """A command that sets or tells one whole number."""

    def command(device: Liberty, arguments: Arguments) -> bytes:
        _at_most(arguments, 1)
        if not arguments:
            value = getattr(device.settings, name)
            return device.reply(code, str(value), wholes(value))
        value = _whole(arguments[0], allowed(device))
        if name == "rate":
            device.change_rate(value)
        else:
            setattr(device.settings, name, value)
        return b""

    return command


def _of_stations(
    code: int,
    most: int,
    tell: Callable[[Liberty, StationSettings], tuple[str, bytes]],
    take: Callable[[Liberty, int, Arguments], None],
) -> Command:
    """A command that sets or tells something of one station or of all; `most` counts values beside it."""

    def command(device: Liberty, arguments: Arguments) -> bytes:
        chosen = _stations(device, arguments)
        _at_most(arguments, 1 + most)
        if len(arguments) > 1:
            for station in chosen:
                take(device, station, arguments[1:])
            return b""
        told = [(station, tell(device, device.settings.stations[station])) for station in chosen]
        return b"".join(device.reply(code, text, data, station) for station, (text, data) in told)

    return command


def _filter(code: int, name: str) -> Command:
    def command(device: Liberty, arguments: Arguments) -> bytes:
        _at_most(arguments, 4)
        kept = getattr(device.settings, name)
        if not arguments:
            return device.reply(code, _rows(kept, "%6.3f "), floats(kept))
        texts = [*arguments, *[""] * (4 - len(arguments))]
        values = tuple(_real(text, old) for text, old in zip(texts, kept, strict=True))
        if values != NO_FILTER:
            if min(values) < 0:
                raise RefusedError(6)
            if max(values) > 1:
                raise RefusedError(7)
            if not values[1] < values[2]:
                raise RefusedError(3)
        setattr(device.settings, name, values)
        return b""

    return command


def _tell_alignment(device: Liberty, station: StationSettings) -> tuple[str, bytes]:
    unit = device.mm_per_unit()
    values = (station.frames.alignment_mm(unit) / unit).ravel()
    lines = ["".join(f"{value:7.2f}" for value in row) + "\r\n" for row in values.reshape(3, 3)]
    return "".join(lines), floats(values)


def _take_alignment(device: Liberty, station: int, arguments: Arguments) -> None:
    frames = device.settings.stations[station].frames
    unit = device.mm_per_unit()
    kept = (frames.alignment_mm(unit) / unit).ravel().tolist()
    texts = [*arguments, *[""] * (9 - len(arguments))]
    values = [_real(text, old) for text, old in zip(texts, kept, strict=True)]
    if not frames.align(np.array(values).reshape(3, 3) * unit):
        raise RefusedError(3)


def _tell_boresight(_device: Liberty, station: StationSettings) -> tuple[str, bytes]:
    return _rows(station.frames.boresight_deg, "%7.2f "), floats(station.frames.boresight_deg)


def _take_boresight(device: Liberty, station: int, arguments: Arguments) -> None:
    frames = device.settings.stations[station].frames
    kept = frames.boresight_deg
    texts = [*arguments[:3], *[""] * (3 - len(arguments[:3]))]
    target = tuple(_real(text, old) for text, old in zip(texts, kept, strict=True))
    if len(arguments) > 3 and arguments[3]:
        _whole(arguments[3], (0, 1))
    now = device.orientation(station)
    if np.isfinite(now).all():
        frames.point(now, target, from_euler_deg(*target))


def _tell_hemisphere(_device: Liberty, station: StationSettings) -> tuple[str, bytes]:
    return _rows(station.hemisphere, "%7.3f"), floats(station.hemisphere)


def _take_hemisphere(device: Liberty, station: int, arguments: Arguments) -> None:
    chosen = device.settings.stations[station]
    texts = [*arguments, *[""] * (3 - len(arguments))]
    chosen.hemisphere = tuple(_real(text, old) for text, old in zip(texts, chosen.hemisphere, strict=True))


def _tell_stylus(_device: Liberty, station: StationSettings) -> tuple[str, bytes]:
    return str(station.stylus), wholes(station.stylus)


def _take_stylus(device: Liberty, station: int, arguments: Arguments) -> None:
    device.settings.stations[station].stylus = _whole(arguments[0], (0, 1))


def _tell_tip(device: Liberty, station: StationSettings) -> tuple[str, bytes]:
    values = (station.frames.tip_mm / device.mm_per_unit()).tolist()
    return _rows(values, "%6.3f "), floats(values)


def _take_tip(device: Liberty, station: int, arguments: Arguments) -> None:
    frames, unit = device.settings.stations[station].frames, device.mm_per_unit()
    texts = [*arguments, *[""] * (3 - len(arguments))]
    kept = (frames.tip_mm / unit).tolist()
    values = [_real(text, old) for text, old in zip(texts, kept, strict=True)]
    frames.tip_mm = np.array(values) * unit


def _tell_items(_device: Liberty, station: StationSettings) -> tuple[str, bytes]:
    end = (-1,) if len(station.items) < MAX_ITEMS else ()
    return " ".join(map(str, station.items)), wholes(*station.items, *end)


def _take_items(device: Liberty, station: int, arguments: Arguments) -> None:
    chosen = device.settings.stations[station]
    old = [*chosen.items, *[0] * MAX_ITEMS]
    items = [_whole(text, tuple(ITEMS)) if text else kept for text, kept in zip(arguments, old, strict=False)]
    if record_bytes(items, "binary" if device.settings.binary else "ascii") > MAX_RECORD_BYTES:
        raise RefusedError(7)
    chosen.items = tuple(items)


def _mounting(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 3)
    kept = device.settings.mounting_deg
    if not arguments:
        return device.reply(0x47, _rows(kept, "%8.3f "), floats(kept))
    texts = [*arguments, *[""] * (3 - len(arguments))]
    device.settings.mounting_deg = tuple(_real(text, old) for text, old in zip(texts, kept, strict=True))
    return b""


def _continuous(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 0)
    device.start_stream()
    return b""


def _reset_counters(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 1)
    if not arguments:
        raise RefusedError(4)
    which = _whole(arguments[0], (0, 1, 2))
    device.reset_counters(frames=which in (0, 1), timestamp=which in (0, 2))
    return b""


def _unboresight(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 1)
    for station in _stations(device, arguments):
        device.settings.stations[station].frames.reset_boresight()
    return b""


def _reset_alignment(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 1)
    for station in _stations(device, arguments):
        device.settings.stations[station].frames.reset_alignment()
    return b""


def _map_info(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 1)
    which = _whole(arguments[0], (0, 1)) if arguments else 0
    if which == 1:
        return device.reply(0x04, "0", wholes(0))
    return device.reply(0x04, "none none none", b"none".ljust(16) * 3)


def _save(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 1)
    if not arguments:
        raise RefusedError(4)
    device.save(_whole(arguments[0], range(1, _SLOTS + 1)))
    return b""


def _startup(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 1)
    if not arguments:
        raise RefusedError(4)
    device.startup_slot = _whole(arguments[0], range(_SLOTS + 1))
    return b""


def _rs232(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 2)
    settings = device.settings
    if not arguments:
        text = f"{settings.baud * 100:6d} {_PARITIES[settings.parity]}"
        return device.reply(0x0F, text, wholes(_BAUD_CODES[settings.baud], settings.parity))
    baud = _whole(arguments[0], tuple(_BAUD_CODES)) if arguments[0] else settings.baud
    parity = _whole(arguments[1], (0, 1, 2)) if len(arguments) > 1 and arguments[1] else settings.parity
    settings.baud, settings.parity = baud, parity
    return b""


def _bit_errors(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 1)
    if arguments:
        _whole(arguments[0], (0,))
        device.clear_bit_errors()
        return b""
    count = _BIT_WORDS_OF_ONE_BOARD_SET * (2 if device.ports > 8 else 1)
    words = [0] * count
    for station in device.failed_channels():
        words[station if station <= 8 else station + 1] = 1
    if any(words[_BIT_WORDS_OF_ONE_BOARD_SET:]):
        words[9], words[0] = 1, _SECOND_SET
    return device.reply(0x14, " ".join(f"0x{word:08x}" for word in words), struct.pack(f"<{count}I", *words))


def _station_state(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 2)
    if not arguments or not arguments[0]:
        raise RefusedError(4)
    detected, enabled = _bits(device.detected()), _bits(filter(device.enabled, device.all_stations))
    active = detected & enabled
    if len(arguments) == 1:
        station = 0 if arguments[0] == "0" else _stations(device, arguments)[0]
        text = f"{detected:04x}{active:04x}" if station == 0 else f"{active:016b}"[::-1]
        return device.reply(0x15, text, struct.pack("<I", detected << 16 | active), station)
    if arguments[0] == "0":
        if not re.fullmatch(r"[0-9a-fA-F]{1,4}", arguments[1]):
            raise RefusedError(3)
        wanted = int(arguments[1], 16)
        for station in device.all_stations:
            device.settings.stations[station].enabled = bool(wanted >> (station - 1) & 1)
        return b""
    state = _whole(arguments[1], (0, 1))
    for station in _stations(device, arguments):
        device.settings.stations[station].enabled = bool(state)
    return b""


def _bits(stations: Iterable[int]) -> int:
    return sum(1 << (station - 1) for station in stations)


def _whoami(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 1)
    if arguments:
        station = _stations(device, arguments)[0]
        text = f"EMULATED-{station:02d}"
        return device.reply(0x16, f"{station} {text}", wholes(station) + text.encode(), station)
    kind = 1 if device.family == "patriot" else 0
    size = "" if kind else f" 240/{16 if device.ports > 8 else 8}"
    text = f"{device.family.upper()}{size} (emulated), {device.ports} ports, firmware EMU-1, serial EMU0001"
    return device.reply(0x16, text, bytes((device.ports, kind, 0)) + text.encode())


def _name(device: Liberty, arguments: Arguments) -> bytes:
    if arguments:
        device.settings.name = arguments[0][:_NAME_CHARACTERS]
        return b""
    names = [device.settings.name, "factory", *(_slot_name(device, slot) for slot in range(1, _SLOTS + 1))]
    names.append(_slot_name(device, device.startup_slot))
    return device.reply(0x18, " ".join(f"{name:16}" for name in names), b"".join(_field(n) for n in names))


def _slot_name(device: Liberty, slot: int) -> str:
    return device.slots[slot].name if slot in device.slots else "factory"


def _field(name: str) -> bytes:
    return name.encode("latin-1").ljust(16, b"\0")


def _reinitialise(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 0)
    device.reinitialise()
    return b""


def _configuration(device: Liberty, arguments: Arguments) -> bytes:
    _at_most(arguments, 1)
    if not arguments:
        raise RefusedError(4)
    slot = _whole(arguments[0], range(_SLOTS + 1))
    name = _slot_name(device, slot)
    body = _field(name).ljust(_CONFIGURATION_BYTES - 8, b"\0")
    if device.settings.binary:
        return device.reply(0x1A, "", body)
    return f"00z configuration {slot}: {name}\r\n".encode("latin-1")


def _fixed(*values: int) -> Callable[[Liberty], Sequence[int]]:
    return lambda _device: values


COMMANDS: dict[bytes, Command] = {
    b"A": _of_stations(0x41, 9, _tell_alignment, _take_alignment),
    b"B": _of_stations(0x42, 4, _tell_boresight, _take_boresight),
    b"C": _continuous,
    b"D": _choice(0x44, "compensation", _fixed(0, 1, 2, 3)),
    b"F": _choice(0x46, "binary", _fixed(0, 1)),
    b"G": _mounting,
    b"H": _of_stations(0x48, 3, _tell_hemisphere, _take_hemisphere),
    b"L": _of_stations(0x4C, 1, _tell_stylus, _take_stylus),
    b"N": _of_stations(0x4E, 3, _tell_tip, _take_tip),
    b"O": _of_stations(0x4F, MAX_ITEMS, _tell_items, _take_items),
    b"Q": _reset_counters,
    b"R": _choice(0x52, "rate", lambda device: device.rate_codes),
    b"U": _choice(0x55, "unit", _fixed(0, 1)),
    b"X": _filter(0x58, "position_filter"),
    b"Y": _filter(0x59, "attitude_filter"),
    b"Z": _choice(0x5A, "sync", _fixed(0, 1)),
    b"\x02": _unboresight,
    b"\x04": _map_info,
    b"\x05": _choice(0x05, "echo", _fixed(0, 1)),
    b"\x0b": _save,
    b"\x0f": _rs232,
    b"\x12": _reset_alignment,
    b"\x14": _bit_errors,
    b"\x15": _station_state,
    b"\x16": _whoami,
    b"\x17": _startup,
    b"\x18": _name,
    b"\x19": _reinitialise,
    b"\x1a": _configuration,
    b"@": _choice(0x40, "buffered", _fixed(0, 1)),
}
"""Command letter, or control character, -> what it does. P has no place here: it acts without an end."""
