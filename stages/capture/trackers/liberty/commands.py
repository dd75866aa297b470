"""Commands of LIBERTY and PATRIOT: the bytes that set something, and the questions that ask for it.

A setting is not answered; whether it was taken is only known by asking for it. Source: LIBERTY User Manual
URM03PH156, section on commands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

CR = b"\r"

POLL = b"P"
"""Ends a stream and asks for one record of each station; the only command that ends without CR."""

STREAM = b"C" + CR
TEXT, BINARY = b"F0" + CR, b"F1" + CR
RESET_COUNTERS = b"Q0" + CR
WHOAMI = b"\x16" + CR
ECHO_OFF = b"\x050" + CR
RATES = {120: 3, 240: 4}
"""Frames a second -> the number that stands for it."""

CENTIMETRES = 1
FILTER_OFF = (0.0, 1.0, 0.0, 0.0)


@dataclass(frozen=True)
class Question:
    """A setting that can be asked for.

    command : as it is sent, without station and CR. kind : "number", "numbers" (a list of whole ones),
    "floats", "words" (hexadecimal in text) or "stations". count : how many floats; decimals : of each in
    text, where numbers may touch each other. per_station : asked of each station.
    """

    command: bytes
    kind: str
    count: int = 1
    decimals: int = 0
    per_station: bool = False


QUESTIONS = {
    "units": Question(b"U", "number"),
    "rate": Question(b"R", "number"),
    "stations": Question(b"\x150", "stations"),
    "source_frame": Question(b"G", "floats", 3, 3),
    "external_sync": Question(b"Z", "number"),
    "position_filter": Question(b"X", "floats", 4, 3),
    "attitude_filter": Question(b"Y", "floats", 4, 3),
    "bit_errors": Question(b"\x14", "words"),
    "echo": Question(b"\x05", "number"),
    "usb_buffering": Question(b"@B", "number"),
    "output_list": Question(b"O", "numbers", per_station=True),
    "hemisphere": Question(b"H", "floats", 3, 3, per_station=True),
    "stylus": Question(b"L", "number", per_station=True),
    "boresight": Question(b"B", "floats", 3, 2, per_station=True),
    "alignment": Question(b"A", "floats", 9, 2, per_station=True),
    "tip_offset": Question(b"N", "floats", 3, 3, per_station=True),
}
"""What is asked for: name -> question."""


def question_bytes(question: Question, station: int = 0) -> bytes:
    """Give a question as it is sent; `station` where it is asked of each."""
    return question.command + (str(station).encode() if question.per_station else b"") + CR


def set_units(unit: int) -> bytes:
    """Have positions in inches (0) or centimetres (1)."""
    return b"U%d\r" % unit


def set_rate(number: int) -> bytes:
    """Have so many frames a second (see RATES)."""
    return b"R%d\r" % number


def set_external_sync(on: int) -> bytes:
    """Watch the sync input and pulse the sync output at every frame (1), or not (0)."""
    return b"Z%d\r" % on


def set_echo(on: int) -> bytes:
    """Have every command sent back (1), or not (0)."""
    return b"\x05%d\r" % on


def set_output_list(items: Sequence[int], station: int | None = None) -> bytes:
    """Have records of a station, or of all, hold those items."""
    return b"O%b,%b\r" % (_station(station), ",".join(map(str, items)).encode())


def set_hemisphere(vector: Sequence[float], station: int | None = None) -> bytes:
    """Say in which half of space a receiver is, or with (0, 0, 0) that the tracker shall follow it."""
    return b"H%b,%b\r" % (_station(station), _numbers(vector))


def set_stylus(mode: int, station: int | None = None) -> bytes:
    """Have a stylus' button mark records (0); with 1 a press would stop and start the stream."""
    return b"L%b,%d\r" % (_station(station), mode)


def set_station(station: int, on: int) -> bytes:
    """Have a station send records (1), or not (0)."""
    return b"\x15%d,%d\r" % (station, on)


def set_position_filter(values: Sequence[float]) -> bytes:
    """Set the filter of positions: F, lowest, highest, factor."""
    return b"X%b\r" % _numbers(values)


def set_attitude_filter(values: Sequence[float]) -> bytes:
    """Set the filter of orientations: F, lowest, highest, factor."""
    return b"Y%b\r" % _numbers(values)


def _station(station: int | None) -> bytes:
    return b"*" if station is None else b"%d" % station


def _numbers(values: Sequence[float]) -> bytes:
    return ",".join(f"{value:g}" for value in values).encode()
