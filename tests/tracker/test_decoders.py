"""Decoders of all tracker families: values, damaged bytes, garbage, memory; settings of a stream."""

import struct
from typing import Any

import numpy as np
import pytest
from tracker_streams import decode, liberty_binary, pose, settings, viper_closed, viper_frame, viper_reply

from shukotsu.errors import InputError
from shukotsu.tracker.liberty import list_of_all
from shukotsu.tracker.records import Decoded, Records, StreamSettings, settings_from_json
from shukotsu.tracker.stream import DECODERS
from shukotsu.tracker.viper_decoder import REFUSED

FULL, STATIONS = (8, 9, 11, 10, 12, 3, 7), (1, 2, 3, 4)
LISTS = {"liberty full": FULL, "liberty short": (9, 2, 7), "patriot": (2, 7), "viper": ()}
"""Output lists by name of the stream; the first word is the tracker's family."""
DAMAGES = ("dropped", "flipped", "top bit", "put in", "twice")


def stream(name: str) -> tuple[StreamSettings, list[bytes]]:
    """Return the settings and the records (for a VIPER, frames) of an undamaged stream of four stations."""
    family, items = name.split()[0], LISTS[name]
    if family == "viper":
        return settings(family), [viper_frame(frame, STATIONS) for frame in range(1, 16)]
    tag = {"liberty": b"LY", "patriot": b"PA"}[family]
    records = [liberty_binary(frame, station, items, tag) for frame in range(1, 6) for station in STATIONS]
    return settings(family, items), records


def read(how: StreamSettings, data: bytes) -> Decoded:
    return decode(DECODERS[how.family](how), data)


def damaged(whole: bytes, offset: int, kind: str) -> bytes:
    before, byte, after = whole[:offset], whole[offset : offset + 1], whole[offset + 1 :]
    return {
        "dropped": before + after,
        "flipped": before + bytes([byte[0] ^ 0x15]) + after,
        "top bit": before + bytes([byte[0] ^ 0x80]) + after,
        "put in": before + b"0" + byte + after,
        "twice": before + byte + byte + after,
    }[kind]


def rows(records: Records) -> list[tuple[float, ...]]:
    table = np.column_stack([records.station, records.position_mm, np.abs(records.quaternion)])
    return [tuple(row) for row in table[~records.doubtful].round(9).tolist()]


@pytest.mark.parametrize("kind", DAMAGES)
@pytest.mark.parametrize("name", LISTS)
def test_a_damaged_byte_costs_at_most_one_record(name: str, kind: str) -> None:
    how, pieces = stream(name)
    clean = b"".join(pieces)
    expected = set(rows(read(how, clean).records))
    allowed = 4 if name == "viper" else 1  # a frame has all four stations
    for offset in range(len(b"".join(pieces[:8])), len(b"".join(pieces[:10])), 7 if name == "viper" else 3):
        decoded = read(how, damaged(clean, offset, kind))
        assert len(expected - set(rows(decoded.records))) <= allowed, offset


@pytest.mark.parametrize("name", LISTS)
def test_garbage_costs_no_record_and_the_buffer_stays_small(name: str) -> None:
    how, pieces = stream(name)
    random = np.random.default_rng(5)
    garbage = [random.integers(128, 256, int(random.integers(1, 40)), np.uint8).tobytes() for _ in pieces]
    data = b"".join(noise + piece for noise, piece in zip(garbage, pieces, strict=True))
    clean, decoded = (read(how, sent) for sent in (b"".join(pieces), data))
    assert rows(decoded.records) == rows(clean.records)
    assert sum(skip.size for skip in decoded.skipped) == sum(map(len, garbage))
    decoder = DECODERS[how.family](how)
    for _ in range(60):
        decoder.feed(random.bytes(4096) + pieces[0][:8])
        assert len(decoder._rest) < 6000


