"""What holds for decoders of all families: pieces, tiling, damage, memory."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from tracker_streams import check_tiles, decode, skipped_bytes, streams

from shukotsu.tracker.families import StreamSettings
from shukotsu.tracker.records import PiecewiseDecoder, Records
from shukotsu.tracker.stream import DECODERS

STREAMS = streams()
NAMES = tuple(STREAMS)
DAMAGES = ("dropped", "flipped", "top bit", "put in", "twice")


def decoder_of(settings: StreamSettings) -> PiecewiseDecoder:
    return DECODERS[settings.family](settings)


def damaged(whole: bytes, offset: int, kind: str) -> bytes:
    before, byte, after = whole[:offset], whole[offset : offset + 1], whole[offset + 1 :]
    return {
        "dropped": before + after,
        "flipped": before + bytes([byte[0] ^ 0x15]) + after,
        "top bit": before + bytes([byte[0] ^ 0x80]) + after,
        "put in": before + b"0" + byte + after,
        "twice": before + byte + byte + after,
    }[kind]


def rows(records: Records) -> Iterator[tuple[float, ...]]:
    table = np.column_stack([records.station, records.position_mm, np.abs(records.quaternion)])
    for row in table[~records.doubtful]:
        yield tuple(row.round(9).tolist())


@pytest.mark.parametrize("kind", DAMAGES)
@pytest.mark.parametrize("name", NAMES)
def test_a_damaged_byte_costs_one_record(name: str, kind: str) -> None:
    stream = STREAMS[name]
    expected = set(rows(decode(decoder_of(stream.settings), stream.data).records))
    pieces = [len(piece) for piece in stream.pieces]
    allowed = 4 if name == "viper" else 1  # a frame has all four stations
    for offset in range(sum(pieces[:8]), sum(pieces[:10]), 5 if name == "viper" else 2):
        data = damaged(stream.data, offset, kind)
        decoded = decode(decoder_of(stream.settings), data)
        assert len(expected - set(rows(decoded.records))) <= allowed, offset
        check_tiles(decoded, len(data))


@pytest.mark.parametrize("name", NAMES)
def test_garbage_between_records_costs_nothing(name: str) -> None:
    stream = STREAMS[name]
    random = np.random.default_rng(5)
    garbage = [
        random.integers(128, 256, int(random.integers(1, 40)), np.uint8).tobytes() for _ in stream.pieces
    ]
    data = b"".join(noise + piece for noise, piece in zip(garbage, stream.pieces, strict=True))
    clean, decoded = (decode(decoder_of(stream.settings), sent) for sent in (stream.data, data))
    assert list(rows(decoded.records)) == list(rows(clean.records))
    assert len(skipped_bytes(decoded)) == sum(map(len, garbage))


@pytest.mark.parametrize("name", NAMES)
def test_what_is_kept_for_later_stays_small(name: str) -> None:
    stream = STREAMS[name]
    decoder = decoder_of(stream.settings)
    random = np.random.default_rng(1)
    for _ in range(60):
        decoder.feed(random.bytes(4096) + stream.pieces[0][:8])
        assert len(decoder._rest) < 6000
