"""FASTRAK in both modes: every number of a record, touching fields, and the way back after damage."""

import struct

import numpy as np
import pytest
from fuzzing.decoding import check_tiles, decode
from fuzzing.tracker_streams import fastrak_binary, fastrak_text, pose, settings

from shukotsu.trackers.fastrak.binary_decoder import BinaryDecoder
from shukotsu.trackers.fastrak.items import OUTPUT_ITEMS
from shukotsu.trackers.fastrak.text_decoder import TextDecoder
from shukotsu.trackers.protocols.records import Decoded

LISTS = [(2, 4, 1), (2, 11, 0), (2, 5, 6, 7, 1), (2, 6, 7), (2, 11, 16, 1), (52, 61, 1), (2, 2, 4)]


def read(data: bytes, items: tuple[int, ...], mode: str = "binary", unit: str = "cm") -> Decoded:
    made = {"binary": BinaryDecoder, "ascii": TextDecoder}[mode]
    decoded = decode(made(settings("fastrak", mode, items, unit=unit)), data)
    check_tiles(decoded, len(data))
    return decoded


@pytest.mark.parametrize("mode", ["binary", "ascii"])
@pytest.mark.parametrize(("unit", "mm"), [("cm", 10.0), ("inch", 25.4)])
@pytest.mark.parametrize("items", LISTS)
def test_every_number_comes_out(mode: str, unit: str, mm: float, items: tuple[int, ...]) -> None:
    names = [(frame, station) for frame in (1, 2) for station in (1, 2, 3, 4)]
    write = {"binary": fastrak_binary, "ascii": fastrak_text}[mode]
    pieces = [write(f, s, items, b"E" if s == 3 else b" ") for f, s in names]
    decoded = read(b"".join(pieces), items, mode, unit)
    records = decoded.records
    assert not decoded.skipped
    assert records.station.tolist() == [s for _, s in names]
    assert records.error.tolist() == [ord("E") if s == 3 else 0 for _, s in names]
    assert records.button.tolist() == [1 if 16 in items else -1] * 8
    assert records.size.tolist() == [len(piece) for piece in pieces]
    assert max(map(len, pieces)) <= OUTPUT_ITEMS.record_bytes(items, mode)
    for row, (frame, station) in enumerate(names):
        position, quaternion = pose(frame, station)
        np.testing.assert_allclose(records.position_mm[row], mm * np.array(position), atol=6e-3 * mm)
        sign = np.sign(records.quaternion[row] @ quaternion)
        np.testing.assert_allclose(
            sign * records.quaternion[row], quaternion, atol=1e-4 if mode == "ascii" else 1e-6
        )
    assert not records.doubtful.any()


def test_a_header_in_the_numbers_of_a_still_receiver_does_not_mislead() -> None:
    position = struct.unpack("<f", b"01 B")[0]
    record = b"01 " + struct.pack("<3f4f", position, 1, 1, 1, 0, 0, 0) + b" "
    decoded = read(record[9:] + record * 6, (2, 11, 0))
    assert decoded.records.offset.tolist() == [len(record) - 9 + n * len(record) for n in range(6)]


def test_numbers_that_cannot_be_right_are_doubted_and_kept_in_step() -> None:
    good = fastrak_binary(1, 1, (2, 11, 0))
    far = good[:3] + struct.pack("<f", 400) + good[7:]
    long = good[:15] + struct.pack("<4f", 1, 0.2, 0, 0) + good[31:]
    records = read(good + far + long + good, (2, 11, 0)).records
    assert records.doubtful.tolist() == [False, True, True, False]
