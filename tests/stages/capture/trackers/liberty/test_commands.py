"""The bytes of LIBERTY's commands, as the manual's table of commands has them."""

import re

import pytest

from stages.capture.trackers.liberty import commands
from stages.capture.trackers.liberty.commands import QUESTIONS, question_bytes


@pytest.mark.parametrize(
    ("built", "bytes_of_the_manual"),
    [
        (commands.set_units(1), b"U1\r"),
        (commands.set_rate(commands.RATES[240]), b"R4\r"),
        (commands.set_rate(commands.RATES[120]), b"R3\r"),
        (commands.set_external_sync(0), b"Z0\r"),
        (commands.set_echo(0), b"\x050\r"),
        (commands.set_output_list((8, 9, 11, 10, 12, 3, 7)), b"O*,8,9,11,10,12,3,7\r"),
        (commands.set_output_list((2, 4, 1), 12), b"O12,2,4,1\r"),
        (commands.set_hemisphere((1.0, 0.0, 0.0)), b"H*,1,0,0\r"),
        (commands.set_hemisphere((0.0, -0.5, 0.25), 3), b"H3,0,-0.5,0.25\r"),
        (commands.set_stylus(0), b"L*,0\r"),
        (commands.set_station(7, 1), b"\x157,1\r"),
        (commands.set_position_filter(commands.FILTER_OFF), b"X0,1,0,0\r"),
        (commands.set_attitude_filter(commands.FILTER_OFF), b"Y0,1,0,0\r"),
        (commands.RESET_COUNTERS, b"Q0\r"),
        (commands.STREAM, b"C\r"),
        (commands.POLL, b"P"),
        (commands.WHOAMI, b"\x16\r"),
        (question_bytes(QUESTIONS["output_list"], 16), b"O16\r"),
        (question_bytes(QUESTIONS["stations"]), b"\x150\r"),
        (question_bytes(QUESTIONS["bit_errors"]), b"\x14\r"),
        (question_bytes(QUESTIONS["usb_buffering"]), b"@B\r"),
    ],
)
def test_commands_are_the_manuals(built: bytes, bytes_of_the_manual: bytes) -> None:
    assert built == bytes_of_the_manual


def test_no_question_changes_anything() -> None:
    """A, B, G and N with more than a station would align or move something; ^T with 0 clears the errors."""
    for name, question in QUESTIONS.items():
        asked = question_bytes(question, 5)
        assert asked.endswith(b"\r")
        if name != "stations":  # its 0 asks for all
            shape = rb"(@B|[A-Z\x05\x14])5?\r" if question.per_station else rb"(@B|[A-Z\x05\x14])\r"
            assert re.fullmatch(shape, asked), name
