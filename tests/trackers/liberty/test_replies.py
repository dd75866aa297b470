"""Answers of LIBERTY: found among records, told apart by station and command."""

import struct

import pytest

from shukotsu.trackers.liberty import replies
from shukotsu.trackers.liberty.liberty_driver import SETTINGS

RECORD = b"LY\x01C\0\0" + struct.pack("<h", 20) + b"LY\x03O\0\0" + bytes(14)


def binary(station: int, command: bytes, body: bytes, error: int = 0, tag: bytes = b"LY") -> bytes:
    return tag + bytes([station]) + command + bytes([error, 0]) + struct.pack("<h", len(body)) + body


def value(name: str, data: bytes, station: int = 0):
    """What the answer to a question is read as; None where there is none."""
    question = SETTINGS[name]
    values = [
        replies.binary_value(question, r)
        for r in replies.binary_answers(data)
        if replies.answers(r, question, station)
    ]
    return next((read for read in values if read is not None), None)


@pytest.mark.parametrize(
    ("name", "station", "body", "expected"),
    [
        ("units", 0, struct.pack("<i", 1), 1),
        ("rate", 0, struct.pack("<i", 4), 4),
        ("stylus", 3, struct.pack("<i", 0), 0),
        ("output_list", 3, struct.pack("<4i", 2, 4, 1, -1), (2, 4, 1)),
        ("output_list", 3, struct.pack("<20i", *[2] * 20), (2,) * 20),
        ("hemisphere", 3, struct.pack("<3f", 1, 0, -0.5), (1.0, 0.0, -0.5)),
        ("alignment", 16, struct.pack("<9f", *range(9)), tuple(map(float, range(9)))),
        ("stations", 0, struct.pack("<HH", 0x0005, 0x0007), (5, 7)),
        ("bit_errors", 0, struct.pack("<9I", 1, *[0] * 8), (1, *[0] * 8)),
        ("usb_buffering", 0, struct.pack("<i", 1), 1),
    ],
)
def test_binary_answers(name: str, station: int, body: bytes, expected) -> None:
    data = binary(station, SETTINGS[name].command[:1], body)
    assert value(name, data, station) == expected
    assert value(name, RECORD + data + RECORD, station) == expected
    assert value(name, data[:-1], station) is None
    assert (value(name, data, station + 1) is None) == SETTINGS[name].per_station


def test_errors_are_told() -> None:
    (refused,) = replies.binary_answers(binary(0, b"O", b"Invalid Station\r\n", 2))
    assert (refused.error, replies.ERRORS[refused.error]) == (2, "invalid station")
    (blank,) = replies.binary_answers(binary(1, b"C", b"", 0x20))
    assert blank.error == 0
