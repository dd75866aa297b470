"""Answers of LIBERTY: found among records, told apart by station and command."""

import struct

import pytest

from shukotsu.trackers.liberty import replies
from shukotsu.trackers.liberty.driver import SETTINGS

RECORD = b"LY\x01C\0\0" + struct.pack("<h", 20) + b"LY\x03O\0\0" + bytes(14)


def binary(station: int, command: bytes, body: bytes, error: int = 0, tag: bytes = b"LY") -> bytes:
    return tag + bytes([station]) + command + bytes([error, 0]) + struct.pack("<h", len(body)) + body


def value(name: str, data: bytes, station: int = 0):
    """What the answer to a question is read as; None where there is none."""
    question = SETTINGS[name]
    found = replies.binary_answers(data)
    values = [replies.binary_value(question, r) for r in found if replies.answers(r, question, station)]
    return next((one for one in values if one is not None), None)


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


@pytest.mark.parametrize("before", [b"", b"01   16.082  -3.100   0.250\r\n", b"\x16\r"])
def test_who_it_is_in_text(before: bytes) -> None:
    """Behind a record or an echoed command, in one line or several."""
    answer = b"00v  LIBERTY 240/8\r\nfirmware  1.0\r\n"
    assert replies.text_whoami(before + answer) == "LIBERTY 240/8 firmware 1.0"
    assert replies.text_whoami(before + answer[:10]) is None


def test_errors_are_told() -> None:
    (refused,) = replies.binary_answers(binary(0, b"O", b"Invalid Station\r\n", 2))
    assert (refused.error, replies.error_text(refused.error)) == (2, "invalid station")
    (blank,) = replies.binary_answers(binary(1, b"C", b"", 0x20))
    assert blank.error == 0
    assert replies.error_text(99) == "error 99"
