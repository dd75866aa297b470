"""LIBERTY and PATRIOT in ASCII: records however they are spaced."""

import numpy as np
import pytest
from fuzzing.decoding import check_tiles, decode
from fuzzing.tracker_streams import liberty_text, pose, settings

from shukotsu.trackers.liberty.text_decoder import TextDecoder
from shukotsu.trackers.protocols.records import Decoded, Records

DEFAULT = (2, 4, 1)


def read(data: bytes, items: tuple[int, ...] = DEFAULT, family: str = "liberty", unit: str = "cm") -> Decoded:
    decoded = decode(TextDecoder(settings(family, "ascii", items, unit=unit)), data)
    check_tiles(decoded, len(data))
    return decoded


def only(data: bytes, items: tuple[int, ...] = DEFAULT) -> Records:
    decoded = read(data, items)
    assert len(decoded.records) == 1
    assert not decoded.skipped
    return decoded.records


@pytest.mark.parametrize("family", ["liberty", "patriot"])
@pytest.mark.parametrize(("unit", "mm"), [("cm", 10.0), ("inch", 25.4)])
@pytest.mark.parametrize(
    "items", [DEFAULT, (2, 7, 1), (3, 5, 1), (2, 6), (8, 0, 9, 0, 11, 0, 10, 0, 12, 0, 3, 7, 1), (9, 2, 7)]
)
def test_every_number_comes_out(family: str, unit: str, mm: float, items: tuple[int, ...]) -> None:
    names = [(frame, station) for frame in (1, 1000) for station in (1, 2, 3, 4)]
    data = b"".join(liberty_text(f, s, items) for f, s in names)
    decoded = read(data, items, family, unit)
    records = decoded.records
    assert not decoded.skipped
    assert records.station.tolist() == [s for _, s in names]
    for row, (frame, station) in enumerate(names):
        position, quaternion = pose(frame, station)
        np.testing.assert_allclose(records.position_mm[row], mm * np.array(position), atol=6e-4 * mm)
        sign = np.sign(records.quaternion[row] @ quaternion)
        np.testing.assert_allclose(sign * records.quaternion[row], quaternion, atol=2e-5)
        assert records.frame[row] == (frame if 9 in items else -1)
        assert records.device_ms[row] == (frame * 1000 // 240 if 8 in items else -1)
        counted = records.distortion[row], records.button[row], records.sync[row]
        assert counted == ((2, 1, 0) if 11 in items else (-1, -1, -1))
    assert not records.doubtful.any()


@pytest.mark.parametrize(
    "text",
    [
        b"01  16.082 -2.500 3.000 10.000 -20.000 30.000\r\n",
        b"01   16.082  -2.500   3.000  10.000 -20.000  30.000 \r\n",
        b"01  16.082-2.5000 3.000 10.000-20.000 30.000\r\n",
        b"01P  16.082 -2.500 3.000 10.000 -20.000 30.000\r\n",
        b"01C    16.082   -2.500 3.000 10.000 -20.000 30.000 \r\n",
    ],
)
def test_headers_and_blanks_as_they_come(text: bytes) -> None:
    records = only(text)
    np.testing.assert_allclose(records.position_mm[0], [160.82, -25, 30])
    assert records.error.tolist() == [0]
    assert not records.doubtful.any()


@pytest.mark.parametrize(
    ("middle", "error"),
    [(b"  ", 0), (b"a ", ord("a")), (b"C ", ord("C")), (b"C  ", 0), (b"Cu ", ord("u")), (b"P  ", 0)],
)
def test_an_error_letter_is_told_from_the_commands(middle: bytes, error: int) -> None:
    assert only(liberty_text(1, 2, DEFAULT, middle)).error.tolist() == [error]


@pytest.mark.parametrize(
    "numbers", [b"1.0 2.0 3.0 4.0 5.0", b"1.0 2.0 3.0 4.0 5.0 6.0 7.0", b"1.0 2.0 3.0 4.0 5.0 x"]
)
def test_another_count_of_numbers_is_no_record(numbers: bytes) -> None:
    good = liberty_text(1, 1, DEFAULT)
    decoded = read(good + b"01  " + numbers + b"\r\n" + good)
    assert len(decoded.records) == 2
    assert [(skip.offset, skip.size) for skip in decoded.skipped] == [(60, 6 + len(numbers))]
