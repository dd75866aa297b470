"""CRC-16/ARC against its check value and against itself bit by bit."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.tracker_streams import crc16
from stages.capture.trackers.crc16 import crc16_arc


def test_the_check_value() -> None:
    assert crc16(b"123456789") == 0xBB3D
    assert crc16_arc(np.frombuffer(b"123456789", np.uint8)[None]).tolist() == [0xBB3D]


@given(
    st.integers(0, 70).flatmap(lambda n: st.lists(st.binary(min_size=n, max_size=n), min_size=1, max_size=4))
)
def test_many_strings_at_once(strings: list[bytes]) -> None:
    rows = np.frombuffer(b"".join(strings), np.uint8).reshape(len(strings), -1)
    assert crc16_arc(rows).tolist() == [crc16(string) for string in strings]
