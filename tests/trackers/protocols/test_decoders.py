"""What holds for the decoders of all families: pieces, tiling, damage, memory."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.fuzz_decoding import check_same, check_tiles, decode, skipped_bytes
from benchmarks.tracker_streams import Stream, streams
from trackers.families import decoder_of
from trackers.protocols.records import Records

STREAMS = streams()
NAMES = tuple(STREAMS)
DAMAGES = ("dropped", "flipped", "top bit", "put in", "twice")
CUTS = st.lists(st.integers(0, 3000), max_size=12)


@st.composite
def spoilt(draw: st.DrawFn) -> tuple[Stream, bytes]:
    stream = STREAMS[draw(st.sampled_from(NAMES))]
    data = bytearray(stream.data[draw(st.integers(0, 40)) :])
    for place in draw(st.lists(st.integers(0, len(data) - 9), max_size=6)):
        data[place : place + draw(st.integers(0, 9))] = draw(st.binary(max_size=9))
    return stream, bytes(data)


@pytest.mark.parametrize("name", NAMES)
def test_a_clean_stream_loses_nothing(name: str) -> None:
    stream = STREAMS[name]
    decoded = decode(decoder_of(stream.settings), stream.data)
    per_piece = 4 if name.startswith("viper") else 1
    assert len(decoded.records) == per_piece * len(stream.pieces)
    assert not decoded.skipped
    assert not decoded.replies
    assert not decoded.records.doubtful.any()
    assert not decoded.records.error.any()
    grouped = not name.startswith("trakstar") or "group" in name
    assert decoded.records.station.tolist()[:4] == ([1, 2, 3, 4] if grouped else [1, 1, 1, 1])


def check_cuts(made: tuple[Stream, bytes], cuts: list[int]) -> None:
    stream, data = made
    check_same(decode(decoder_of(stream.settings), data), decode(decoder_of(stream.settings), data, cuts))


def check_every_byte(made: tuple[Stream, bytes]) -> None:
    stream, data = made
    check_tiles(decode(decoder_of(stream.settings), data), len(data))


@settings(max_examples=60)
@given(made=spoilt(), cuts=CUTS)
def test_the_outcome_does_not_depend_on_where_the_stream_is_cut(made, cuts) -> None:
    check_cuts(made, cuts)


@settings(max_examples=60)
@given(made=spoilt())
def test_every_byte_is_in_a_record_a_reply_or_skipped(made) -> None:
    check_every_byte(made)


@pytest.mark.slow
@settings(max_examples=2000)
@given(made=spoilt(), cuts=CUTS)
def test_both_hold_for_many_streams(made, cuts) -> None:
    check_cuts(made, cuts)
    check_every_byte(made)


@pytest.mark.parametrize("name", NAMES)
def test_byte_by_byte_is_as_good_as_at_once(name: str) -> None:
    stream = STREAMS[name]
    data = b"".join(stream.pieces[:9])[5:]
    check_same(
        decode(decoder_of(stream.settings), data),
        decode(decoder_of(stream.settings), data, range(len(data))),
    )


def damaged(whole: bytes, place: int, kind: str) -> bytes:
    before, byte, after = whole[:place], whole[place : place + 1], whole[place + 1 :]
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
    allowed = 4 if name.startswith("viper") else 1  # a frame has all four stations
    for place in range(sum(pieces[:8]), sum(pieces[:10]), 4):
        data = damaged(stream.data, place, kind)
        decoded = decode(decoder_of(stream.settings), data)
        assert len(expected - set(rows(decoded.records))) <= allowed, place
        check_tiles(decoded, len(data))


UNPROVEN = ("fastrak b", "trakstar", "liberty binary (2, 4, 1)", "liberty binary (2, 6)")
"""Records without a length, a checksum or a quaternion that would prove one between garbage."""


@pytest.mark.parametrize("name", [name for name in NAMES if not name.startswith(UNPROVEN)])
def test_garbage_between_records_costs_nothing(name: str) -> None:
    stream = STREAMS[name]
    random = np.random.default_rng(5)
    garbage = [
        random.integers(128, 256, int(random.integers(1, 40)), np.uint8).tobytes() for _ in stream.pieces
    ]
    data = b"".join(noise + piece for noise, piece in zip(garbage, stream.pieces, strict=True))
    clean, decoded = (decode(decoder_of(stream.settings), given) for given in (stream.data, data))
    assert list(rows(decoded.records)) == list(rows(clean.records))
    assert len(skipped_bytes(decoded)) == sum(map(len, garbage))


@pytest.mark.parametrize("name", NAMES)
def test_what_is_kept_for_later_stays_small(name: str) -> None:
    stream = STREAMS[name]
    decoder = decoder_of(stream.settings)
    random = np.random.default_rng(1)
    for _ in range(20):
        decoder.feed(random.bytes(4096) + stream.pieces[0][:8])
        assert len(decoder._rest) < 6000