@pytest.mark.parametrize("items", [FULL, (9, 2, 7), (2, 7, 8, 0), (8, 9, 11, 3, 7), (9, 2, 7, 1)])
@pytest.mark.parametrize(("unit", "mm"), [("cm", 10.0), ("inch", 25.4)])
def test_every_number_of_a_liberty_record_is_decoded(items, unit: str, mm: float) -> None:
    sent_by = [(frame, station) for frame in range(6) for station in STATIONS]
    data = b"".join(liberty_binary(frame, station, items) for frame, station in sent_by)
    decoded = read(settings("liberty", items, unit=unit), data)
    records = decoded.records
    assert len(records) == 24
    assert not decoded.skipped
    for row, (frame, station) in enumerate(sent_by):
        position, quaternion = pose(frame, station)
        sent = np.array(position, np.float32).astype(float)
        assert records.position_mm[row].tolist() == (sent * mm).tolist()
        assert records.quaternion[row].tolist() == np.array(quaternion, np.float32).astype(float).tolist()
        assert records.station[row] == station
        assert records.frame[row] == (frame if 9 in items else -1)
        assert records.device_ms[row] == (frame * 1000 // 240 if 8 in items else -1)
        assert records.distortion[row] == (2 if 11 in items else -1)
        assert records.button[row] == (1 if 10 in items else -1)
        assert records.sync[row] == (0 if 12 in items else -1)
    assert not records.doubtful.any()
    assert not records.error.any()


def test_a_tag_inside_the_numbers_is_not_taken_for_a_record() -> None:
    position = struct.unpack("<f", b"LY\x01C")[0]
    body = struct.pack("<I3f4f", 7, position, position, position, 1, 0, 0, 0)
    head = b"LY\x01C\0\0" + struct.pack("<h", len(body))
    decoded = read(settings("liberty", (9, 2, 7)), (head + body) * 5)
    assert len(decoded.records) == 5
    assert not decoded.skipped


def test_impossible_numbers_are_marked_doubtful() -> None:
    good = liberty_binary(1, 1, (9, 2, 7))
    far = good[:12] + struct.pack("<f", 400.0) + good[16:]
    nan = good[:12] + struct.pack("<f", float("nan")) + good[16:]
    long = good[:24] + struct.pack("<4f", 1, 0.2, 0, 0) + good[40:]
    decoded = read(settings("liberty", (9, 2, 7)), b"".join([good, far, nan, long, good]))
    assert decoded.records.doubtful.tolist() == [False, True, True, True, False]


@pytest.mark.parametrize("lists", [{1: (2, 13)}, {17: (2,)}, {1: ()}])
def test_an_impossible_output_list_is_refused(lists) -> None:
    with pytest.raises(InputError, match=r"output list .* of station .*; a LIBERTY has stations 1 to"):
        list_of_all(lists)


VIPER = settings("viper")


@pytest.mark.parametrize(("unit", "mm"), [(0, 25.4), (1, 304.8), (2, 10.0), (3, 1000.0)])
@pytest.mark.parametrize("accelerated", [False, True])
def test_every_number_of_a_viper_frame_is_decoded(unit: int, mm: float, accelerated: bool) -> None:
    frames = [viper_frame(2**32 - 1, (1, 3), unit, accelerated), viper_frame(7, (16,), unit)]
    records = read(VIPER, b"".join(frames)).records
    assert records.station.tolist() == [1, 3, 16]
    assert records.frame.tolist() == [2**32 - 1, 2**32 - 1, 7]
    assert records.offset.tolist() == [0, 56, 92]
    assert records.size.tolist() == [56, 36, 60]
    assert records.distortion.tolist() == [37, 37, 37]
    assert records.button.tolist() == [1, 1, 1]
    assert records.device_ms.tolist() == [-1, -1, -1]
    for row, (frame, station) in enumerate([(2**32 - 1, 1), (2**32 - 1, 3), (7, 16)]):
        position, quaternion = pose(frame, station)
        np.testing.assert_allclose(records.position_mm[row], mm * np.array(position), rtol=1e-6)
        sign = np.sign(records.quaternion[row] @ quaternion)
        np.testing.assert_allclose(
            sign * records.quaternion[row], quaternion, atol=5e-5 if accelerated else 1e-6
        )
    assert records.doubtful.tolist() == (np.linalg.norm(records.position_mm, axis=1) > 3048).tolist()


def test_a_frame_with_a_wrong_checksum_is_skipped() -> None:
    good, bad = viper_frame(1, (1, 2)), bytearray(viper_frame(2, (1, 2)))
    bad[-4] ^= 1
    decoded = read(VIPER, good + bytes(bad) + good)
    assert decoded.records.frame.tolist() == [1, 1, 1, 1]
    assert [(skip.offset, skip.size) for skip in decoded.skipped] == [(len(good), len(bad))]


def test_replies_of_a_viper_are_separated_from_frames() -> None:
    answer, refused = viper_reply(7, b"\2\0\0\0"), viper_reply(20, b"", REFUSED)
    empty = viper_frame(3, ())
    decoded = read(VIPER, answer + viper_frame(1, (1,)) + refused + empty)
    assert [(r.command, r.error) for r in decoded.replies] == [(7, 0), (20, REFUSED), (19, 0)]
    assert decoded.replies[0].body == answer[8:-4]
    assert len(decoded.records) == 1


def test_virtual_sensors_and_unknown_orientations_are_doubtful() -> None:
    frame = bytearray(viper_frame(1, (1, 2, 3)))
    frame[24] |= 0x80
    frame[24 + 32 + 1] |= 0x0C
    records = read(VIPER, viper_closed(b"VPRP", bytes(frame[8:-4]))).records
    assert records.station.tolist() == [129, 2, 3]
    assert records.doubtful.tolist() == [True, True, False]


SETTINGS = StreamSettings("liberty", "binary", "cm", 240.0, (1, 2), {1: (2, 4)}, {1: (0.0, 0.0, 1.0)})


def test_settings_survive_a_round_trip_through_json() -> None:
    assert settings_from_json(SETTINGS.to_json(), "a.arrows") == SETTINGS


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"family": "fastrak"}, "is 'fastrak'; expected one of liberty, patriot, viper"),
        *((change, "the tracker's settings in it") for change in (
            {"stations": [1, 10**400]}, {"stations": [-1]}, {"stations": None}, {"items": {"999": [2]}},
            {"items": []}, {"hemisphere": {"1": [float("nan"), 0, 1]}}, {"hemisphere": {"1": [1]}},
            {"rate_hz": 1e308}, {"rate_hz": 10**400}, {"family": [[[[]]]]}, {"mode": "ascii"}, {"options": 7},
        )),
    ],
)  # fmt: skip
def test_damaged_or_unknown_settings_are_refused(change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=rf"^a\.arrows: {sentence}"):
        settings_from_json(SETTINGS.to_json() | change, "a.arrows")
