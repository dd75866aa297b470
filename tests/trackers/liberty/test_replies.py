"""Answers of LIBERTY: found among records, told apart by station and command, read in both formats."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackers.liberty import replies
from trackers.liberty.driver import SETTINGS
from trackers.protocols.records import Reply

RECORD = b"LY\x01C\0\0" + struct.pack("<h", 20) + b"LY\x03O\0\0" + bytes(14)


def binary(station: int, command: bytes, body: bytes, error: int = 0, tag: bytes = b"LY") -> bytes:
    return tag + bytes([station]) + command + bytes([error, 0]) + struct.pack("<h", len(body)) + body


def value(name: str, data: bytes, station: int = 0, *, text: bool = False):
    """What the answer to a question is read as; None where there is none."""
    question = SETTINGS[name]
    found = replies.text_answers(data) if text else replies.binary_answers(data)
    read = replies.text_value if text else replies.binary_value
    values = [read(question, r) for r in found if replies.answers(r, question, station)]
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


@pytest.mark.parametrize(
    ("name", "station", "line", "expected"),
    [
        ("units", 0, b"00U 1\r\n", 1),
        ("rate", 0, b"00R 4\r\n", 4),
        ("echo", 0, b"00e 0\r\n", 0),
        ("usb_buffering", 0, b"00@ 1\r\n", 1),
        ("output_list", 3, b"03O 2 4 1\r\n", (2, 4, 1)),
        ("output_list", 12, b"12O  8  9 11 10 12  3  7\r\n", (8, 9, 11, 10, 12, 3, 7)),
        ("hemisphere", 3, b"03H   1.000  0.000  0.000\r\n", (1.0, 0.0, 0.0)),
        ("hemisphere", 3, b"03H -0.577-0.577-0.577\r\n", (-0.577, -0.577, -0.577)),
        ("boresight", 1, b"01B -179.99  12.00 -90.00 \r\n", (-179.99, 12.0, -90.0)),
        ("stations", 0, b"00u 00070005\r\n", (5, 7)),
        ("position_filter", 0, b"00X  0.200  0.200  0.800  0.950 \r\n", (0.2, 0.2, 0.8, 0.95)),
        ("bit_errors", 0, b"00t 0x00000001 0x00000000\r\n0x80000000\r\n", (1, 0, 0x80000000)),
        (
            "alignment",
            2,
            b"02A    0.00   0.00   0.00\r\n   1.00   0.00   0.00\r\n   0.00   1.00   0.00\r\n",
            (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0),
        ),
    ],
)
def test_text_answers(name: str, station: int, line: bytes, expected) -> None:
    assert value(name, line, station, text=True) == expected
    record = b"01   16.082  -3.100   0.250\r\n"
    assert value(name, record + line + record, station, text=True) == expected
    assert value(name, b"\x16\r" + line, station, text=True) == expected, "behind an echoed command"
    assert (value(name, line, station + 1, text=True) is None) == SETTINGS[name].per_station


def test_an_answer_that_is_not_whole_yet_is_none() -> None:
    three_lines = b"02A    0.00   0.00   0.00\r\n   1.00   0.00   0.00\r\n   0.00   1.00   0.00\r\n"
    for length in range(len(three_lines) - 3):
        assert value("alignment", three_lines[:length], 2, text=True) is None
    assert value("output_list", b"03O 2 4", 3, text=True) is None


def test_errors_are_told() -> None:
    (refused,) = replies.binary_answers(binary(0, b"O", b"Invalid Station\r\n", 2))
    assert (refused.error, replies.error_text(refused.error)) == (2, "invalid station")
    (blank,) = replies.binary_answers(binary(1, b"C", b"", 0x20))
    assert blank.error == 0
    (letter,) = replies.text_answers(b"03O\x02 Invalid\r\n")
    assert letter.error == 2
    assert replies.error_text(99) == "error 99"


def test_stations_need_both_halves_and_either_order_will_do() -> None:
    assert replies.usable_stations((0b0101, 0b0111)) == (1, 3)
    assert replies.usable_stations((0b0111, 0b0101)) == (1, 3)
    assert replies.half_stations((0b0101, 0b0111)) == (2,)
    assert replies.usable_stations((0x8000, 0x8000)) == (16,)


def test_ports_come_from_the_binary_whoami() -> None:
    assert replies.ports_of(Reply(0, 0, 0x16, 0, b"\x08\0\0LIBERTY")) == 8
    assert replies.ports_of(Reply(0, 0, 0x16, 0, b"\x40\0\0")) is None
    assert replies.ports_of(Reply(0, 0, 0x16, 0, b"")) is None


@given(data=st.binary(max_size=200))
def test_any_bytes_are_taken_without_a_fault(data: bytes) -> None:
    for question in SETTINGS.values():
        for reply in replies.binary_answers(data):
            replies.binary_value(question, reply)
        for reply in replies.text_answers(data):
            replies.text_value(question, reply)


@given(data=st.binary(max_size=40), value_sent=st.integers(-1, 5))
def test_whatever_stands_before_an_answer_it_is_found(data: bytes, value_sent: int) -> None:
    answer = binary(0, b"U", struct.pack("<i", value_sent))
    found = [r for r in replies.binary_answers(data + answer) if r.offset == len(data)]
    assert [replies.binary_value(SETTINGS["units"], reply) for reply in found] == [value_sent]
